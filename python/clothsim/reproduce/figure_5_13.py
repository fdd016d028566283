"""Figure 5.13: how many child triangles virtual subdivision makes, and their share of all triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import COLOURS, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import VIRTUAL, Counted, agreement, chosen, count, foot, left_out, scenes

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "the ratio between newly created child triangles and all triangles is from 9 % to 35 %, over all benchmarks"
PRINTED = (9.0, 35.0)


@dataclass(frozen=True)
class Measured:
    """Counts by benchmark."""

    suite: Suite
    counts: dict[str, Counted]

    def children(self, name: str) -> float:
        """Parts beyond one per triangle."""
        benchmark = self.suite.named(name)
        assert benchmark is not None
        return self.counts[name].parts - len(benchmark.triangles)

    def share(self, name: str) -> float:
        """Share of those in all parts [%]."""
        return 100.0 * self.children(name) / self.counts[name].parts


def measure(effort: Effort) -> Measured:
    """Detect in each step of each benchmark."""
    found = suite(effort)
    with effort.bar(sum(len(b.steps) for b in found.benchmarks), "figure 5.13", "call") as bar:
        counts = {b.name: count(b, VIRTUAL, effort, done=bar.update) for b in found.benchmarks}
    return Measured(found, counts)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was measured, on what."""
    return {
        **chosen(measured.suite), "mode": "continuous", "lambda": 1.2,
        "children": "parts beyond one per triangle: a triangle is cut into 4^l parts and its step into 2^m, until a "
        "part's sphere is at most a third of a cell",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per benchmark."""
    columns = (
        "benchmark", "triangles", "parts", "children", "children in all parts [%]", "children per triangle [%]",
        "registrations", "memory on the device [MB]",
    )  # fmt: skip
    rows = [
        (b.name, len(b.triangles), c.parts, measured.children(b.name), measured.share(b.name),
         100.0 * measured.children(b.name) / len(b.triangles), c.registrations, c.bytes / 1e6)
        for b in measured.suite.benchmarks
        for c in [measured.counts[b.name]]
    ]  # fmt: skip
    return {"": Table(columns, rows)}


def here(measured: Measured) -> str:
    """The shares."""
    each = [
        f"{b.name} {measured.children(b.name) / 1000:,.0f} thousand, {measured.share(b.name):.0f} %"
        for b in measured.suite.benchmarks
    ]
    text = f"children and their share in all parts: {'; '.join(each)}"
    return left_out(measured.suite, text)


def checks(measured: Measured) -> Sequence[Check]:
    """There are children wherever triangles differ in size; the contacts are those of the CPU."""
    some = any(measured.children(b.name) > 0 for b in measured.suite.benchmarks)
    none_lost = all(measured.children(b.name) >= 0 for b in measured.suite.benchmarks)
    return [
        Check.true("triangles are subdivided", some, "thesis 5.3.2: sizes vary in the benchmarks"),
        Check.true("every triangle has at least one part", none_lost, "none is lost"),
        *agreement(list(measured.counts.values())),
    ]


def draw(measured: Measured) -> bytes:
    """Bars of children and of their share."""
    note = foot(
        measured.suite,
        "Continuous detection, λ = 1.2, means over the steps. Shaded: the thesis's range. Children are parts beyond "
        "one per triangle, those of a halved step included.",
    )
    figure = pictures.figure("Figure 5.13: child triangles of virtual subdivision", (13.0, 5.4), note)
    left, right = figure.subplots(1, 2)
    names = [b.name for b in measured.suite.benchmarks]
    pictures.tidy(left, "triangles (grey) and child triangles (coloured), thousands")
    pictures.tidy(right, "children in all parts [%]")
    right.axhspan(*PRINTED, color=pictures.GRID, zorder=0)
    for k, b in enumerate(measured.suite.benchmarks):
        left.bar(k - 0.2, len(b.triangles) / 1000, 0.38, color="#c9c5be")
        left.bar(k + 0.2, measured.children(b.name) / 1000, 0.38, color=COLOURS[b.name])
        right.bar(k, measured.share(b.name), 0.62, color=COLOURS[b.name])
        right.text(k, measured.share(b.name), f"{measured.share(b.name):.0f}", ha="center", va="bottom", fontsize=9.5)
    for axis in (left, right):
        scenes(axis, names)
    return pictures.png(figure)
