"""What the scenes of several cases have in common."""

from __future__ import annotations

from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh

__all__ = ["THICKNESS", "border", "grid", "springs", "tensor_sheet"]

# Distance of contact in cases that do not vary it [m].
THICKNESS = 0.004


def springs(stiffness: float, density: float = 0.15, damping: float = 0.0, rigidity: float = 1e-5) -> dict[str, Any]:
    """A material of springs along the edges [N/m] with a little bending [N m], so that it is no chain."""
    return {
        "areal_density": density,
        "in_plane": {"model": "spring", "stiffness": stiffness, "damping": damping},
        "bending": {"model": "hinge", "rigidity": rigidity},
    }


def border(n: int) -> Ints:
    """Vertices around a grid of n × n, in order."""
    edge = np.arange(n - 1)
    return np.concatenate([edge, (n - 1) + n * edge, n * n - 1 - edge, n * (n - 1 - edge)])


def grid(width: float, nx: int, height: float | None = None, nz: int | None = None) -> dict[str, Any]:
    """A rectangle of ``nx`` × ``nz`` vertices in the xz-plane [m]; a square by default."""
    return {"generator": "grid", "width": width, "height": height or width, "nx": nx, "ny": nz or nx}


def tensor_sheet(x: Floats, z: Floats, y: Floats | float = 0.0) -> Mesh:
    """A sheet over a tensor grid of coordinates x (i) and z (j) [m], heights ``y`` (j, i) or one; row by row in x."""
    across, along = np.meshgrid(x, z)
    points = np.stack([across, np.broadcast_to(y, across.shape), along], axis=-1).reshape(-1, 3)
    return Mesh(points, _cells(len(x), len(z)))


def _cells(nx: int, nz: int) -> Ints:
    i, j = np.meshgrid(np.arange(nx - 1), np.arange(nz - 1))
    a = (j * nx + i).ravel()
    b, c, d = a + 1, a + nx, a + nx + 1
    flip = ((i + j) % 2 == 1).ravel()
    # Front up (+y): counter-clockwise seen from above, with z towards the viewer.
    one = np.where(flip[:, None], np.column_stack([a, c, b]), np.column_stack([a, c, d]))
    two = np.where(flip[:, None], np.column_stack([b, c, d]), np.column_stack([a, d, b]))
    return np.stack([one, two], axis=1).reshape(-1, 3)
