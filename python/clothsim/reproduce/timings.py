"""Times of detection on a GPU: tables of milliseconds by benchmark, and the shares of the stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import SMALL, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import (
    METHODS,
    Counted,
    agreement,
    chosen,
    count,
    device_words,
    foot,
    left_out,
    logarithmic,
    plain,
    scenes,
    shares,
)

__all__ = ["GROUPS", "MODES", "OCTREE_GROUPS", "Parts", "Times", "draw_parts", "draw_times", "parts", "times"]

MODES = {"discrete": "DCD", "continuous": "CCD"}
_ROUNDS, _QUICK_ROUNDS = 2, 0
# Stages by the thesis's names (Figures 5.15 and 6.11).
OCTREE_GROUPS = {
    "update of BVs": ("bounds",),
    "building the octree": ("counter tree", "bottom-up", "top-down"),
    "assignment, sort": ("registrations", "sort", "gather"),
    "broad phase": ("workload", "owners of tests", "triangle pairs", "feature pairs"),
    "narrow phase": ("narrow filter", "narrow phase"),
}
GROUPS = {
    "update of BVs": ("bounds",),
    "subdivision, assignment": ("subdivision", "cells"),
    "sort, removal": ("sort", "gather"),
    "broad phase": ("workload", "owners of tests", "triangle pairs", "feature pairs"),
    "narrow phase": ("narrow filter", "narrow phase"),
}


@dataclass(frozen=True)
class Times:
    """Counts by benchmark, method and mode."""

    suite: Suite
    rounds: int
    counts: dict[tuple[str, str, str], Counted]

    @property
    def device(self) -> str:
        """What they were timed on."""
        return next(iter(self.counts.values())).device

    def milliseconds(self, name: str, method: str, mode: str) -> float:
        """All stages of a detection."""
        return self.counts[name, method, mode].milliseconds

    def parameters(self) -> dict[str, Any]:
        """What was measured, on what."""
        return {
            **chosen(self.suite), "device": device_words(self.device),
            "timed": "the stages on the device, by its timestamps, and the narrow phase on the CPU, without transfers",
            "rounds": _rounds(self.rounds),
            **{f"thickness of discrete detection, {b.name} [m]": b.thickness for b in self.suite.benchmarks},
        }  # fmt: skip

    def tables(self, method: str, columns: Sequence[str], printed: Mapping[str, Sequence[float]]) -> dict[str, Table]:
        """One row per benchmark, in ``columns`` what the thesis printed of it, and the stages."""
        rows = []
        for b in self.suite.benchmarks:
            counts = [self.counts[b.name, method, mode] for mode in MODES]
            rows.append((
                b.name, len(b.triangles), *(c.milliseconds for c in counts), max(c.bytes for c in counts) / 1e6,
                *(c.tests for c in counts), b.thesis, *printed.get(b.thesis, (float("nan"),) * len(columns)),
            ))  # fmt: skip
        names = (
            "benchmark", "triangles", "DCD [ms]", "CCD [ms]", "memory on the device [MB]", "DCD tests", "CCD tests",
            "thesis: benchmark", *(f"thesis: {column}" for column in columns),
        )  # fmt: skip
        return {"": Table(names, rows), "stages": self.stages()}

    def here(self, method: str) -> str:
        """Milliseconds per benchmark."""
        words = [
            f"{b.name} {' and '.join(plain(self.milliseconds(b.name, method, mode)) for mode in MODES)}"
            for b in self.suite.benchmarks
        ]
        return left_out(self.suite, f"{', '.join(words)} ms; {device_words(self.device)}")

    def stages(self) -> Table:
        """Each stage of each detection."""
        columns = ("benchmark", "method", "mode", "stage", "time [ms]", "share [%]")
        rows = [
            (*key, stage, 1e3 * s, 1e5 * s / c.milliseconds)
            for key, c in self.counts.items()
            for stage, s in c.seconds.items()
        ]
        return Table(columns, rows)

    def checks(self) -> list[Check]:
        """Only what does not depend on the device."""
        timed = all(len(c.seconds) > 3 and min(c.seconds.values()) >= 0.0 for c in self.counts.values())
        return [Check.true("each stage was timed", timed, "timestamps"), *agreement(list(self.counts.values()))]


def _rounds(rounds: int) -> str:
    return f"the fastest of {rounds} rounds after a first call" if rounds else "one call, the first"


def times(effort: Effort, methods: Sequence[str], name: str, *, quick: Sequence[str] = SMALL) -> Times:
    """Detect with each method, discrete and continuous, in one step of each benchmark."""
    found, rounds = suite(effort, steps=1, quick=quick), _QUICK_ROUNDS if effort.quick else _ROUNDS
    total = len(found.benchmarks) * len(methods) * len(MODES) * (1 + rounds)
    with effort.bar(total, name, "call") as bar:
        counts = {
            (b.name, method, mode): count(b, method, effort, mode=mode, rounds=rounds, done=bar.update)
            for b in found.benchmarks
            for method in methods
            for mode in MODES
        }
    return Times(found, rounds, counts)


def draw_times(
    measured: Times, methods: Sequence[str], printed: Mapping[str, Mapping[str, Sequence[float]]], title: str, note: str
) -> bytes:
    """Milliseconds on logarithmic axes, one per mode, with the thesis's.

    ``printed``: by method and benchmark of the thesis, DCD and CCD [ms].
    """
    note = f"{note} Here: {device_words(measured.device)}. Dashes: the thesis."
    figure = pictures.figure(title, (13.0, 5.6), foot(measured.suite, note))
    axes = figure.subplots(1, 2)
    names = [b.name for b in measured.suite.benchmarks]
    width = 0.8 / len(methods)
    for column, (axis, (mode, short)) in enumerate(zip(axes, MODES.items(), strict=True)):
        pictures.tidy(axis, f"{mode} ({short}), all stages [ms]")
        for number, method in enumerate(methods):
            shift = (number - 0.5 * (len(methods) - 1)) * width
            each = [measured.milliseconds(name, method, mode) for name in names]
            axis.bar(np.arange(len(names)) + shift, each, 0.94 * width, color=METHODS[method], label=method)
            for k, b in enumerate(measured.suite.benchmarks):
                axis.text(k + shift, each[k], plain(each[k]), ha="center", va="bottom", fontsize=8.5)
                if b.thesis in printed.get(method, {}):
                    ends = k + shift - 0.47 * width, k + shift + 0.47 * width
                    value = printed[method][b.thesis][column]
                    axis.hlines(value, *ends, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8)
        logarithmic(axis)
        scenes(axis, names)
    if len(methods) > 1:
        axes[0].legend(frameon=False, fontsize=9.5, loc="upper left")
    return pictures.png(figure)


@dataclass(frozen=True)
class Parts:
    """One method on one benchmark, continuous, timed by stage; ``is_shown``: the thesis's benchmark."""

    suite: Suite
    name: str
    is_shown: bool
    counted: Counted
    groups: dict[str, Sequence[str]]

    @property
    def shares(self) -> dict[str, float]:
        """Share of each of the thesis's steps [%]."""
        return shares(self.counted.seconds, self.groups)

    def parameters(self) -> dict[str, Any]:
        """What was timed, on what."""
        return {
            "shown": self.name, **chosen(self.suite), "mode": "continuous", "device": device_words(self.counted.device),
            **{f"step {group!r}": ", ".join(stages) for group, stages in self.groups.items()},
        }  # fmt: skip

    def tables(self, printed: Mapping[str, float]) -> dict[str, Table]:
        """One row per step, and per stage."""
        rows = [(group, share, printed.get(group, float("nan"))) for group, share in self.shares.items()]
        stages = [(stage, 1e3 * s) for stage, s in self.counted.seconds.items()]
        return {
            "": Table(("step", "share [%]", "thesis [%]"), rows),
            "stages": Table(("stage", "time [ms]"), stages),
        }

    def here(self) -> str:
        """The shares."""
        words = ", ".join(f"{group} {share:.0f} %" for group, share in self.shares.items())
        text = f"{self.name}: {words} of {plain(self.counted.milliseconds)} ms; {device_words(self.counted.device)}"
        return text if self.is_shown else left_out(self.suite, text)

    def checks(self) -> list[Check]:
        """Only what does not depend on the device."""
        known = [stage for stages in self.groups.values() for stage in stages]
        strange = sum(stage not in known for stage in self.counted.seconds)
        return [
            Check("stages that belong to no step", strange, 0.0, 0.0, "each stage counts in one step"),
            Check("shares of all steps [%]", sum(self.shares.values()), 100.0, 1e-6, "each stage counts once"),
            *agreement([self.counted]),
        ]


