"""Figure 5.12: broad-phase tests of virtual subdivision against λ, which sets the size of the cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import COLOURS, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import VIRTUAL, Counted, agreement, chosen, count, foot, left_out, logarithmic, million

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "cloth on ball: the number of broad-phase tests is least near λ = 1.2 and grows where λ is smaller or larger; the "
    "other benchmarks are similar"
)
SHOWN = "Cloth on ball"
CHOSEN = 1.2
FACTORS = (0.8, 1.0, 1.1, CHOSEN, 1.3, 1.5, 2.0)
QUICK = (0.8, CHOSEN, 2.0)


@dataclass(frozen=True)
class Measured:
    """Counts by benchmark and λ."""

    suite: Suite
    factors: tuple[float, ...]
    counts: dict[tuple[str, float], Counted]

    @property
    def shown(self) -> str:
        """The thesis's benchmark, or the first there is."""
        return (self.suite.named(SHOWN) or self.suite.benchmarks[0]).name

    def fewest(self, name: str) -> float:
        """The λ with the fewest tests."""
        return min(self.factors, key=lambda factor: self.counts[name, factor].tests)


def measure(effort: Effort) -> Measured:
    """Detect with each λ on each benchmark, one step."""
    found, factors = suite(effort, steps=1), QUICK if effort.quick else FACTORS
    counts = {}
    with effort.bar(len(found.benchmarks) * len(factors), "figure 5.12", "call") as bar:
        for benchmark in found.benchmarks:
            for factor in factors:
                counts[benchmark.name, factor] = count(
                    benchmark, VIRTUAL, effort, cell_factor=factor, done=bar.update
                )  # fmt: skip
    return Measured(found, factors, counts)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was measured, on what."""
    return {
        **chosen(measured.suite), "mode": "continuous", "cell size": "3 λ average radius (Eq. 5.1)",
        "lambda": ", ".join(f"{factor:g}" for factor in measured.factors),
        "triangles in one cell": "one registration of a triangle in a cell, however many of its parts lie there",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per benchmark and λ."""
    columns = (
        "benchmark", "lambda", "broad-phase tests", "over those at 1.2", "registrations", "parts of triangles",
        "memory on the device [MB]", "contacts",
    )  # fmt: skip
    rows = [
        (name, factor, c.tests, c.tests / measured.counts[name, CHOSEN].tests, c.registrations, c.parts, c.bytes / 1e6,
         c.contacts)
        for (name, factor), c in measured.counts.items()
    ]  # fmt: skip
    return {"": Table(columns, rows)}


def here(measured: Measured) -> str:
    """Tests of the thesis's benchmark at the ends and at 1.2, and where each has its fewest."""
    name, ends = measured.shown, (measured.factors[0], CHOSEN, measured.factors[-1])
    each = ", ".join(f"{million(measured.counts[name, f].tests)} at λ = {f:g}" for f in ends)
    words = [f"{b.name} {measured.fewest(b.name):g}" for b in measured.suite.benchmarks if b.name != name]
    low, high = (measured.counts[name, f].registrations for f in (measured.factors[0], CHOSEN))
    text = (
        f"{name}: {each}, fewest at {measured.fewest(name):g}; the others' fewest are at {', '.join(words)}. Smaller "
        f"cells mean more registrations instead ({low / high:.1f} times as many at {measured.factors[0]:g})"
    )
    return left_out(measured.suite, text)


def checks(measured: Measured) -> Sequence[Check]:
    """More tests with larger cells; the contacts do not depend on λ."""
    more = [
        measured.counts[b.name, measured.factors[-1]].tests > measured.counts[b.name, CHOSEN].tests
        for b in measured.suite.benchmarks
    ]
    reason = "thesis 5.4.2, figure 5.12"
    registered = [
        measured.counts[b.name, measured.factors[0]].registrations > measured.counts[b.name, CHOSEN].registrations
        for b in measured.suite.benchmarks
    ]
    return [
        Check.true(f"more tests at λ = {measured.factors[-1]:g} than at 1.2, each benchmark", all(more), reason),
        Check.true(
            f"more registrations at λ = {measured.factors[0]:g} than at 1.2, each benchmark", all(registered),
            "smaller cells: more of them are overlapped",
        ),
        *agreement(list(measured.counts.values())),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """Tests and registrations of all benchmarks over λ."""
    note = foot(
        measured.suite,
        "Continuous detection. λ = 1.2, where the thesis has its minimum, is marked. A triangle that is subdivided "
        "counts once in a cell, so that smaller cells cost registrations, not tests.",
    )
    figure = pictures.figure("Figure 5.12: broad-phase tests against λ", (13.0, 5.4), note)
    tests, registrations, memory = figure.subplots(1, 3)
    pictures.tidy(tests, "broad-phase tests, over those at λ = 1.2", "λ")
    pictures.tidy(registrations, "registrations per triangle", "λ")
    pictures.tidy(memory, "memory on the device [MB]", "λ")
    for axis in (tests, registrations, memory):
        axis.axvline(CHOSEN, color=pictures.GRID, linewidth=5.0, zorder=0)
        axis.set_xticks([f for f in measured.factors if f not in (1.1, 1.3)])
    for b in measured.suite.benchmarks:
        each = [measured.counts[b.name, factor] for factor in measured.factors]
        style = {
            "color": COLOURS[b.name], "linewidth": 2.6 if b.name == measured.shown else 1.4, "marker": "o",
            "markersize": 4.5 if b.name == measured.shown else 3.0, "label": b.name,
        }  # fmt: skip
        tests.plot(measured.factors, [c.tests / measured.counts[b.name, CHOSEN].tests for c in each], **style)
        registrations.plot(measured.factors, [c.registrations / len(b.triangles) for c in each], **style)
        memory.plot(measured.factors, [c.bytes / 1e6 for c in each], **style)
    for axis in (registrations, memory):
        logarithmic(axis)
    tests.set_ylim(0.0)
    tests.legend(frameon=False, fontsize=9.0, loc="upper left")
    return pictures.png(figure)
