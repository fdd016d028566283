"""Figure 5.16: times of virtual subdivision against those of a traditional uniform grid, on one device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import GRID, METHODS, VIRTUAL, bars, device_words, foot, left_out, plain, scenes
from clothsim.reproduce.timings import MODES, Times, times

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "virtual subdivision on a GTX 470 is faster than the uniform grid of Pabst et al. (2010) on one or two GPUs of "
    "GTX 295 cards in all benchmarks (5.9 times in N-body, 3.1 times in Cloth on ball), and than on four in all but "
    "Funnel (2.5 times in N-body, CCD)"
)
# How many times as fast, as far as the text says; the chart has no numbers. On other cards, so that none is a bound.
PRINTED = {"N-body": 5.9, "Cloth on ball": 3.1}
KNOTS = ("Reef knot (generated)", "Bowline (generated)")  # triangles of one size: nothing to subdivide


def measure(effort: Effort) -> Times:
    """Time both methods, both modes."""
    return times(effort, (GRID, VIRTUAL), "figure 5.16", quick=("Funnel (generated)", "Bowline (generated)"))


def _faster(measured: Times, name: str, mode: str) -> float:
    return measured.milliseconds(name, GRID, mode) / measured.milliseconds(name, VIRTUAL, mode)


def _fewer(measured: Times, name: str, mode: str) -> float:
    return measured.counts[name, GRID, mode].tests / measured.counts[name, VIRTUAL, mode].tests


def parameters(measured: Times) -> Mapping[str, Any]:
    """What was timed, on what."""
    return {
        **measured.parameters(), "lambda": 1.2,
        "uniform grid": "cells of 1.5 times the largest triangle's bounding sphere, control bits: the method of Pabst "
        "et al. but for its stages on the CPU; here both run on the same device",
    }  # fmt: skip


def tables(measured: Times) -> Mapping[str, Table]:
    """One row per benchmark and mode beside the thesis's, and the stages."""
    columns = (
        "benchmark", "triangles", "mode", "uniform grid [ms]", "virtual subdivision [ms]", "times as fast",
        "tests of the uniform grid", "tests of virtual subdivision", "times fewer tests", "thesis: benchmark",
        "thesis: times as fast (other cards)",
    )  # fmt: skip
    rows = [
        (
            b.name, len(b.triangles), short, *(measured.milliseconds(b.name, m, mode) for m in (GRID, VIRTUAL)),
            _faster(measured, b.name, mode), *(measured.counts[b.name, m, mode].tests for m in (GRID, VIRTUAL)),
            _fewer(measured, b.name, mode), b.thesis, PRINTED.get(b.thesis, float("nan")),
        )
        for b in measured.suite.benchmarks
        for mode, short in MODES.items()
    ]  # fmt: skip
    return {"": Table(columns, rows), "stages": measured.stages()}


def here(measured: Times) -> str:
    """How many times as fast, and with how many times fewer tests, per benchmark."""
    words = [
        f"{b.name} {' and '.join(f'{_faster(measured, b.name, mode):.2g}' for mode in MODES)} (with "
        f"{' and '.join(f'{plain(_fewer(measured, b.name, mode))}' for mode in MODES)} times fewer tests)"
        for b in measured.suite.benchmarks
    ]
    text = f"times as fast as the uniform grid, DCD and CCD: {', '.join(words)}; {device_words(measured.device)}"
    return left_out(measured.suite, text)


def checks(measured: Times) -> Sequence[Check]:
    """Only what does not depend on the device: tests, contacts."""
    fewer = [
        _fewer(measured, b.name, mode) > 1.0 for b in measured.suite.benchmarks for mode in MODES if b.name not in KNOTS
    ]
    reason = "thesis 5.4.3: what makes it faster; in the generated knots triangles have one size"
    return [
        Check.true("fewer tests than the uniform grid, DCD and CCD, each benchmark but the knots", all(fewer), reason),
        *measured.checks(),
    ]


def draw(measured: Times) -> bytes:
    """Milliseconds of both methods per mode, and how many times as fast."""
    note = foot(
        measured.suite,
        f"All stages of one step. Here both methods on one device: {device_words(measured.device)}. Dashes: the "
        "thesis, on a GTX 470 against GTX 295 cards.",
    )
    figure = pictures.figure("Figure 5.16: virtual subdivision against a uniform grid, times", (17.0, 5.8), note)
    *both, right = figure.subplots(1, 3)
    names = [b.name for b in measured.suite.benchmarks]
    for axis, (mode, short) in zip(both, MODES.items(), strict=True):
        pictures.tidy(axis, f"{mode} ({short}), all stages [ms]")
        each = {(name, m): measured.counts[name, m, mode] for name in names for m in (GRID, VIRTUAL)}
        bars(axis, measured.suite, each, (GRID, VIRTUAL), of=lambda counted: counted.milliseconds)
    pictures.tidy(right, "times as fast as the uniform grid")
    colours = {"discrete": "#9fb8cf", "continuous": METHODS[VIRTUAL]}
    for number, (mode, short) in enumerate(MODES.items()):
        for k, b in enumerate(measured.suite.benchmarks):
            place, value = k + 0.4 * (number - 0.5), _faster(measured, b.name, mode)
            right.bar(place, value, 0.38, color=colours[mode], label=short if k == 0 else None)
            right.text(place, value, f"{value:.2g}", ha="center", va="bottom", fontsize=9.0)
            if b.thesis in PRINTED:
                right.hlines(
                    PRINTED[b.thesis], place - 0.19, place + 0.19, colors=pictures.INK, linestyles=(0, (3, 1.2)),
                    linewidth=1.8,
                )  # fmt: skip
    right.axhline(1.0, color=pictures.FAINT, linewidth=1.0)
    right.legend(frameon=False, fontsize=9.5, loc="upper right")
    scenes(right, names)
    return pictures.png(figure)
