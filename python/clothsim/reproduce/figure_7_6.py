"""Figure 7.6: four cards on an inclined plane, one friction law each; which of them slide at which μ_c."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from clothsim.reproduce import cards, pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, LAWS, TABLE_7_1, Coefficients

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "μ_s = 2 μ_c: above μ_c = 0.3 no card slides, between 0.15 and 0.3 only that of C, below 0.15 all four; at "
    "μ_c = 0.1 C and CS slide together, CSS slower, CSSV slowest"
)

SHOWN = TABLE_7_1["card"]
MU_C = (0.1, 0.14, 0.16, 0.2, 0.25, 0.29, 0.31, 0.4)
DURATION, FRAMES = 2.0, 200
MOMENTS = (0.0, 0.8, 1.4, 2.0)
TRIAL = 1.0  # s, of each μ_c
SLIDES = 1e-3  # m in a trial: the slowest that should slide, C at 0.29, goes 47 mm; a card at rest below 1e-6 m


@dataclass(frozen=True)
class Measured:
    """The cards that are drawn, and the ways of all trials by law and μ_c [m]."""

    setup: cards.Cards
    run: cards.Run
    ways: dict[tuple[str, float], float]

    def slides(self, law: str, mu_c: float) -> bool:
        """Whether a card slid in its trial."""
        return self.ways[law, mu_c] > SLIDES


def measure(effort: Effort) -> Measured:
    """Let four cards go at each μ_c."""
    setup = cards.Cards()
    if effort.quick:
        setup = replace(setup, cells=(3, 4), dt=4e-3)
    with effort.bar(FRAMES + len(MU_C), "figure 7.6", "frame") as bar:
        run = cards.run(setup, SHOWN, DURATION, FRAMES, moments=MOMENTS, tick=bar.update)
        trials = effort.each(lambda mu_c: cards.run(setup, _pair(mu_c), TRIAL, 1, tick=bar.update), MU_C, bar)
    ways = {(law, mu_c): float(t.way[law][-1]) for mu_c, t in zip(MU_C, trials, strict=True) for law in LAWS}
    return Measured(setup, run, ways)


def _pair(mu_c: float) -> Coefficients:
    return replace(SHOWN, mu_c=mu_c, mu_s=2.0 * mu_c)


def _expected(law: str, mu_c: float, slope: float) -> bool:
    """Whether a card slides: its static coefficient is below tan α."""
    return _pair(mu_c).static(law) < slope


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    return {
        **SHOWN.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "F_v of the scene [N/m2 per m/s]": SHOWN.per_area(measured.setup.areal_density),
        "slope": "tan alpha = 0.3: between the thesis's thresholds 0.15 and 0.3 with mu_s = 2 mu_c",
        "trial [s]": TRIAL, "slides [m]": f"more than {SLIDES:g} in a trial",
        "chosen": "all but the coefficients: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """Whether each card slides at each μ_c, and how far; displacements of the drawn cards."""
    columns = ("law", "mu_c", "mu_s", "displacement after 1 s [m]", "exact [m]", "slides", "expected to slide")
    rows = []
    for (law, mu_c), way in measured.ways.items():
        exact = float(measured.setup.exact(_pair(mu_c), law, measured.run.times[: FRAMES // 2 + 1]).way[-1])
        slides, expected = measured.slides(law, mu_c), _expected(law, mu_c, measured.setup.slope)
        rows.append((law, mu_c, 2.0 * mu_c, way, exact, int(slides), int(expected)))
    run = measured.run
    motion = [(law, float(t), float(s)) for law in LAWS for t, s in zip(run.times, run.way[law], strict=True)]
    return {"": Table(columns, rows), "motion": Table(("law", "time [s]", "displacement [m]"), motion)}


def here(measured: Measured) -> str:
    """Which cards slide, and how far those of the picture go."""
    words = []
    for mu_c in MU_C:
        sliding = [law for law in LAWS if measured.slides(law, mu_c)]
        words.append(f"{mu_c:g} {'all' if len(sliding) == len(LAWS) else ', '.join(sliding) or 'none'}")
    ways = ", ".join(f"{law} {measured.run.way[law][-1]:.2f}" for law in LAWS)
    return f"at tan α = 0.3 slide, by μ_c: {'; '.join(words)}; at μ_c = 0.1 within {DURATION:g} s {ways} m"


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's thresholds and order; what stays, stays."""
    source = "thesis 7.5, figure 7.6"
    way = {law: float(measured.run.way[law][-1]) for law in LAWS}
    held = [measured.ways[key] for key in measured.ways if not _expected(*key, measured.setup.slope)]
    return [
        *(
            Check(f"cards that slide at μ_c = {mu_c:g}: {' '.join(expected) or 'none'}",
                  float(sum((law in expected) == measured.slides(law, mu_c) for law in LAWS)), 4.0, 0.0, source)
            for mu_c in MU_C
            for expected in [[law for law in LAWS if _expected(law, mu_c, measured.setup.slope)]]
        ),
        Check("CS against C: displacement, relative", way["CS"] / way["C"], 1.0, 0.01, f"{source}: the same velocity"),
        Check.true("CSS slides slower than C, CSSV slowest", way["C"] > way["CSS"] > way["CSSV"], source),
        Check("largest displacement of a card that stiction holds [m]", max(held), 0.0, 1e-6, "at rest"),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """The cards at four moments, and which slide at which μ_c."""
    setup, run = measured.setup, measured.run
    note = (
        f"Cards of {100 * setup.width:.0f} cm × {100 * setup.length:.0f} cm; tan α = 0.3. Left to right C (green), CS "
        "(red), CSS (blue), CSSV (yellow). Size and weight are chosen; coefficients as in the thesis."
    )
    figure = pictures.figure("Figure 7.6: four cards on an inclined plane", (16.0, 7.6), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.75, 1.0])
    images = pictures.tiles(run.bodies, run.states, run.standing, size=(560, 560))
    for axis, image, moment in zip(upper.subplots(1, len(MOMENTS)), images, MOMENTS, strict=True):
        pictures.show(axis, image, f"{moment:g} s")
    axis = lower.subplots()
    pictures.tidy(axis, "displacement after 1 s, by $μ_c$ ($μ_s = 2 μ_c$); a ring: does not slide", "$μ_c$")
    for row, law in enumerate(LAWS):
        for column, mu_c in enumerate(MU_C):
            slides = measured.slides(law, mu_c)
            axis.scatter(column, -row, s=190, facecolor=COLOURS[law] if slides else "white", edgecolor=COLOURS[law],
                         linewidth=1.8, zorder=3)  # fmt: skip
            if slides:
                text = f"{100 * measured.ways[law, mu_c]:.0f} cm"
                axis.annotate(text, (column, -row), xytext=(12, 0), textcoords="offset points", va="center", fontsize=9)
    axis.set_yticks([-row for row in range(len(LAWS))], LAWS)
    axis.set_xticks(range(len(MU_C)), [f"{mu_c:g}" for mu_c in MU_C])
    axis.set_ylim(-3.6, 0.6)
    axis.set_xlim(-0.4, len(MU_C) - 0.4)
    for edge, words in ((1.5, "tan α / 2"), (5.5, "tan α")):
        axis.axvline(edge, color=pictures.FAINT, linewidth=1.2, linestyle=(0, (4, 3)))
        axis.annotate(words, (edge, 0.6), xytext=(4, -3), textcoords="offset points", fontsize=9, va="top",
                      color=pictures.FAINT)  # fmt: skip
    return pictures.png(figure)
