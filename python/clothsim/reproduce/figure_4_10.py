"""Figure 4.10: a figure in trousers sits down and stands up again; without plasticity and with hysteresis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import accumulate
from typing import Any

from clothsim.reproduce import mannequin, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import CURVATURE, Loop
from clothsim.reproduce.residual import Run
from clothsim.scene import Scene

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 3.4, b2 = 2.85, c1 = −3.65, λ = 0.3, μ = 0.05: after sitting down and standing up folds remain with "
    "hysteresis, above all in the groin and behind the knees; without plasticity the wrinkles are smoother and simpler"
)

FABRICS = {
    "no plasticity": Loop(b1=3.4, b2=2.85, c1=-3.65),
    "λ = 0.3": Loop(b1=3.4, b2=2.85, c1=-3.65, plasticity=0.3, fatigue=0.05),
}
# λ (M0/b2) Σ (1−μ)ⁿ: what endless cycles leave [1/m].
_MOST = FABRICS["λ = 0.3"].residual(math.inf) * CURVATURE
MOMENTS = ("standing", "sitting down", "seated", "rising", "standing again")


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    around: int = 44  # vertices about the hips
    areal_density: float = 0.15
    stretch: float = 250.0
    shear: float = 50.0
    in_plane_damping: float = 1e-3
    air_damping: float = 1.0
    friction: float = 0.05
    self_friction: float = 0.1
    thickness: float = 3e-3
    bend: float = 0.8  # of the way to sitting upright on a chair: 69° at the hip, 71° at the knee
    standing: float = 0.4  # s, before
    sitting_down: float = 1.3
    seated: float = 0.3
    rising: float = 1.3
    resting: float = 0.9
    dt: float = 4e-3

    @property
    def times(self) -> list[float]:
        """Ends of standing, sitting down, sitting, rising, resting [s]."""
        return list(accumulate((self.standing, self.sitting_down, self.seated, self.rising, self.resting)))


@dataclass(frozen=True)
class Measured:
    """Both runs."""

    setup: Setup
    runs: dict[str, Run]
    triangles: int


def measure(effort: Effort) -> Measured:
    """Let the figure sit down and rise in both pairs of trousers."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, around=28, standing=0.1, sitting_down=0.9, seated=0.1, rising=0.9, resting=0.3, dt=6e-3)
    stood, sat, up, risen, end = setup.times
    moments = [round(t, 2) for t in (0.0, stood + 0.55 * (sat - stood), up, up + 0.5 * (risen - up), end)]
    with effort.bar(round(100 * end) * len(FABRICS), "figure 4.10", "frame") as bar:
        names = list(FABRICS)
        runs = effort.each(lambda name: residual.run(_scene(name, setup), moments, bar.update), names, bar)
    return Measured(setup, dict(zip(names, runs, strict=True)), len(runs[0].bodies[0].triangles))


def _scene(name: str, setup: Setup) -> Scene:
    s = setup
    stood, sat, up, risen, end = s.times
    scene = Scene(
        name=name,
        duration=end,
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self_friction": s.self_friction},
    )
    mannequin.add(scene, mannequin.sit((stood, sat, up, risen), (0.0, s.bend, s.bend, 0.0)), end)
    mesh, waist = mannequin.trousers(s.around)
    law = "hysteresis" if FABRICS[name].plasticity else "nonlinear"
    scene.add_cloth(
        mesh,
        residual.fabric(s.areal_density, s.stretch, s.shear, s.in_plane_damping, FABRICS[name].law(law)),
        name="trousers",
        pins=[{"vertices": waist, "collider": "pelvis"}],
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The thesis's coefficients, and what is chosen."""
    return {
        **FABRICS["λ = 0.3"].named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "no plasticity": "the non-linear law of the same b1, b2, c1", "bending damping": 0.0,
        "integrator": "implicit Euler", "mannequin": "capsules; no chair", "triangles": measured.triangles,
        "chosen": "all but b1, b2, c1, lambda, mu: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law, and the distribution of the rest curvature."""
    return residual.tables(measured.runs)


def here(measured: Measured) -> str:
    """Residual curvature and dihedral deviation per law, and the most that the coefficients can leave."""
    return (
        f"{residual.here(measured.runs)}; λ M0/(μ b2) = {_MOST:.1f} /m, all that these coefficients can leave in KES "
        "units, is too little for the eye"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    # What these coefficients can leave bends a hinge by less than a degree: how folds happen to lie moves them more.
    return [
        *residual.checks(measured.runs, "thesis 4.5.2, figure 4.10", rests=False),
        Check.true(
            "no residual curvature above λ M0/(μ b2)", measured.runs["λ = 0.3"].largest <= _MOST, "(4.6), (4.11)"
        ),
    ]


def draw(measured: Measured) -> bytes:
    """Film strip with hysteresis, both pairs of trousers after it, and what is left in them."""
    note = (
        f"Trousers of {measured.triangles:,} triangles on a figure of capsules that sits down and stands up. Sizes, "
        "density, stretch and motion are chosen; bending coefficients as in the thesis, in KES units."
    )
    return residual.draw("Figure 4.10: sitting down and standing up in trousers", note, measured.runs, MOMENTS)
