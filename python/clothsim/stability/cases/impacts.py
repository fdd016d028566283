"""Colliders that come fast, or from one place to another in no time."""

from __future__ import annotations

from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, Sides, dt_axis
from clothsim.stability.cases.common import THICKNESS
from clothsim.stability.topology import inside

__all__ = ["CASES"]

_RADIUS = 0.1


def _ball(**keys: Any) -> dict[str, Any]:
    return {"name": "ball", "shape": {"type": "sphere", "radius": _RADIUS, "tolerance": 2e-3}, **keys}


def drumhead(size: int, border: Ints, triangles: Ints) -> Sides:
    """Label whether the ball is still on its side of a sheet in y = 0 whose border is held.

    Sheet and a flat cap over its border are a closed surface: the ball's middle is in it if it is below the cap, and
    above the sheet. Both have to change together.
    """
    cap = np.column_stack([np.full(size - 2, border[0]), border[1:-1], border[2:]])
    closed = np.concatenate([triangles, cap])

    def sides(x: Floats, colliders: Floats) -> Ints:
        middle = colliders.mean(axis=0)
        return np.abs(inside(middle[None], x, closed)) - int(middle[1] < 0.0)

    return sides


def _border(n: int) -> Ints:
    """Vertices around a grid of n × n, in order."""
    edge = np.arange(n - 1)
    return np.concatenate([edge, (n - 1) + n * edge, n * n - 1 - edge, n * (n - 1 - edge)])


def _sphere(dt: float, speed: float) -> Setup:
    """A ball comes down on a sheet from 0.02 m above it, pushes its middle 0.15 m down and stops."""
    n, travel = 13, 0.17
    start, way = _RADIUS + 0.02, travel / speed
    sheet = Mesh.grid(0.4, 0.4, n, n)
    border = _border(n)
    moves = [{"time": t, "position": [0.0, y, 0.0]} for t, y in ((0.0, start), (way, start - travel))]
    scene = Scene(
        duration=max(1.5 * way, 200.0 * dt if dt < 1e-3 else 8.0 * dt), time={"dt": dt},
        contact={"thickness": THICKNESS},
        cloth=[{"name": "sheet", "mesh": sheet, "material": "cotton", "pins": [{"vertices": border}]}],
        collider=[_ball(keyframes=moves)],
    )  # fmt: skip
    return Setup(scene, drumhead(len(border), border, np.asarray(sheet.triangles)))


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
)