def parts(effort: Effort, method: str, wanted: str, groups: Mapping[str, Sequence[str]], name: str) -> Parts:
    """Time the stages on the thesis's benchmark, or the first there is."""
    found, rounds = suite(effort, steps=1), _QUICK_ROUNDS if effort.quick else _ROUNDS
    benchmark = found.named(wanted) or found.benchmarks[0]
    with effort.bar(1 + rounds, name, "call") as bar:
        counted = count(benchmark, method, effort, rounds=rounds, done=bar.update)
    return Parts(found, benchmark.name, benchmark.name == wanted, counted, dict(groups))


def draw_parts(measured: Parts, printed: Mapping[str, float], title: str) -> bytes:
    """Shares of the steps, the thesis's as far as its text has them, and the stages in them."""
    note = (
        "Continuous detection on a GPU; the CPU decides what its filter leaves. "
        f"{measured.name}; {device_words(measured.counted.device)}. Dashes: the thesis, as far as its text says."
    )
    figure = pictures.figure(title, (12.0, 5.2), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "share of the time [%]")
    pictures.tidy(right, "stages here [ms]")
    found = measured.shares
    colours = dict(zip(found, ("#c9c5be", "#3f7a57", "#c08a2e", "#9c2f35", "#2f5d8c", "#7a4f86"), strict=False))
    reach = 0.1 * max(found.values())  # of a number beside its bar
    for k, (group, share) in enumerate(found.items()):
        left.barh(k, share, 0.62, color=colours[group])
        theirs = printed.get(group, 0.0)
        left.text(theirs if share < theirs < share + reach else share, k, f" {share:.1f}", va="center", fontsize=9.5)
        if group in printed:
            left.vlines(
                printed[group], k - 0.31, k + 0.31, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8
            )
    left.set_yticks(range(len(found)), list(found))
    of = {stage: group for group, stages in measured.groups.items() for stage in stages}
    for k, (stage, s) in enumerate(measured.counted.seconds.items()):
        right.barh(k, 1e3 * s, 0.62, color=colours[of.get(stage, "other")])
        right.text(1e3 * s, k, f" {plain(1e3 * s)}", va="center", fontsize=9.5)
    right.set_yticks(range(len(measured.counted.seconds)), list(measured.counted.seconds))
    for axis in (left, right):
        axis.invert_yaxis()
        axis.margins(x=0.12)
        axis.grid(axis="y", visible=False)
    return pictures.png(figure)
