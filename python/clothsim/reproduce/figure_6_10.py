"""Figure 6.10: broad-phase tests of a uniform grid, virtual subdivision, and the octree grid in one and two stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import (
    GRID,
    METHODS,
    OCTREE,
    SINGLE,
    VIRTUAL,
    Compared,
    agreement,
    bars,
    chosen,
    compare,
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


def measure(effort: Effort) -> Compared:
    """Detect with each method."""
    return compare(effort, SHOWN, "figure 6.10", quick=("Funnel (generated)", "Bowline (generated)"))


def _fewer(measured: Compared, name: str, than: str, method: str = OCTREE) -> float:
    """How many fewer tests than another method [%]."""
    return 100.0 * (1.0 - measured.times(name, method, than))


def parameters(measured: Compared) -> Mapping[str, Any]:
    """What was measured, on what."""
    return {
        **chosen(measured.suite), "mode": "continuous", "lambda": 1.2,
        "levels of the octree": "nine in the first step of a benchmark, then as the four thresholds of 6.3.2 say",
    }  # fmt: skip


def tables(measured: Compared) -> Mapping[str, Table]:
    """One row per benchmark and method."""
    column = "fewer than virtual subdivision [%]"
    return measured.table(column, lambda name, method: _fewer(measured, name, VIRTUAL, method))


def here(measured: Compared) -> str:
    """How many fewer tests, per benchmark."""
    names = [b.name for b in measured.suite.benchmarks]
    words = [
        f"{name} {_fewer(measured, name, VIRTUAL):.0f} % ({million(measured.counts[name, VIRTUAL].tests)} to "
        f"{million(measured.counts[name, OCTREE].tests)})"
        for name in names
    ]
    stages = [_fewer(measured, name, SINGLE) for name in names]
    text = (
        f"fewer tests than virtual subdivision: {', '.join(words)}; two stages save up to {max(stages):.1f} %, on "
        f"average {np.mean(stages):.1f} %, over one"
    )
    return left_out(measured.suite, text)


def checks(measured: Compared) -> Sequence[Check]:
    """The thesis's share; two stages never cost more than one; the contacts are those of the CPU."""
    source = "thesis 6.4.2, figure 6.10"
    names = [b.name for b in measured.suite.benchmarks]
    # Small meshes have few levels to adapt.
    least = 0.0 if measured.suite.is_quick else LEAST
    few = all(_fewer(measured, name, VIRTUAL) >= least for name in names)
    more = max(-_fewer(measured, name, SINGLE) for name in names)
    return [
        Check.true(f"at least {least:g} % fewer tests than virtual subdivision, each benchmark", few, source),
        Check.true("two stages never take more tests than one", more <= 0.0, "thesis 6.3.1: an optimum over all trees"),
        *agreement(list(measured.counts.values())),
    ]


def draw(measured: Compared) -> bytes:
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
            place, value = k + 0.4 * (number - 0.5), _fewer(measured, b.name, than)
            right.bar(place, value, 0.38, color=METHODS[than], label=f"than {than}" if k == 0 else None)
            right.text(place, value, f"{value:.0f}", ha="center", va="bottom", fontsize=9.0)
    right.axhline(LEAST, color=pictures.INK, linestyle=(0, (3, 1.2)), linewidth=1.4)
    right.set_ylim(0.0, 100.0)
    right.legend(frameon=False, fontsize=9.5, loc="upper right", ncols=2)
    scenes(right, [b.name for b in measured.suite.benchmarks])
    return pictures.png(figure)
