"""Many layers, narrow ways, sharp points."""

from __future__ import annotations

import math

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, grid
from clothsim.stability.topology import above, order_of_sheets, together

__all__ = ["CASES"]

_DT = (1e-3, 2e-3, 5e-3, 1 / 60, 1 / 24)
_SHEETS, _N = 20, 7


def _stack(dt: float, gap: float) -> Setup:
    """Twenty sheets above each other, each turned a little, come down on a floor."""
    sheets = [
        {
            "name": f"sheet {k}", "mesh": grid(0.2, _N), "material": "cotton",
            "position": [0.003 * math.sin(k), (k + 1.0) * gap * THICKNESS, 0.003 * math.cos(2.0 * k)],
            "rotation": {"axis": [0, 1, 0], "angle": 0.1 * k},
        }
        for k in range(_SHEETS)
    ]  # fmt: skip
    scene = Scene(
        duration=max(0.3, 8.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS}, cloth=sheets,
        collider=[{"name": "floor", "shape": {"type": "plane", "half_size": 1.0}}],
    )  # fmt: skip
    return Setup(scene, together(above((0.0, 1.0, 0.0)), order_of_sheets(_SHEETS, _N * _N)))


# The funnel: heights and radii of its rings [m]; the first radius is that of the hole.
_RIM, _NECK, _FOOT = (0.12, 0.2), 0.0, -0.1


def _funnel(dt: float, hole: float) -> Setup:
    """A disc falls into a funnel; a ball pushes it through the neck within 0.4 s."""
    around = 24
    angles = np.linspace(0.0, 2.0 * math.pi, around, endpoint=False)
    rings = [(_RIM[0], _RIM[1]), (0.5 * _RIM[0], 0.5 * (_RIM[1] + hole)), (_NECK, hole), (_FOOT, hole)]
    points = np.array([[r * math.cos(a), y, r * math.sin(a)] for y, r in rings for a in angles])
    triangles: list[list[int]] = []
    for base in range(0, around * (len(rings) - 1), around):
        for i in range(around):
            j = (i + 1) % around
            a, b, c, d = base + i, base + j, base + around + i, base + around + j
            triangles += [[a, c, b], [b, c, d]]
    moves = [{"time": t, "position": [0.001, y, 0.002]} for t, y in ((0.0, 0.2), (0.4, -0.08))]
    scene = Scene(
        duration=max(0.45, 0.4 + 4.0 * dt), time={"dt": dt}, contact={"thickness": 0.002},
        cloth=[{
            "name": "disc", "mesh": {"generator": "disc", "radius": 0.15, "rings": 9}, "material": "silk",
            "position": [0.0, 0.16, 0.0],
        }],
        collider=[
            {"name": "funnel", "mesh": Mesh(points, triangles)},
            {"name": "ball", "shape": {"type": "sphere", "radius": 0.02, "tolerance": 2e-3}, "keyframes": moves},
        ],
    )  # fmt: skip
    heights, radii = np.array([y for y, _ in rings])[::-1], np.array([r for _, r in rings])[::-1]

    def sides(x: Floats, _: Floats) -> Ints:
        """Vertices at the height of the funnel are in it: it has a ridge at the top that nothing comes over."""
        wall = np.interp(x[:, 1], heights, radii)
        beside = (x[:, 1] > heights[0]) & (x[:, 1] < heights[-1])
        outside: Ints = (beside & (np.hypot(x[:, 0], x[:, 2]) > wall)).astype(np.int64)
        return outside

    return Setup(scene, sides)


def _spikes(dt: float, sharp: float) -> Setup:
    """A sheet comes down on nine cones at 2 m/s."""
    height = 0.08
    cone = {"type": "cone", "radius": height / sharp, "height": height, "tolerance": 0.1 * height / sharp}
    spikes = [
        {"name": f"spike {i} {j}", "shape": cone, "position": [0.08 * i, 0.0, 0.08 * j]}
        for i in (-1, 0, 1) for j in (-1, 0, 1)
    ]  # fmt: skip
    scene = Scene(
        duration=max(0.2, 8.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[{
            "name": "sheet", "mesh": grid(0.3, 13), "material": "cotton", "velocity": [0.0, -2.0, 0.0],
            "position": [0.005, 0.5 * height + 0.06, 0.003],
        }],
        collider=spikes,
    )  # fmt: skip
    return Setup(scene)


CASES = (
    Case(
        "stack",
        "A stack of 20 sheets",
        "Twenty sheets of cotton lie above each other on a floor, at a share or a multiple of the thickness. Passed if "
        "two neighbours change places or a vertex is below the floor.",
        dt_axis(_DT),
        Axis("gap", (0.1, 0.5, 1.0, 2.0, 5.0), (1.0,), "", "gap over the thickness"),
        _stack,
    ),
    Case(
        "funnel",
        "The funnel",
        "A disc of silk of 0.15 m radius falls into a funnel and is pushed through its neck by a ball of 0.02 m. "
        "Passed if a vertex is outside the funnel's wall.",
        dt_axis(_DT),
        Axis("hole", (0.08, 0.06, 0.045, 0.035, 0.028), (0.06,), "m", "radius of the neck"),
        _funnel,
    ),
    Case(
        "spikes",
        "Spikes",
        "A sheet of cotton comes down at 2 m/s on nine cones, up to a hundred times as high as wide at their foot. A "
        "pierced sheet intersects the cone for good.",
        dt_axis(_DT),
        Axis("sharpness", (1.0, 4.0, 10.0, 30.0, 100.0), (4.0, 100.0), "", "height over radius of the cones"),
        _spikes,
    ),
)
