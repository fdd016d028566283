"""Cloth with less and less room."""

from __future__ import annotations

from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, grid
from clothsim.stability.topology import beyond, together

__all__ = ["CASES"]

_UP = (0.0, 1.0, 0.0)


def _plate(name: str, start: Any, end: Any, size: float, seconds: float = 0.1) -> dict[str, Any]:
    """A square that moves from one place to another."""
    ways = [{"time": t, "position": list(p)} for t, p in ((0.0, start), (seconds, end))]
    return {"name": name, "shape": {"type": "plane", "half_size": size}, "keyframes": ways}


def _plates(dt: float, gap: float) -> Setup:
    """Two plates close to ``gap`` times the thickness within 0.1 s, and stay."""
    far, near = 0.02, 0.5 * gap * THICKNESS
    scene = Scene(
        duration=max(0.15, 4.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{"name": "sheet", "mesh": grid(0.2, 9), "material": "cotton"}],
        collider=[
            _plate("lower", (0.011, -far, 0.007), (0.011, -near, 0.007), 0.3),
            _plate("upper", (0.0, far, 0.0), (0.0, near, 0.0), 0.3),
        ],
    )  # fmt: skip
    return Setup(scene, together(beyond(slice(0, 4), _UP), beyond(slice(4, 8), _UP)))


def _box(dt: float, side: float) -> Setup:
    """Six walls close around a slanting sheet of 0.2 m, to ``side`` times its length, within 0.3 s."""
    width = 0.2
    walls: list[dict[str, Any]] = []
    for k, axis in enumerate(np.eye(3)):
        turn = ({"axis": [0, 0, 1], "angle": 0.5 * np.pi}, None, {"axis": [1, 0, 0], "angle": 0.5 * np.pi})[k]
        for way in (-1.0, 1.0):
            start, end = (way * axis * f for f in (0.75 * width, 0.5 * side * width))
            walls.append(_plate(f"wall {len(walls)}", start, end, 0.3, 0.3) | ({"rotation": turn} if turn else {}))
    scene = Scene(
        duration=max(0.35, 4.0 * dt), time={"dt": dt}, contact={"thickness": 0.002},
        cloth=[{
            "name": "sheet", "mesh": grid(width, 17), "material": "cotton",
            "rotation": {"axis": [1.0, 0.3, 0.5], "angle": 0.5},
        }],
        collider=walls,
    )  # fmt: skip
    normals = np.repeat(np.eye(3), 2, axis=0)
    return Setup(scene, together(*(beyond(slice(4 * k, 4 * k + 4), n) for k, n in enumerate(normals))))


def _fold(dt: float, gap: float) -> Setup:
    """A plate presses one half of a folded strip on the other, held half; a negative gap: mirrored."""
    way = np.sign(gap)
    lean = np.radians(100.0)  # from flat; it leans over the held half
    rows, held_size, size = 5, 0.14, 0.1  # the free half is shorter: it does not slip over the edge
    z = np.linspace(-0.1, 0.1, rows)
    flat = [(-held_size, 0.0), (0.0, 0.0), (size, 0.0)]
    bent = [(-held_size, 0.0), (0.0, 0.0), (size * np.cos(lean), way * size * np.sin(lean))]
    points = np.array([[x, y, v] for v in z for x, y in bent])
    uv = np.array([[x, v] for v in z for x, _ in flat])
    triangles: list[list[int]] = []
    for r in range(rows - 1):
        for c in range(2):
            a, b = 3 * r + c, 3 * (r + 1) + c
            triangles += [[a, b, b + 1], [a, b + 1, a + 1]]
    held = [3 * r + c for r in range(rows) for c in (0, 1)]
    start = way * 1.05 * size
    scene = Scene(
        duration=max(0.15, 4.0 * dt), gravity=[0, 0, 0], time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{
            "name": "strip", "mesh": Mesh(points, triangles, uv), "rest": "uv", "material": "cotton",
            "pins": [{"vertices": held}],
        }],
        collider=[_plate("plate", (0.003, start, 0.005), (0.003, gap * THICKNESS, 0.005), 0.2)],
    )  # fmt: skip

    def sides(x: Floats, colliders: Floats) -> Ints:
        """Side of the plate, and of the held half for what lies over it: a blow may take a corner around its edge."""
        over = (x[:, 0] < -1e-3) & (x[:, 0] > -held_size) & (np.abs(x[:, 2]) < 0.1)
        over[held] = False
        below = np.sign(colliders[:, 1].mean() - x[:, 1]) * way
        return np.concatenate([below, over & (x[:, 1] * way < 0.0)]).astype(np.int64)

    return Setup(scene, sides)


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
    Case(
        "shrinking-box",
        "Crumpling in a shrinking box",
        "Six walls close in on a sheet of cotton, to a box of a share of its length. At 0.1 the cloth at its distance "
        "of contact fills a fifth of it. Passed if a vertex is on the other side of a wall.",
        dt_axis((1e-3, 2e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("side", (0.6, 0.4, 0.3, 0.2, 0.1), (0.4,), "", "last side of the box over the sheet's"),
        _box,
    ),
    Case(
        "fold",
        "A fold pressed to ±π",
        "A strip with a single crease is pressed flat by a plate that comes as near to the held half as a share of "
        "the thickness, from above and mirrored: the hinges of the crease go to ±π, where an angle jumps.",
        dt_axis(),
        Axis("gap", (-0.01, -0.1, -1.0, 2.0, 1.0, 0.1, 0.01), (-0.1, 1.0), "", "last gap over the thickness"),
        _fold,
    ),
)
