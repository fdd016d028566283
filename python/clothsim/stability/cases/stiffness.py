"""Stiff cloth at large steps: stretch, bending, and what each integrator makes of it."""

from __future__ import annotations

from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import grid, springs

__all__ = ["CASES"]

_DT = (1e-5, 1e-4, 1e-3, 5e-3, 1 / 60, 1 / 24)
_IMPLICIT = ("implicit-euler", "implicit-newton", "semi-implicit")


def _hanging(dt: float, stiffness: float, rigidity: float = 1e-5, integrator: str = "implicit-euler") -> Setup:
    """A level sheet, held at two corners, swings down."""
    scene = Scene(duration=0.25, time={"dt": dt, "integrator": integrator})
    scene.add_cloth(grid(0.3, 7), springs(stiffness, rigidity=rigidity), pins=[{"vertices": [0, 6]}])
    return Setup(scene)


def _stretch(dt: float, stiffness: float) -> Setup:
    return _hanging(dt, stiffness)


def _bending(dt: float, rigidity: float) -> Setup:
    return _hanging(dt, 1e3, rigidity)


def _integrators(dt: float, integrator: str) -> Setup:
    return _hanging(dt, 1e3, integrator=integrator)


CASES = (
    Case(
        "stretch",
        "Stretch stiffness 1 to 10⁷ N/m",
        "A sheet of 0.15 kg/m² on springs, held at two corners, swings down. Seven orders of stiffness on one mesh: "
        "the stiffest has eigenfrequencies far above any of the steps, the softest hangs like rubber.",
        dt_axis(_DT, (1e-3, 1 / 24)),
        Axis("stiffness", tuple(10.0**k for k in range(8)), (1.0, 1e7), "N/m", "stiffness of each spring"),
        _stretch,
    ),
    Case(
        "bending",
        "Bending rigidity 10⁻⁹ to 1 N·m",
        "The same sheet with bending from none to speak of to that of a steel plate of a quarter of a millimetre.",
        dt_axis(_DT[1:], (5e-3,)),
        Axis("rigidity", (1e-9, 1e-7, 1e-5, 1e-3, 1e-1, 1.0), (1e-9, 1.0), "N m", "bending rigidity"),
        _bending,
    ),
    Case(
        "integrators",
        "Six integrators at steps from 10⁻⁵ to 1/24 s",
        "The same sheet with springs of 1000 N/m under every integrator: explicit ones have a largest stable step, and "
        "past it have to be caught. The promise is made for the implicit ones alone.",
        dt_axis(_DT, (1e-3, 1 / 60)),
        Axis(
            "integrator",
            ("explicit-euler", "midpoint", "rk4", *_IMPLICIT),
            ("explicit-euler", "rk4", "implicit-newton"),
        ),
        _integrators,
        lambda _, integrator: integrator in _IMPLICIT,
    ),
)
