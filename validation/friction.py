"""The tests of friction together, and what they are compared with."""

from __future__ import annotations

import numpy as np

from . import block, capstan, cards, carried, sliding, slope

TESTS = {"cards": cards.run, "carried": carried.run, "slope": slope.run, "block": block.run, "capstan": capstan.run}

LAW = "friction as in T. H. Wong 2014, Improvements to Physically Based Cloth Simulation (thesis), equations 7.1 to 7.7"
CARD = (
    f"dv/dt = g sin a - F_k(v)/m, tan a = 0.3, solved in validation/sliding.py to 1e-10; {LAW}, parameters of "
    "table 7.1, card"
)
BLOCK = (
    f"m x'' = k (V t - x) - friction, with stick phases, solved in validation/sliding.py to 1e-10; {LAW}, parameters "
    "of table 7.1, stick-slip"
)
CONVEYOR = (
    f"du/dt = -F_k(u)/m relative to the conveyor, until it stops, solved in validation/sliding.py to 1e-10; {LAW}, "
    "parameters of table 7.1, card"
)
TURNTABLE = (
    "(R A)^2 + (R w^2)^2 = (mu_s g)^2, A the table's angular acceleration; under Coulomb's law also the time until the "
    "slip is seen (validation/carried.py)"
)
STICK_SLIP = "2 D/V + (2/w) (pi - atan(D w/V)), D = (mu_s - mu_c) m g/k, w = sqrt(k/m): from the same equation"
ANGLE = "balance of forces on a slope: C. A. Coulomb 1785, Theorie des machines simples"
REST = "a card below its angle of friction rests"
EULER = (
    "T2/T1 = exp(mu phi): L. Euler 1769, Remarques sur l'effet du frottement dans l'equilibre, Memoires de l'academie "
    "des sciences de Berlin 18, 265-278"
)


def rows() -> list[tuple[object, ...]]:
    """Rows of targets.csv."""
    solved, formula = "solution of an equation", "formula"
    out: list[tuple[object, ...]] = []

    def add(
        test: str, case: str, quantity: str, unit: str, target: float, kind: str, source: str, note: str = ""
    ) -> None:
        out.append((test, case, quantity, unit, target, kind, None, None, None, None, source, note))

    for name, law in cards.LAWS.items():
        add("cards", name, "way in 2 s", "m", cards.target(law), solved, CARD, _parameters(law))
    for name, law in carried.LAWS.items():
        way = float(carried.solution(name).way[-1])
        add("carried", name, "way on a conveyor", "m", way, solved, CONVEYOR, _parameters(law))
        add("carried", name, "cast off by a turntable", "rad/s", carried.cast_off_speed(name), formula, TURNTABLE)
    for mu in slope.COEFFICIENTS:
        add("slope", f"mu_s {mu:g}", "angle", "degree", float(np.degrees(np.arctan(mu))), formula, ANGLE)
    add("slope", f"{slope.BELOW:g} degree below atan {slope.REST_MU:g}", "drift over 60 s", "m/s", 0.0, formula, REST)
    for name, law in block.LAWS.items():
        way = float(block.solution(law, 2).x[-1])
        add("block", name, f"way in {block.SECONDS:g} s", "m", way, solved, BLOCK, _parameters(law))
        if name == "C":
            add("block", name, "stick phases after the first", "-", 0.0, solved, BLOCK)
        else:
            kind, source = (formula, STICK_SLIP) if name == "CS" else (solved, BLOCK)
            add("block", name, "stick-slip period", "s", block.exact_period(name), kind, source)
    for mu in capstan.COEFFICIENTS:
        for wrap in capstan.WRAPS:
            ratio = sliding.capstan(mu, float(np.radians(wrap)))
            add("capstan", f"mu {mu:g}, {wrap:g} degrees", "ratio of tensions", "-", ratio, formula, EULER)
    for name, law in capstan.LAWS.items():
        case = capstan.Case(law, 180.0, "")
        if name != "C":
            text = f"{name} sliding with {capstan.SPEED:g} m/s, mu {case.mu:.4g}, 180 degrees"
            note = f"{_parameters(law)}; T + f_v V R/mu instead of T" if law.f_v else _parameters(law)
            add("capstan", text, "ratio of tensions", "-", sliding.capstan(case.mu, np.pi), formula, EULER, note)
    return out


def _parameters(law: sliding.Law) -> str:
    return ", ".join(f"{name} {value}" for name, value in law.table.items())
