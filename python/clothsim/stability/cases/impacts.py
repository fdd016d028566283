"""Colliders that come fast, or from one place to another in no time."""

from __future__ import annotations

import numpy as np

from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, border
from clothsim.stability.topology import drumhead

__all__ = ["CASES"]

_RADIUS, _GAP = 0.1, 0.02


def _struck(dt: float, travel: float, way: float, seconds: float) -> Setup:
    """A ball goes down by ``travel`` [m] within ``way`` [s], from above a sheet whose border is held."""
    n, start = 13, _RADIUS + _GAP
    sheet = Mesh.grid(0.4, 0.4, n, n)
    edge = border(n)
    moves = [{"time": t, "position": [0.0, y, 0.0]} for t, y in ((0.0, start), (way, start - travel))]
    shape = {"type": "sphere", "radius": _RADIUS, "tolerance": 2e-3}
    scene = Scene(
        duration=seconds, time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{"name": "sheet", "mesh": sheet, "material": "cotton", "pins": [{"vertices": edge}]}],
        collider=[{"name": "ball", "shape": shape, "keyframes": moves}],
    )  # fmt: skip
    label = drumhead(edge, np.asarray(sheet.triangles))
    return Setup(scene, lambda x, colliders: label(x, colliders.mean(axis=0)))


def _sphere(dt: float, speed: float) -> Setup:
    """It pushes the middle of the sheet 0.15 m down and stops."""
    travel = 0.15 + _GAP
    way = travel / speed
    return _struck(dt, travel, way, max(1.5 * way, 200.0 * dt if dt < 1e-3 else 8.0 * dt))


def _jump(dt: float, jump: float) -> Setup:
    """It is elsewhere from one step to the next."""
    return _struck(dt, jump, 1e-9, max(0.02, 12.0 * dt))


CASES = (
    Case(
        "fast-sphere",
        "A sphere at up to 100 m/s",
        "A ball hits the middle of a sheet whose border is held and pushes it in, deeper than its own radius, within a "
        "single step at the top right. Passed if the middle of the ball is on the other side of the sheet.",
        dt_axis(),
        Axis("speed", (1.0, 3.0, 10.0, 30.0, 100.0), (3.0, 100.0), "m/s", "speed of the ball"),
        _sphere,
    ),
    Case(
        "jump",
        "A collider that jumps",
        "The same ball is above the sheet and, a nanosecond later, so far below: in it, just through it, or metres "
        "away. It has to take the sheet along, or the run has to stop.",
        dt_axis(),
        Axis("jump", (0.01, 0.05, 0.15, 0.3, 1.0, 10.0), (0.05, 0.3), "m", "way of the jump"),
        _jump,
    ),
)
