"""Twists and knots."""

from __future__ import annotations

import math

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.reproduce.knots import centre_lines
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, Sides, dt_axis
from clothsim.stability.cases.common import tensor_sheet
from clothsim.stability.topology import linking_number

__all__ = ["CASES"]

_UNIT = 0.01  # m, of the drawing of a knot
_ROWS = 4  # of vertices across a ribbon
_WIDTH = 0.7 * _UNIT
_DT = (1e-3, 2e-3, 5e-3, 1 / 60, 1 / 24)


def _twist(dt: float, turns: float) -> Setup:
    """A ribbon between two clamps, one of which turns within 0.5 s."""
    moves = [
        {"time": t, "rotation": {"axis": [1, 0, 0], "angle": a}} for t, a in ((0.0, 0.0), (0.5, 2.0 * math.pi * turns))
    ]
    ends = [[40 * r, 40 * r + 1] for r in range(5)]
    scene = Scene(
        duration=max(0.6, 0.5 + 4.0 * dt), gravity=[0, 0, 0], time={"dt": dt}, contact={"thickness": 0.001},
        cloth=[{
            "name": "ribbon", "mesh": {"generator": "grid", "width": 0.4, "height": 0.03, "nx": 40, "ny": 5},
            "material": "cotton",
            "pins": [
                {"vertices": [v for pair in ends for v in pair]},
                {"vertices": [v + 38 for pair in ends for v in pair], "keyframes": moves},
            ],
        }],
    )  # fmt: skip
    return Setup(scene)


def _ribbon(line: Floats, columns: int) -> Mesh:
    """A flat ribbon along a line: its sides lie in the plane of the drawing."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], columns + 1)
    centre = np.stack([np.interp(at, s, line[:, k]) for k in range(3)], axis=1)
    tangent = np.gradient(centre, axis=0)
    aside = np.stack([-tangent[:, 1], tangent[:, 0], np.zeros(len(tangent))], axis=1)
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    across = np.linspace(-0.5 * _WIDTH, 0.5 * _WIDTH, _ROWS)
    points = centre[None] + across[:, None, None] * aside[None]
    return Mesh(points.reshape(-1, 3), tensor_sheet(at, across).triangles)


def _knot(dt: float, pull: float, knot: str, columns: int) -> Setup:
    """What is held is pulled apart along x within 0.2 s: all ends of a reef knot, long end and loop of a bowline."""
    meshes = [_ribbon(_UNIT * line, columns) for line in centre_lines(knot)]
    cloth = []
    for k, mesh in enumerate(meshes):
        middle = np.asarray(mesh.vertices).reshape(_ROWS, columns + 1, 3).mean(axis=0)
        loop = np.flatnonzero(middle[:, 0] < 0.95 * middle[:, 0].min())
        pins = []
        for held in ([0], [columns] if knot == "reef" else loop.tolist()):
            way = float(np.sign(middle[held[0], 0])) * pull
            vertices = [row * (columns + 1) + column for row in range(_ROWS) for column in held]
            moves = [{"time": 0.0}, {"time": 0.2, "position": [way, 0.0, 0.0]}]
            pins.append({"vertices": vertices, "keyframes": moves})
        cloth.append({"name": f"ribbon {k}", "mesh": mesh, "material": "cotton", "pins": pins})
    scene = Scene(
        duration=max(0.25, 0.2 + 4.0 * dt), gravity=[0, 0, 0], time={"dt": dt}, contact={"thickness": 0.001},
        cloth=cloth,
    )  # fmt: skip
    return Setup(scene, _linked(len(meshes), columns))


def _linked(count: int, columns: int) -> Sides | None:
    """Label two ribbons by their linking number, each closed by a straight line between its ends.

    A strand that goes through one of the other ribbon changes it by 1. Of a single ribbon there is no such number.
    """
    if count < 2:
        return None

    def sides(x: Floats, _: Floats) -> Ints:
        first, second = x.reshape(2, _ROWS, columns + 1, 3)[:, 1]  # edges of the mesh, which cannot pass
        return np.array([linking_number(first, second)])

    return sides


def _reef(dt: float, pull: float) -> Setup:
    return _knot(dt, pull, "reef", 110)


def _bowline(dt: float, pull: float) -> Setup:
    return _knot(dt, pull, "bowline", 230)


CASES = (
    Case(
        "twist",
        "Ten turns of twist",
        "A ribbon of cotton, 0.4 by 0.03 m, is held at one end and turned at the other, up to ten times within half a "
        "second; at the largest step by five radians at once.",
        dt_axis(_DT),
        Axis("turns", (1.0, 3.0, 6.0, 10.0), (3.0,), "", "turns"),
        _twist,
    ),
    Case(
        "reef",
        "A reef knot pulled tight",
        "Two ribbons in a reef knot are pulled apart at their four ends. Passed if their linking number changes.",
        dt_axis(_DT),
        Axis("pull", (0.01, 0.03, 0.06, 0.1), (0.03,), "m", "way of each end"),
        _reef,
    ),
    Case(
        "bowline",
        "A bowline pulled tight",
        "One ribbon in a bowline is pulled at its long end and at its loop; its short end is free.",
        dt_axis(_DT),
        Axis("pull", (0.01, 0.03, 0.06, 0.1), (0.03,), "m", "way of end and loop"),
        _bowline,
    ),
)
