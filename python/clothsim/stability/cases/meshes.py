"""Meshes that are badly shaped, tiny, or not there."""

from __future__ import annotations

import math

import numpy as np

from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, springs, tensor_sheet
from clothsim.stability.topology import above

__all__ = ["CASES"]

_UP = (0.0, 1.0, 0.0)
_FLOOR = {"name": "floor", "shape": {"type": "plane", "half_size": 2.0}}


def _dropped(dt: float, mesh: Mesh, material: object, height: float, seconds: float, **keys: object) -> Setup:
    """Cloth falls from so high above a floor in y = 0."""
    scene = Scene(
        duration=max(seconds, 8.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{"name": "cloth", "mesh": mesh, "material": material, "position": [0.0, height, 0.0], **keys}],
        collider=[_FLOOR],
    )  # fmt: skip
    return Setup(scene, above(_UP))


def _one_triangle(dt: float, stiffness: float) -> Setup:
    mesh = Mesh([[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.0, 0.05, 0.1]], [[0, 2, 1]])
    return _dropped(dt, mesh, springs(stiffness), 0.05, 0.3)


def _slivers(dt: float, aspect: float) -> Setup:
    """Two rows of slivers across the middle of a sheet that comes down tilted."""
    cell = 0.05
    z = np.array([-3.0, -2.0, -1.0, 0.0, 1.0 / aspect, 2.0 / aspect, 1.0 + 2.0 / aspect, 2.0 + 2.0 / aspect]) * cell
    mesh = tensor_sheet(np.linspace(-0.15, 0.15, 7), z)
    return _dropped(dt, mesh, "cotton", 0.12, 0.3, rotation={"axis": [0, 0, 1], "angle": 0.6})


def _sizes(dt: float, ratio: float) -> Setup:
    """A quarter of a disc of rings: triangles of one shape, ever smaller towards its middle."""
    across, wide = 8, 0.5 * math.pi / 8
    rings = max(2, 1 + round(math.log(ratio) / math.log1p(wide)))
    radii = 0.3 * np.geomspace(1.0 / ratio, 1.0, rings) if ratio > 1.0 else np.array([0.25, 0.3])
    angles = np.linspace(0.0, 0.5 * math.pi, across + 1)
    points = np.stack(
        [np.outer(radii, np.cos(angles)), np.zeros((rings, across + 1)), -np.outer(radii, np.sin(angles))]
    )
    mesh = Mesh(np.moveaxis(points, 0, -1).reshape(-1, 3), tensor_sheet(angles, radii).triangles)
    return _dropped(dt, mesh, "cotton", 0.15, 0.3, rotation={"axis": [1, 0, 0], "angle": 0.4})


def _empty(dt: float, holds: str) -> Setup:
    """A scene without cloth, or with nothing for it to do."""
    scene = Scene(duration=4.0 * dt, time={"dt": dt}, contact={"thickness": THICKNESS})
    if holds != "nothing":
        scene.add_collider("floor", shape={"type": "plane", "half_size": 1.0})
    if holds == "all pinned":
        triangle = Mesh([[0, 1, 0], [1, 1, 0], [0, 1, 1]], [[0, 2, 1]])
        scene.add_cloth(triangle, "cotton", pins=[{"vertices": [0, 1, 2]}])
    return Setup(scene)


CASES = (
    Case(
        "slivers",
        "Slivers of aspect up to 10⁴",
        "Two rows of triangles across a sheet of cotton are so many times as long as they are wide: at 10⁴ they are "
        "5 µm wide, a thousandth of the thickness, and still have to bend, shear and meet a floor.",
        dt_axis(),
        Axis("aspect", (1.0, 1e1, 1e2, 1e3, 1e4), (1e2, 1e4), "", "length over width of the slivers"),
        _slivers,
    ),
    Case(
        "sizes",
        "Triangle sizes 1 : 1000",
        "A quarter of a disc in rings that grow by a constant factor: triangles of one shape, the smallest 1000 times "
        "smaller than the largest, fall on a floor.",
        dt_axis((1e-3, 2e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("ratio", (2.0, 10.0, 100.0, 1000.0), (1000.0,), "", "largest over smallest triangle's edge"),
        _sizes,
    ),
    Case(
        "one-triangle",
        "One triangle",
        "A single triangle falls on a floor with its corner first. Passed if a vertex is below the floor.",
        dt_axis(),
        Axis("stiffness", (1.0, 1e2, 1e4, 1e6), (1e2, 1e6), "N/m", "stiffness of each spring"),
        _one_triangle,
    ),
    Case(
        "empty",
        "An empty scene",
        "Nothing, only a collider, or cloth of which every vertex is held. The first two have to be refused by name.",
        dt_axis((1e-3, 1 / 24), (1 / 24,)),
        Axis("holds", ("nothing", "a collider", "all pinned"), ("nothing", "all pinned"), "", "what the scene holds"),
        _empty,
    ),
)
