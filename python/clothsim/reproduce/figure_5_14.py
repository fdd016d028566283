"""Figure 5.14: broad-phase tests of virtual subdivision against those of a traditional uniform grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import COLOURS
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import (
    GRID,
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
)  # fmt: skip

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "virtual subdivision takes about an order of magnitude fewer broad-phase tests than a traditional uniform grid in "
    "several benchmarks, about 12 times fewer in N-body (from over 100 million to under 10 million pairs)"
)
TIMES_N_BODY = 8.0  # that many times fewer tests at least


def measure(effort: Effort) -> Compared:
    """Detect both ways."""
    return compare(effort, (GRID, VIRTUAL), "figure 5.14")


def _times(measured: Compared, name: str) -> float:
    return measured.times(name, GRID, VIRTUAL)


def parameters(measured: Compared) -> Mapping[str, Any]:
    """What was measured, on what."""
    return {
        **chosen(measured.suite), "mode": "continuous", "lambda": 1.2,
        "cell of the uniform grid": "1.5 times the largest triangle's bounding sphere, its motion included",
    }  # fmt: skip


def tables(measured: Compared) -> Mapping[str, Table]:
    """One row per benchmark and method."""
    return measured.table("grid over virtual subdivision", lambda name, _: _times(measured, name))


def here(measured: Compared) -> str:
    """How many times fewer tests, per benchmark."""
    words = [
        f"{b.name} {_times(measured, b.name):.3g} ({million(measured.counts[b.name, GRID].tests)} to "
        f"{million(measured.counts[b.name, VIRTUAL].tests)})"
        for b in measured.suite.benchmarks
    ]
    return left_out(measured.suite, f"times fewer tests with virtual subdivision: {', '.join(words)}")


def checks(measured: Compared) -> Sequence[Check]:
    """The thesis's orders of magnitude; the contacts are those of the CPU."""
    source = "thesis 5.4.3, figure 5.14"
    several = sum(_times(measured, b.name) >= TIMES_N_BODY for b in measured.suite.benchmarks)
    found = []
    if measured.suite.named("N-body") is not None:
        few = _times(measured, "N-body") >= TIMES_N_BODY
        found.append(Check.true(f"N-body: at least {TIMES_N_BODY:g} times fewer tests", few, source))
    if not measured.suite.left_out:
        found.append(Check.true("about an order of magnitude fewer in several benchmarks", several >= 2, source))
    fewer = all(_times(measured, b.name) > 1.0 for b in measured.suite.benchmarks if b.name not in _EVEN)
    found.append(Check.true("fewer tests wherever triangles differ much in size", fewer, source))
    return [*found, *agreement(list(measured.counts.values()))]


_EVEN = ("Reef knot (generated)", "Bowline (generated)")  # their cells are alike but for folds: little to subdivide


def draw(measured: Compared) -> bytes:
    """Tests of both methods, and their ratio."""
    note = foot(
        measured.suite,
        "Continuous detection, means over the steps. Tests are pairs of triangles in one cell, duplicates included. "
        "Dashes: the thesis's factor for N-body, whose average frame has fewer pairs.",
    )
    figure = pictures.figure("Figure 5.14: virtual subdivision against a uniform grid", (13.0, 5.6), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "broad-phase tests")
    pictures.tidy(right, "uniform grid over virtual subdivision")
    bars(left, measured.suite, measured.counts, (GRID, VIRTUAL))
    for k, b in enumerate(measured.suite.benchmarks):
        right.bar(k, _times(measured, b.name), 0.62, color=COLOURS[b.name])
        right.text(
            k, _times(measured, b.name), f"{_times(measured, b.name):.3g}", ha="center", va="bottom", fontsize=9.5
        )
        if b.name == "N-body":
            right.hlines(12.0, k - 0.31, k + 0.31, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8)
    scenes(right, [b.name for b in measured.suite.benchmarks])
    return pictures.png(figure)
