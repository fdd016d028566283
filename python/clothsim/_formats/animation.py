"""Animated meshes of fixed topology: files in, one array of positions per frame out.

One module per kind of file; here is what they share: units, axes, and the checks that every frame must pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats.gltf_document import MOST_POINTS
from clothsim.errors import MeshError

__all__ = ["DEFAULT_FPS", "MOST_POINTS", "RawAnimation", "Request", "allocate", "check_frame", "read"]

# Samples per second of a file that is continuous in time.
DEFAULT_FPS = 60.0


class RawAnimation(NamedTuple):
    """Positions (frames, n, 3) [m], triangles (m, 3), frames per second and the axis that is up if the file says so."""

    positions: Floats
    triangles: Ints
    fps: float | None
    up: str | None = None


@dataclass(frozen=True)
class Request:
    """What is asked of a file.

    Attributes
    ----------
    fps : float or None
        Samples per second; by default the file's own rate, or 60 where it has none. Not read for single frames, which
        have no times.
    scale : float
        Metres per unit of the file, on top of what the file says of its unit.
    up : {"y", "z"} or None
        The axis that points up in the file; by default what the file says, else that of the scene.
    scene_up : {"y", "z"}
        The axis that points up in the scene.
    animation : str or None
        Name of the animation in a glTF file; by default the only one.
    part : str or None
        Name of a glTF node or path of a USD prim: it and what hangs below; by default everything.
    """

    fps: float | None = None
    scale: float = 1.0
    up: str | None = None
    scene_up: str = "y"
    animation: str | None = None
    part: str | None = None


def read(path: Path, request: Request) -> RawAnimation:
    """Read an animated mesh: ``.npz``, a folder or pattern of OBJ/PLY/STL frames, glTF with skin or morph targets, USD.

    Raises
    ------
    MeshError
        Names the file, and the frame, vertex, node or prim where it is not what it must be.
    MissingDependency
        A USD file without usd-core.
    """
    suffix = path.suffix.lower()
    load: Callable[[Path, Request], RawAnimation]
    has_parts = suffix in (".gltf", ".glb", ".usd", ".usda", ".usdc", ".usdz")
    if suffix == ".npz":
        from clothsim._formats.archive import load
    elif suffix in (".gltf", ".glb"):
        from clothsim._formats.gltf import load
    elif suffix in (".usd", ".usda", ".usdc", ".usdz"):
        from clothsim._formats.usd import load
    else:
        from clothsim._formats.frames import load
    if suffix not in (".gltf", ".glb") and request.animation is not None:
        raise MeshError(f"{path}: animation: only a glTF file names its animations", kind="file")
    if not has_parts and request.part is not None:
        raise MeshError(f"{path}: part: only glTF and USD files have named parts", kind="file")
    raw = load(path, request)
    positions = raw.positions
    if request.scale != 1.0:
        positions = positions * request.scale
    if (request.up or raw.up or request.scene_up) != request.scene_up:
        positions = turned(positions, to=request.scene_up)
    for frame, x in enumerate(positions):
        check_frame(path, frame, x)
    return RawAnimation(np.ascontiguousarray(positions), raw.triangles, raw.fps)


def turned(positions: Floats, *, to: str) -> Floats:
    """Turn about x by a quarter so that the other axis points up: y to z for ``to = "z"``, z to y for ``to = "y"``."""
    x, y, z = (positions[..., k] for k in range(3))
    return np.stack((x, -z, y) if to == "z" else (x, z, -y), axis=-1)


def check_frame(path: Path | str, frame: int, positions: Floats) -> None:
    """Refuse coordinates that are not finite, naming the first vertex."""
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        vertex = int(np.argmin(finite))
        raise MeshError(
            f"{path}: expected finite coordinates in every frame, got {positions[vertex].tolist()} at frame {frame}, "
            f"vertex {vertex}",
            kind="not-finite",
        )


def allocate(path: Path | str, frames: int, vertices: int) -> Floats:
    """Room for all frames, if that is not more than a file may ask for."""
    if frames * vertices > MOST_POINTS:
        raise MeshError(
            f"{path}: expected at most {MOST_POINTS} positions in all frames, got {frames} × {vertices}",
            kind="file",
        )
    return np.empty((frames, vertices, 3))
