"""Cloth with less and less room."""

from __future__ import annotations

from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, grid
from clothsim.stability.topology import beyond, together

__all__ = ["CASES"]


def _plates(dt: float, gap: float) -> Setup:
    """Two plates close to ``gap`` times the thickness within 0.1 s, and stay."""
    far, near = 0.02, 0.5 * gap * THICKNESS

    def plate(name: str, side: float, x: float, z: float) -> dict[str, object]:
        ways = [{"time": t, "position": [x, side * y, z]} for t, y in ((0.0, far), (0.1, near))]
        return {"name": name, "shape": {"type": "plane", "half_size": 0.3}, "keyframes": ways}

    scene = Scene(
        duration=max(0.15, 4.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{"name": "sheet", "mesh": grid(0.2, 9), "material": "cotton"}],
        collider=[plate("lower", -1.0, 0.011, 0.007), plate("upper", 1.0, 0.0, 0.0)],
    )  # fmt: skip
    up = [0.0, 1.0, 0.0]
    return Setup(scene, together(beyond(slice(0, 4), up), beyond(slice(4, 8), up)))


CASES = (
    Case(
        "plates",
        "Between plates that close to less than the thickness",
        "A sheet lies between two plates that come as near as a share of the thickness; 0: they meet; below: they pass "
        "through each other, and no place is left for the cloth. Passed if a vertex is on the other side of a plate.",
        dt_axis(),
        Axis("gap", (2.0, 1.0, 0.5, 0.1, 0.01, 0.0, -1.0), (0.5, 0.0), "", "last gap over the thickness"),
        _plates,
    ),
)
