"""Figure 4.8: a cloth with four fixed corners, twisted by a rotating rod, let go, and spread out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import accumulate
from typing import Any

from clothsim.mesh import Mesh
from clothsim.reproduce import residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import Loop
from clothsim.reproduce.residual import Run
from clothsim.scene import Scene

__all__ = ["FABRICS", "THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 4.64, b2 = 1.40, c1 = −2.15, μ = 0.02: without plasticity the cloth returns to its original bending "
    "configuration, with λ = 0.08 and 0.25 residual wrinkles and folds stay, more with the larger"
)

_CURVE = {"b1": 4.64, "b2": 1.40, "c1": -2.15}
FABRICS = {
    "no plasticity": Loop(**_CURVE),
    "λ = 0.08": Loop(**_CURVE, plasticity=0.08, fatigue=0.02),
    "λ = 0.25": Loop(**_CURVE, plasticity=0.25, fatigue=0.02),
}
MOMENTS = ("start", "corners drawn in", "twisted", "turned back", "spread out")


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    width: float = 0.2
    length: float = 0.5
    columns: int = 24  # cells
    rows: int = 60
    areal_density: float = 0.15
    stretch: float = 500.0
    shear: float = 100.0
    in_plane_damping: float = 1e-3
    air_damping: float = 1.0
    friction: float = 0.3
    self_friction: float = 0.2
    thickness: float = 2e-3
    rod: float = 0.008  # radius; it lies across the middle and carries it
    turns: float = 0.5  # about the long axis of the cloth: each half is twisted by as much
    drawn: float = 0.35  # how far the corners come towards the rod, of their distance: slack to twist
    spread: float = 0.01  # … and what is left of that in the end: no tension
    drawing: float = 0.6  # s
    twisting: float = 1.5
    held: float = 0.1
    spreading: float = 0.8
    resting: float = 1.0
    dt: float = 4e-3

    @property
    def times(self) -> list[float]:
        """Ends of drawing in, twisting, holding, turning back, spreading, resting [s]."""
        return list(accumulate((self.drawing, self.twisting, self.held, self.twisting, self.spreading, self.resting)))


@dataclass(frozen=True)
class Measured:
    """The three runs."""

    setup: Setup
    runs: dict[str, Run]


def measure(effort: Effort) -> Measured:
    """Twist the three cloths."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, columns=10, rows=26, twisting=0.6, spreading=0.5, resting=0.5, dt=5e-3)
    drawn, twisted, _, back, _, end = setup.times
    moments = (0.0, drawn, twisted, back, end)
    with effort.bar(round(100 * end) * len(FABRICS), "figure 4.8", "frame") as bar:
        names = list(FABRICS)
        runs = effort.each(lambda name: residual.run(_scene(name, setup), moments, bar.update), names, bar)
    return Measured(setup, dict(zip(names, runs, strict=True)))


def _scene(name: str, setup: Setup) -> Scene:
    s = setup
    drawn, twisted, held, back, spread, end = s.times
    scene = Scene(
        name=name,
        duration=end,
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self_friction": s.self_friction},
    )
    at = [0.0, -(s.rod + 1.1 * s.thickness), 0.0]
    turning = ((0.0, 0.0), (drawn, 0.0), (twisted, s.turns), (held, s.turns), (back, 0.0))
    scene.add_collider(
        "rod",
        shape={"type": "capsule", "radius": s.rod, "half_height": 0.5 * s.width + 0.03, "tolerance": 5e-4},
        keyframes=[
            {"time": t, "position": at, "rotation": {"axis": [0, 0, 1], "angle": 2.0 * math.pi * (0.25 + n)}}
            for t, n in turning
        ],
    )
    n, middle = s.columns + 1, s.rows // 2
    pins: list[dict[str, Any]] = [
        {"vertices": [r * n + c for r in range(middle - 1, middle + 2) for c in range(n)], "collider": "rod"}
    ]
    for far in (0, 1):
        rows = [s.rows - 1, s.rows] if far else [0, 1]
        inward = -0.5 * s.length * (2 * far - 1)
        ways = ((0.0, 0.0), (drawn, s.drawn), (back, s.drawn), (spread, s.spread * s.drawn))
        pins += [
            {
                "vertices": [r * n + c for r in rows for c in columns],
                "keyframes": [{"time": t, "position": [0.0, 0.0, w * inward]} for t, w in ways],
            }
            for columns in ([0, 1], [s.columns - 1, s.columns])
        ]
    law = "hysteresis" if FABRICS[name].plasticity else "nonlinear"
    scene.add_cloth(
        Mesh.grid(s.width, s.length, n, s.rows + 1),
        residual.fabric(s.areal_density, s.stretch, s.shear, s.in_plane_damping, FABRICS[name].law(law)),
        pins=pins,
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The thesis's coefficients, and what is chosen."""
    return {
        **FABRICS["λ = 0.25"].named(), "lambda": "0.08 (low), 0.25 (high)",
        **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "no plasticity": "the non-linear law of the same b1, b2, c1", "bending damping": 0.0,
        "integrator": "implicit Euler",
        "chosen": "all but b1, b2, c1, lambda, mu and that four corners are fixed: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law, and the distribution of the rest curvature."""
    return residual.tables(measured.runs)


def here(measured: Measured) -> str:
    """Residual curvature and dihedral deviation per law."""
    return residual.here(measured.runs)


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    return residual.checks(measured.runs, "thesis 4.5.2, figure 4.8")


def draw(measured: Measured) -> bytes:
    """Film strip with the larger λ, the three cloths spread out, and what is left in them."""
    s = measured.setup
    note = (
        f"A sheet of {100 * s.width:.0f} × {100 * s.length:.0f} cm; its corners are drawn in by {100 * s.drawn:.0f} %, "
        f"a rod across its middle turns by {360 * s.turns:.0f}° and back, and the corners spread it out again. Sizes, "
        "density and stretch are chosen; bending coefficients as in the thesis, in KES units."
    )
    return residual.draw("Figure 4.8: twisted by a rotating rod, then spread out", note, measured.runs, MOMENTS)
