"""Table 7.2: running time of collision response under each friction law, in figure 7.3's scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.reproduce import figure_7_3, pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, LAWS
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "collision response in 5 s of the scene of figure 7.3 (8.1K triangles, Δt = 1 ms) takes 0.71 s without friction, "
    "0.86 s with C (17 % of it friction), 0.90 s CS (21 %), 1.16 s CSS (39 %), 1.19 s CSSV (40 %)"
)
NONE = "no friction"
VARIANTS = (NONE, *LAWS)
PRINTED = {NONE: (0.71, float("nan")), "C": (0.86, 17.0), "CS": (0.90, 21.0), "CSS": (1.16, 39.0), "CSSV": (1.19, 40.0)}

# The table's column of Table 7.1 has no F_v: that of the other columns.
COEFFICIENTS = replace(figure_7_3.COEFFICIENTS, f_v=6e-5)
DETECTION = ("proximity", "detection")  # stages of contact that find what touches; the others respond
DT, SECONDS = 1e-3, 5.0
STATES = (0.5, 0.8, 1.1, 1.4, 1.7)  # s, of a run with CSS, from which every variant goes on
STEPS, QUICK_STEPS = 12, 4
WARM = 2  # steps that are not counted: the first has no contact force to expect
ROUNDS, QUICK_ROUNDS = 7, 2


@dataclass(frozen=True)
class Measured:
    """Milliseconds per step, (rounds, states · steps) by variant: response and detection; what touches."""

    setup: figure_7_3.Setup
    threads: int
    response: dict[str, Floats]
    detection: dict[str, Floats]
    step: dict[str, Floats]
    impulses: dict[str, float]
    sweeps: dict[str, float]
    stages: dict[str, dict[str, float]]

    # The rounds repeat the same steps to the bit: a step's times in them differ by what else the machine did.

    def median(self, variant: str) -> float:
        """Response per step, median of the rounds of each step, mean of the steps [ms]."""
        return float(np.median(self.response[variant], axis=0).mean())

    def least(self, variant: str) -> float:
        """The same with the least of the rounds [ms]."""
        return float(self.response[variant].min(axis=0).mean())

    def rounds(self, variant: str) -> Floats:
        """Response per step in each round [ms]."""
        return np.asarray(self.response[variant].mean(axis=1), dtype=np.float64)

    def share(self, variant: str) -> float:
        """Share of friction in the response as the thesis counts it, (t − t0)/t [%]."""
        return 100.0 * (1.0 - self.median(NONE) / self.median(variant))


def measure(effort: Effort) -> Measured:
    """Step every variant from the same states, in turn."""
    setup = replace(figure_7_3.Setup(), dt=2e-3)
    rounds, steps = ROUNDS, STEPS
    if effort.quick:
        setup = replace(setup, cells=20, dt=4e-3)
        rounds, steps = QUICK_ROUNDS, QUICK_STEPS
    total = len(STATES) * (1 + rounds * len(VARIANTS))
    with effort.bar(total, "table 7.2", "batch") as bar:
        states = _states(setup, effort, bar)
        timed = replace(setup, dt=DT)
        reports: dict[str, list[list[dict[str, Any]]]] = {variant: [] for variant in VARIANTS}
        for turn in range(rounds):
            gathered: dict[str, list[dict[str, Any]]] = {variant: [] for variant in VARIANTS}
            for number, state in enumerate(states):
                shift = (turn + number) % len(VARIANTS)
                for variant in (*VARIANTS[shift:], *VARIANTS[:shift]):
                    simulation = _from(timed, variant, *state, effort.threads)
                    gathered[variant] += [simulation.step() for _ in range(WARM + steps)][WARM:]
                    bar.update()
            for variant in VARIANTS:
                reports[variant].append(gathered[variant])
    response, detection, step, stages = {}, {}, {}, {}
    for variant, lists in reports.items():
        seconds = [[dict(r["seconds"]) for r in line] for line in lists]
        names = _contact_stages(seconds)
        response[variant] = _milliseconds(seconds, [n for n in names if n not in DETECTION])
        detection[variant] = _milliseconds(seconds, DETECTION)
        step[variant] = np.array([[1e3 * sum(s.values()) for s in line] for line in seconds])
        stages[variant] = {n: float(_milliseconds(seconds, [n]).mean()) for n in names}
    impulses = {
        variant: float(np.mean([r["contact"]["impulses"] for line in lists for r in line]))
        for variant, lists in reports.items()
    }
    sweeps = {
        variant: float(np.mean([r["contact"]["sweeps"] for line in lists for r in line]))
        for variant, lists in reports.items()
    }
    return Measured(timed, effort.threads, response, detection, step, impulses, sweeps, stages)


# The stages of a step that are not contact's.
_DYNAMICS = {
    "colliders", "pins", "bending sub-steps", "forces", "linearise", "assemble", "line search", "solve", "guard",
    "intersection count",
}  # fmt: skip


def _contact_stages(seconds: list[list[dict[str, float]]]) -> list[str]:
    names = dict.fromkeys(name for line in seconds for s in line for name in s)
    return [name for name in names if name not in _DYNAMICS]


def _milliseconds(seconds: list[list[dict[str, float]]], names: Sequence[str]) -> Floats:
    return np.array([[1e3 * sum(s.get(name, 0.0) for name in names) for s in line] for line in seconds])


def _states(setup: figure_7_3.Setup, effort: Effort, bar: Any) -> list[tuple[Floats, Floats]]:
    mesh = figure_7_3.sheet(setup)
    simulation = Simulation(figure_7_3.scene(setup, mesh, *_laws("CSS", setup)), threads=effort.threads)
    states = []
    for moment in STATES:
        simulation.advance(moment - simulation.time)
        states.append((simulation.positions, simulation.velocities))
        bar.update()
    return states


def _laws(variant: str, setup: figure_7_3.Setup) -> tuple[Any, Any]:
    if variant == NONE:
        return 0.0, 0.0
    density = setup.areal_density
    return COEFFICIENTS.friction(variant, density), COEFFICIENTS.self_friction(variant, density)


def _from(setup: figure_7_3.Setup, variant: str, x: Floats, v: Floats, threads: int) -> Simulation:
    sheet = figure_7_3.sheet(setup)
    scene = figure_7_3.scene(setup, Mesh(x, sheet.triangles, sheet.uv), *_laws(variant, setup), velocities=v)
    return Simulation(scene, threads=threads)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was timed, on what."""
    from clothsim._cli.doctor import findings

    machine = findings()
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "triangles": 2 * measured.setup.cells**2, "threads": measured.threads,
        "processor": machine["processor"]["model"],
        "timed": f"steps of {1e3 * DT:g} ms from the states of a run with CSS at {', '.join(map(str, STATES))} s: "
        "all variants meet the same contacts",
        "response": f"all stages of contact but {' and '.join(DETECTION)}",
        "rounds": f"{len(next(iter(measured.response.values())))} rounds, the variants take turns",
        "F_v": "of the other columns of Table 7.1, which has none for this scene",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per variant beside the thesis, and the stages."""
    columns = (
        "model", "response per step, medians [ms]", "least times [ms]", "shortest round [ms]", "longest round [ms]",
        "over 5 s [s]", "friction's share [%]", "over C [%]", "over C, least times [%]", "contacts with an impulse",
        "sweeps per step", "detection per step [ms]", "step [ms]",
        "thesis, 5 s [s]", "thesis, share [%]",
    )  # fmt: skip
    rows = []
    for variant in VARIANTS:
        each, median, least = measured.rounds(variant), measured.median(variant), measured.least(variant)
        rows.append((
            variant, median, least, float(each.min()), float(each.max()), median * SECONDS / DT * 1e-3,
            measured.share(variant), 100.0 * (median / measured.median("C") - 1.0),
            100.0 * (least / measured.least("C") - 1.0), measured.impulses[variant], measured.sweeps[variant],
            float(np.median(measured.detection[variant], axis=0).mean()),
            float(np.median(measured.step[variant], axis=0).mean()), *PRINTED[variant],
        ))  # fmt: skip
    names = dict.fromkeys(name for stages in measured.stages.values() for name in stages)
    parts = [(variant, name, measured.stages[variant].get(name, 0.0)) for variant in VARIANTS for name in names]
    return {"": Table(columns, rows), "stages": Table(("model", "stage", "mean per step [ms]"), parts)}


def here(measured: Measured) -> str:
    """Seconds over 5 s, friction's share, and what CSSV adds to C."""
    scale = SECONDS / DT * 1e-3
    words = []
    for variant in VARIANTS:
        time = scale * measured.median(variant)
        words.append(f"{variant} {time:.2f} s" + ("" if variant == NONE else f" ({measured.share(variant):.0f} %)"))
    over = [100.0 * (of("CSSV") / of("C") - 1.0) for of in (measured.median, measured.least)]
    response, step = (np.median(times["CSSV"], axis=0).mean() for times in (measured.response, measured.step))
    return (
        f"{2 * measured.setup.cells**2:,} triangles: {', '.join(words)} on {measured.threads} CPU "
        f"thread{'s' if measured.threads > 1 else ''}; CSSV takes {over[0]:+.0f} % over C (least times {over[1]:+.0f} "
        f"%; the thesis: +38 %); response is {100.0 * response / step:.0f} % of a step (the thesis: under 8 %)"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """Only what does not depend on the machine: every variant met contacts."""
    least = min(measured.impulses.values())
    return [Check.true("every variant had contacts to respond to", least > 10.0, "the same states")]


def draw(measured: Measured) -> bytes:
    """Bars of seconds and of friction's share, beside the thesis's."""
    note = (
        "Bars: medians of the rounds; lines: their range; dots: least times; dashes: the thesis, in 2014. "
        f"Here {measured.threads} CPU thread{'s' if measured.threads > 1 else ''}, {2 * measured.setup.cells**2:,} "
        "triangles; all variants step from the same states."
    )
    figure = pictures.figure("Table 7.2: running time of collision response", (11.5, 5.2), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "collision response in 5 s [s]")
    pictures.tidy(right, "share of friction in it [%]")
    scale = SECONDS / DT * 1e-3
    for number, variant in enumerate(VARIANTS):
        colour = COLOURS.get(variant, pictures.FAINT)
        each, middle = scale * measured.rounds(variant), scale * measured.median(variant)
        left.bar(number, middle, 0.62, color=colour)
        left.vlines(number, each.min(), each.max(), color=pictures.INK, linewidth=1.4)
        left.plot(
            number, scale * measured.least(variant), "o", color=pictures.INK, markerfacecolor="white", markersize=5
        )
        right.bar(number, measured.share(variant), 0.62, color=colour)
        for axis, printed in zip((left, right), PRINTED[variant], strict=True):
            ends = number - 0.31, number + 0.31
            axis.hlines(printed, *ends, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8)
    for axis in (left, right):
        axis.set_xticks(range(len(VARIANTS)), VARIANTS)
    left.plot([], [], color=pictures.INK, linestyle=(0, (3, 1.2)), linewidth=1.8, label="the thesis")
    left.legend(frameon=False, fontsize=9.5, loc="upper left")
    return pictures.png(figure)
