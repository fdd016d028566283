"""Meshes that are badly shaped, tiny, or not there."""

from __future__ import annotations

from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, springs
from clothsim.stability.topology import above

__all__ = ["CASES"]


def _one_triangle(dt: float, stiffness: float) -> Setup:
    """A triangle falls on a floor, corner first."""
    mesh = Mesh([[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.0, 0.05, 0.1]], [[0, 2, 1]])
    scene = Scene(
        duration=max(0.3, 4.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{"name": "triangle", "mesh": mesh, "material": springs(stiffness), "position": [0.0, 0.05, 0.0]}],
        collider=[{"name": "floor", "shape": {"type": "plane", "half_size": 1.0}}],
    )  # fmt: skip
    return Setup(scene, above((0.0, 1.0, 0.0)))


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
