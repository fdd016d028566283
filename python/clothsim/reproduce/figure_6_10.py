"""Figure 6.10: broad-phase tests of a uniform grid, virtual subdivision, and the octree grid in one and two stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import (
    GRID,
    METHODS,
    OCTREE,
    SINGLE,
    VIRTUAL,
    Counted,
    agreement,
    bars,
    chosen,
    count,
    foot,
    left_out,
    million,
    scenes,
)

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "the octree grid takes at least 39 % fewer broad-phase tests than virtual subdivision, 64 % fewer in the reef "
    "knot, and up to 36 %, on average 20 %, fewer in two stages than in one"
)
LEAST = 39.0  # per cent fewer tests than virtual subdivision
SHOWN = (GRID, VIRTUAL, SINGLE, OCTREE)


@dataclass(frozen=True)
class Measured:
    """Counts by benchmark and method."""

    suite: Suite
    counts: dict[tuple[str, str], Counted]

    def fewer(self, name: str, than: str, method: str = OCTREE) -> float:
        """How many fewer tests than another method [%]."""
        return 100.0 * (1.0 - self.counts[name, method].tests / self.counts[name, than].tests)


def measure(effort: Effort) -> Measured:
    """Detect in each step of each benchmark, with each method."""
    found = suite(effort, quick=("Funnel (generated)", "Bowline (generated)"))
    with effort.bar(len(SHOWN) * sum(len(b.steps) for b in found.benchmarks), "figure 6.10", "call") as bar:
        counts = {
            (b.name, method): count(b, method, effort, done=bar.update) for b in found.benchmarks for method in SHOWN
        }
    return Measured(found, counts)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was measured, on what."""
    return {
        **chosen(measured.suite), "mode": "continuous", "lambda": 1.2,
        "levels of the octree": "nine in the first step of a benchmark, then as the four thresholds of 6.3.2 say",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per benchmark and method."""
    columns = (
        "benchmark", "method", "broad-phase tests", "fewer than virtual subdivision [%]", "tests per triangle",
        "registrations", "memory on the device [MB]", "contacts",
    )  # fmt: skip
    rows = [
        (b.name, method, c.tests, measured.fewer(b.name, VIRTUAL, method), c.tests / len(b.triangles), c.registrations,
         c.bytes / 1e6, c.contacts)
        for b in measured.suite.benchmarks
        for method in SHOWN
        for c in [measured.counts[b.name, method]]
    ]  # fmt: skip
    return {"": Table(columns, rows)}


def here(measured: Measured) -> str:
    """How many fewer tests, per benchmark."""
    names = [b.name for b in measured.suite.benchmarks]
    words = [
        f"{name} {measured.fewer(name, VIRTUAL):.0f} % ({million(measured.counts[name, VIRTUAL].tests)} to "
        f"{million(measured.counts[name, OCTREE].tests)})"
        for name in names
    ]
    stages = [measured.fewer(name, SINGLE) for name in names]
    text = (
        f"fewer tests than virtual subdivision: {', '.join(words)}; two stages save up to {max(stages):.1f} %, on "
        f"average {np.mean(stages):.1f} %, over one"
    )
    return left_out(measured.suite, text)


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's share; two stages never cost more than one; the contacts are those of the CPU."""
    source = "thesis 6.4.2, figure 6.10"
    names = [b.name for b in measured.suite.benchmarks]
    # Small meshes have few levels to adapt.
    least = 0.0 if measured.suite.is_quick else LEAST
    few = all(measured.fewer(name, VIRTUAL) >= least for name in names)
    more = max(-measured.fewer(name, SINGLE) for name in names)
    return [
        Check.true(f"at least {least:g} % fewer tests than virtual subdivision, each benchmark", few, source),
        Check.true("two stages never take more tests than one", more <= 0.0, "thesis 6.3.1: an optimum over all trees"),
        *agreement(list(measured.counts.values())),
    ]


def draw(measured: Measured) -> bytes:
    """Tests of all methods, and how many fewer the octree takes."""
    note = foot(
        measured.suite,
        "Continuous detection, means over the steps. Tests are pairs of triangles in one cell, duplicates included. "
        "Dashes: at least so many in the thesis.",
    )
    figure = pictures.figure("Figure 6.10: the octree grid against uniform grids", (14.0, 5.8), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "broad-phase tests")
    pictures.tidy(right, "fewer tests with the octree in two stages [%]")
    bars(left, measured.suite, measured.counts, SHOWN)
    for number, than in enumerate((VIRTUAL, SINGLE)):
        for k, b in enumerate(measured.suite.benchmarks):
            place, value = k + 0.4 * (number - 0.5), measured.fewer(b.name, than)
            right.bar(place, value, 0.38, color=METHODS[than], label=f"than {than}" if k == 0 else None)
            right.text(place, value, f"{value:.0f}", ha="center", va="bottom", fontsize=9.0)
    right.axhline(LEAST, color=pictures.INK, linestyle=(0, (3, 1.2)), linewidth=1.4)
    right.set_ylim(0.0, 100.0)
    right.legend(frameon=False, fontsize=9.5, loc="upper right", ncols=2)
    scenes(right, [b.name for b in measured.suite.benchmarks])
    return pictures.png(figure)
