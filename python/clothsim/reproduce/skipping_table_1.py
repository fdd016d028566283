"""Table 1 of Wong 2010: the model complexities, and those of the animations that stand for the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce import skipping_snapshots as snapshots
from clothsim.reproduce.animations import SETS
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "set one: 5.2k + 97k, 10k + 45k, 0.5k + 97k, 34k + 20k triangles (rigid + cloth); set two: 11k + 320k, 7k + 500k, "
    "1k + 502k, 40k + 500k"
)
ROUNDED = 500.0  # triangles: the paper's numbers are rounded to half a thousand at the coarsest


@dataclass(frozen=True)
class Measured:
    """Triangles (rigid, cloth) in full, and moments of what was run."""

    sizes: dict[tuple[str, str], tuple[int, int]]
    shots: list[snapshots.Shot]


def measure(effort: Effort) -> Measured:
    """Count triangles, then what the animations have of contact and motion."""
    sizes = {}
    for experiment, group in SETS.items():
        for item in group:
            full = item.make(quick=False)
            sizes[experiment, item.number] = full.count(cloth=False), full.count(cloth=True)
    return Measured(sizes, snapshots.shoot(effort, tuple(SETS), "table 1"))


def parameters(measured: Measured) -> Mapping[str, Any]:
    """How the animations came about."""
    return snapshots.parameters(measured.shots)


def tables(measured: Measured) -> Mapping[str, Table]:
    """Sizes beside the paper's; what there is to detect."""
    rows = [
        (experiment, item.number, item.title, *measured.sizes[experiment, item.number], item.rigid, item.cloth)
        for experiment, group in SETS.items()
        for item in group
    ]
    columns = ("set", "animation", "what", "rigid", "cloth", "rigid (paper)", "cloth (paper)")
    return {"": Table(columns, rows), "moments": snapshots.tables(measured.shots)[""]}


def here(measured: Measured) -> str:
    """The sizes, and contacts."""
    words = []
    for experiment, group in SETS.items():
        sizes = [measured.sizes[experiment, item.number] for item in group]
        words.append(f"set {experiment}: " + ", ".join(f"{rigid:,} + {cloth:,}" for rigid, cloth in sizes))
    return "; ".join(words)


def checks(measured: Measured) -> Sequence[Check]:
    """Sizes as printed, and animations that are fit for the experiments."""
    off = max(
        abs(here - paper)
        for experiment, group in SETS.items()
        for item in group
        for here, paper in zip(measured.sizes[experiment, item.number], (item.rigid, item.cloth), strict=True)
    )
    return [
        Check("triangles: largest difference from the paper", off, 0.0, ROUNDED, "its numbers are rounded"),
        *snapshots.checks(measured.shots),
    ]


def draw(measured: Measured) -> bytes:
    """Bars of triangles, and of contacts late in each animation."""
    last = [s for s in measured.shots if s.frame == snapshots.MOMENTS[-1]]
    cloth = [s.animation.count(cloth=True) for s in last]
    note = (
        f"Left: bars here, dashes the paper. Right: at frame {snapshots.MOMENTS[-1]}, {min(cloth):,} to {max(cloth):,} "
        "triangles of cloth."
    )
    figure = pictures.figure("Table 1: the model complexities", (11.5, 4.8), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "triangles")
    pictures.tidy(right, "vertex-triangle and edge-edge pairs in contact")
    items = [(experiment, item) for experiment, group in SETS.items() for item in group]
    at = np.arange(len(items), dtype=float)
    for number, (name, colour) in enumerate((("rigid", "#8c8882"), ("cloth", "#2f5d8c"))):
        place = at + 0.38 * (number - 0.5)
        left.bar(place, [measured.sizes[e, i.number][number] for e, i in items], 0.34, color=colour, label=name)
        paper = [(i.rigid, i.cloth)[number] for _, i in items]
        left.hlines(paper, place - 0.17, place + 0.17, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.6)
        counted = [(s.contacts.body, s.contacts.cloth)[number] for s in last]
        label = ("cloth and body", "cloth and cloth")[number]
        right.bar(place, counted, 0.34, color=colour, label=label)
    for axis in (left, right):
        axis.set_yscale("log")
        axis.set_xticks(at, [f"{e}\n{i.number}" for e, i in items], fontsize=9)
        axis.set_xlabel("set, animation", color=pictures.INK)
        low, high = axis.get_ylim()
        axis.set_ylim(low, 6.0 * high)
        axis.legend(frameon=False, fontsize=9.5, loc="upper left", ncols=2)
    return pictures.png(figure)
