"""Figure 7.7: displacement, velocity and friction over time of four cards that slide down a plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce import cards, pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, LAWS, TABLE_7_1, Slide

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "μ_c = 0.1, μ_s = 0.2, v_S = 0.4, δ_S = 0.2: C and CS slide with the same velocity and under the same friction; "
    "CSS and CSSV slide slower, as friction begins higher, falling towards the Coulomb level for CSS and rising again "
    "for CSSV, which is the slowest"
)

COEFFICIENTS = TABLE_7_1["card"]
DURATION, FRAMES = 2.0, 200
STEPS = (1e-3, 4e-3)  # s, the first is drawn
TOLERANCE = 0.01  # of the displacement after two seconds


@dataclass(frozen=True)
class Measured:
    """Runs by time step, and solutions of the differential equation at their times."""

    setup: cards.Cards
    runs: dict[float, cards.Run]
    exact: dict[str, Slide]

    @property
    def drawn(self) -> cards.Run:
        """The run with the smallest step."""
        return self.runs[min(self.runs)]

    def off(self, law: str, dt: float) -> float:
        """Displacement at the end against the differential equation, relative."""
        return float(self.runs[dt].way[law][-1] / self.exact[law].way[-1] - 1.0)

    def force(self, law: str) -> tuple[Floats, Floats, Floats]:
        """Times half-way between frames [s], friction there, and the exact one [N]."""
        run = self.drawn
        at, found = self.setup.friction(run.times, run.speed[law])
        return at, found, self.setup.friction(run.times, self.exact[law].speed)[1]


def measure(effort: Effort) -> Measured:
    """Let the cards slide, once for each time step."""
    setup = cards.Cards()
    steps = STEPS[1:] if effort.quick else STEPS
    if effort.quick:
        setup = replace(setup, cells=(3, 4))
    with effort.bar(FRAMES * len(steps), "figure 7.7", "frame") as bar:
        runs = effort.each(
            lambda dt: cards.run(replace(setup, dt=dt), COEFFICIENTS, DURATION, FRAMES, tick=bar.update), steps, bar
        )
    exact = {law: setup.exact(COEFFICIENTS, law, runs[0].times) for law in LAWS}
    return Measured(setup, dict(zip(steps, runs, strict=True)), exact)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    setup = {f"{key} [SI]": value for key, value in asdict(measured.setup).items() if key != "dt"}
    return {
        **COEFFICIENTS.named(), **setup, "time steps [s]": " ".join(f"{dt:g}" for dt in measured.runs),
        "F_v of the scene [N/m2 per m/s]": COEFFICIENTS.per_area(measured.setup.areal_density),
        "slope": "tan alpha = 0.3: between the thesis's thresholds 0.15 and 0.3 with mu_s = 2 mu_c",
        "chosen": "all but the coefficients: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """The motion at each frame beside its differential equation; one row per law and step."""
    run = measured.drawn
    columns = (
        "law", "time [s]", "displacement [m]", "exact [m]", "velocity [m/s]", "exact [m/s]",
        "friction since the frame before [N]", "exact [N]",
    )  # fmt: skip
    rows = []
    for law in LAWS:
        _, force, exact = (np.concatenate([[np.nan], part]) for part in measured.force(law))
        values = (
            run.times, run.way[law], measured.exact[law].way, run.speed[law], measured.exact[law].speed, force, exact,
        )  # fmt: skip
        rows += [(law, *map(float, row)) for row in zip(*values, strict=True)]
    summary = [
        (law, dt, float(r.way[law][-1]), float(measured.exact[law].way[-1]), measured.off(law, dt))
        for law in LAWS
        for dt, r in measured.runs.items()
    ]
    names = ("law", "time step [s]", "displacement after 2 s [m]", "exact [m]", "relative difference")
    return {"": Table(columns, rows), "displacement": Table(names, summary)}


def here(measured: Measured) -> str:
    """Displacements, and how far they are off."""
    ways = ", ".join(f"{law} {measured.drawn.way[law][-1]:.3f}" for law in LAWS)
    worst = max(abs(measured.off(law, dt)) for law in LAWS for dt in measured.runs)
    return (
        f"after 2 s at tan α = 0.3 the cards have slid {ways} m; at most {100.0 * worst:.2f} % off their differential "
        f"equation, time steps of {' and '.join(f'{1e3 * dt:g}' for dt in measured.runs)} ms"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """Displacements against the differential equation, and the thesis's order."""
    run, source = measured.drawn, "thesis 7.5, figure 7.7"
    way = {law: float(run.way[law][-1]) for law in LAWS}
    force = {law: measured.force(law)[1] for law in LAWS}
    same = float(np.abs(run.speed["C"] - run.speed["CS"]).max() / run.speed["C"].max())
    early, late = slice(0, 20), slice(-20, None)
    found = [
        Check(f"displacement after 2 s, {law}, dt = {1e3 * dt:g} ms: relative difference", measured.off(law, dt), 0.0,
              TOLERANCE, "differential equation of the card; 1 %")
        for law in LAWS
        for dt in measured.runs
    ]  # fmt: skip
    return [
        *found,
        Check("velocity of CS against C, relative", same, 0.0, 1e-2, f"{source}: the same velocity"),
        Check.true("CSS slides slower than C, CSSV slowest", way["C"] > way["CSS"] > way["CSSV"], source),
        Check.true("friction of CSS falls", bool(force["CSS"][early].mean() > force["CSS"][late].mean()), source),
        Check.true("friction of CSSV rises in the end", bool(force["CSSV"][late].mean() > force["CSSV"].min()), source),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """Displacement, velocity and friction, lines of the simulation over the exact ones."""
    setup, run = measured.setup, measured.drawn
    note = (
        f"Lines: simulated cards of {1e3 * setup.mass:.0f} g, time step {1e3 * min(measured.runs):g} ms; dashes: the "
        "differential equation of each. tan α = 0.3; F_v is read as 0.6/s times the mass."
    )
    figure = pictures.figure("Figure 7.7: four cards slide down a plane", (15.5, 5.2), note)
    way, speed, force = figure.subplots(1, 3)
    pictures.tidy(way, "displacement [m]", "time [s]")
    pictures.tidy(speed, "velocity [m/s]", "time [s]")
    pictures.tidy(force, "friction [mN]", "time [s]")
    exact_style = {"color": pictures.INK, "linewidth": 1.0, "linestyle": (0, (2, 3)), "zorder": 5}
    for law in LAWS:
        # C and CS lie on each other.
        style = {"color": COLOURS[law], "linewidth": 5.5 if law == "C" else 2.2, "alpha": 0.5 if law == "C" else 1.0}
        exact = measured.exact[law]
        way.plot(run.times, run.way[law], label=law, **style)
        speed.plot(run.times, run.speed[law], **style)
        at, found, expected = measured.force(law)
        force.plot(at, 1e3 * found, **style)
        way.plot(run.times, exact.way, **exact_style)
        speed.plot(run.times, exact.speed, **exact_style)
        force.plot(at, 1e3 * expected, **exact_style)
    way.legend(frameon=False, fontsize=10, loc="upper left")
    words = [f"{law:<5}{100.0 * measured.off(law, min(measured.runs)):+.2f} %" for law in LAWS]
    pictures.caption(way, "off after 2 s\n" + "\n".join(words), (0.97, 0.05))
    force.set_ylim(bottom=0.0)
    return pictures.png(figure)
