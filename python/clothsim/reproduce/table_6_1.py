"""Table 6.1: which levels of the octree grid are active, and how many registrations each has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats
from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import COLOURS, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import OCTREE, chosen, foot, left_out

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

# Levels 3 to 8: share of the steps in which each is active, share of the registrations [%].
PRINTED = {
    "Funnel": ((0, 100, 100, 100, 23.6, 0), (0, 4.7e-3, 2.1e-1, 70.8, 29.1, 0)),
    "Cloth on ball": ((1.6, 100, 100, 100, 87.5, 3.4), (1.6e-3, 5.4e-2, 3.5e-1, 2.2, 92.7, 4.9)),
    "Flamenco": ((4.9, 100, 100, 100, 87.2, 0), (1.5e-3, 6.1e-2, 5.4e-1, 43.6, 56.3, 0)),
    "N-body": ((12.5, 100, 100, 100, 96.0, 10.1), (2.9e-3, 8.3e-2, 4.7e-1, 6.5, 80.2, 13.3)),
    "Reef knot": ((0, 100, 100, 100, 75.3, 0), (0, 4.5e-2, 2.0e-1, 10.7, 88.3, 0)),
}
FIRST_PRINTED = 3
THESIS = (
    "levels 4 to 6 are active in all steps and level 7 in most, 1, 2 and 9 in none; most registrations are in levels 6 "
    "and 7 (95.0 to 99.9 %; 87 % in N-body)"
)
LEVELS = 11
STEPS, QUICK_REPEATS, REPEATS = 6, 2, 6


@dataclass(frozen=True)
class Measured:
    """Registrations, (steps, levels), by benchmark; a level is active in a step where it has any."""

    suite: Suite
    registrations: dict[str, Floats]
    bases: dict[str, list[int]]
    differing: int

    def active(self, name: str) -> Floats:
        """Share of the steps in which each level is active [%]."""
        return np.asarray(100.0 * (self.registrations[name] > 0).mean(axis=0))

    def share(self, name: str) -> Floats:
        """Share of the registrations in each level, over all steps [%]."""
        each = self.registrations[name].sum(axis=0)
        return np.asarray(100.0 * each / each.sum())


def measure(effort: Effort) -> Measured:
    """Detect step by step; what has one step takes it again, until the levels have settled."""
    found = suite(effort, steps=STEPS, quick=("Funnel (generated)",))
    repeats = QUICK_REPEATS if effort.quick else REPEATS
    registrations: dict[str, Floats] = {}
    bases: dict[str, list[int]] = {}
    differing = 0
    with effort.bar(sum(max(len(b.steps), repeats) for b in found.benchmarks), "table 6.1", "call") as bar:
        for b in found.benchmarks:
            rows, bases[b.name] = [], []
            for number in range(max(len(b.steps), repeats)):
                step = min(number, len(b.steps) - 1)
                d = collision.detect(*b.steps[step], b.triangles, OCTREE, device="gpu", threads=effort.threads)
                rows.append([float(d.stats[f"registrations_level_{level}"]) for level in range(LEVELS)])
                bases[b.name].append(int(d.stats["finest_level"]))
                differing += not np.array_equal(
                    d.edge_edge, b.on_cpu("continuous", step, effort.threads).edge_edge
                )  # fmt: skip
                bar.update()
            registrations[b.name] = np.array(rows)
    return Measured(found, registrations, bases, differing)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was measured, on what."""
    steps = {f"steps, {name}": len(rows) for name, rows in measured.registrations.items()}
    return {
        **chosen(measured.suite), "mode": "continuous", "levels": "level k has 2^k cells along each axis",
        "steps": "a benchmark of one step takes it again: levels adapt from step to step", **steps,
        **{f"finest level of each step, {name}": ", ".join(map(str, found)) for name, found in measured.bases.items()},
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per benchmark and level beside the thesis's."""
    columns = (
        "benchmark", "level", "active in steps [%]", "registrations [%]", "thesis: active in steps [%]",
        "thesis: registrations [%]",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for b in measured.suite.benchmarks:
        active, share = measured.active(b.name), measured.share(b.name)
        rows += [(b.name, k, active[k], share[k], *_printed(b.thesis, k)) for k in range(LEVELS)]
    return {"": Table(columns, rows)}


def _printed(thesis: str, level: int) -> tuple[float, float]:
    """What the thesis prints; nothing for a benchmark that its table has not."""
    if thesis not in PRINTED:
        return float("nan"), float("nan")
    active, share = PRINTED[thesis]
    column = level - FIRST_PRINTED
    return (active[column], share[column]) if 0 <= column < len(active) else (0.0, 0.0)


def here(measured: Measured) -> str:
    """The levels that are active, and the two with most registrations."""
    words = []
    for b in measured.suite.benchmarks:
        share = measured.share(b.name)
        levels = np.flatnonzero(share > 0.0)
        two = max(range(LEVELS - 1), key=lambda k: share[k] + share[k + 1])
        words.append(
            f"{b.name} levels {levels[0]} to {levels[-1]}, {share[two] + share[two + 1]:.1f} % of the registrations in "
            f"{two} and {two + 1}"
        )
    return left_out(measured.suite, "; ".join(words))


def checks(measured: Measured) -> Sequence[Check]:
    """No level is coarser than the thesis's; a few levels have nearly all registrations; they are active always."""
    coarse = max(float(measured.share(b.name)[:3].max()) for b in measured.suite.benchmarks)
    three = []
    for b in measured.suite.benchmarks:
        share = measured.share(b.name)
        three.append(max(share[k : k + 3].sum() for k in range(LEVELS - 2)))
    source = "thesis 6.4.2, Table 6.1"
    reason = "contacts equal those of the tree on the CPU"
    most = 2.0 if measured.suite.is_quick else 0.5  # few triangles: those of the tools have more of all registrations
    return [
        Check("registrations in levels 0 to 2, the largest share of a benchmark [%]", coarse, 0.0, most, source),
        Check.true("three neighbouring levels have over 85 % of the registrations", min(three) > 85.0, source),
        Check("steps whose contacts are not those of the CPU", float(measured.differing), 0.0, 0.0, reason),
    ]


def draw(measured: Measured) -> bytes:
    """Registrations over the levels, beside the thesis's."""
    note = foot(
        measured.suite,
        "Continuous detection. Bars: share of the registrations in each level; below: share of the steps in which "
        "it is active [%]. Dashes: the thesis.",
    )
    names = [b.name for b in measured.suite.benchmarks]
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    figure = pictures.figure("Table 6.1: levels of the octree grid", (14.0, 1.6 + 3.2 * rows), note)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axis in axes[len(names) :]:
        axis.set_visible(False)
    for axis, b in zip(axes, measured.suite.benchmarks, strict=False):
        pictures.tidy(axis, b.name, "", "registrations [%]")
        active, share = measured.active(b.name), measured.share(b.name)
        levels = range(2, LEVELS)
        axis.bar(levels, [share[k] for k in levels], 0.7, color=COLOURS[b.name])
        for k in levels:
            value = _printed(b.thesis, k)[1]
            if value > 0.0:
                axis.hlines(value, k - 0.35, k + 0.35, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8)
        axis.set_xticks(list(levels), [f"{k}\n{active[k]:.0f}" if active[k] else f"{k}" for k in levels], fontsize=8.5)
        axis.set_ylim(0.0, 105.0)
        axis.grid(axis="x", visible=False)
    return pictures.png(figure)
