"""What the runs of Wong 2010's variants are reported as: tables, checks that no machine changes, bars of stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Table
from clothsim.reproduce.skipping_run import COUNTS, EVERY_FRAME, STAGES, Run

__all__ = ["bars", "checks", "parameters", "tables"]

MOST_BYTES = 48.0  # a stored pair may take


def tables(runs: Sequence[Run]) -> dict[str, Table]:
    """One row per animation and variant, means over the frames; and every frame."""
    columns = (
        "set", "animation", "what", "pace", "motion [edges per frame]", "variant", "processor [ms]",
        "BVHU by wall clock [ms]", "BVHT by wall clock [ms]", "ETP by wall clock [ms]", "speed-up to NoDup",
        "pending pairs", "admissible pairs", "colliding pairs", "memory [B]", "memory per pair [B]",
        "frames that skip [%]", "dangling triangles", "longest session",
    )  # fmt: skip
    rows, frames = [], []
    for made in runs:
        head = (made.experiment, made.listed.number, made.listed.title, made.pace, made.motion)
        for name, series in made.series.items():
            rows.append((
                *head, name, 1e3 * series.total, *(1e3 * series.wall(stage) for stage in STAGES), made.faster(name),
                series.mean("pending"), series.mean("admissible"), series.mean("colliding"), series.mean("pair_bytes"),
                series.bytes_per_pair, 100.0 * series.skipped, series.mean("dangling_triangles"),
                max(series.counts["frames"]),
            ))  # fmt: skip
            for index, kind in enumerate(series.kinds):
                counts = [series.counts[count][index] for count in COUNTS]
                frames.append((*head[:2], made.pace, name, index, kind, *counts))
    return {
        "": Table(columns, rows),
        "frames": Table(("set", "animation", "pace", "variant", "frame", "kind", *COUNTS), frames),
    }


def parameters(runs: Sequence[Run]) -> dict[str, Any]:
    """What was run, on what."""
    from clothsim._cli.doctor import findings

    return {
        "animations": "by formula, see figures 5 and 6; thickness 0.35 of an edge in place of delta_d",
        "triangles, cloth + other": "; ".join(f"{r.listed.title} {r.cloth:,} + {r.other:,}" for r in runs),
        "frames": max(r.frames for r in runs), "threads": 1, "beta": 0.2, "gamma": 0.1, "adapt": "work",
        "processor": findings()["processor"]["model"],
        "times": "processor time of the call with its conversion from and to NumPy, on one thread; all variants detect "
        "every frame, in turn, so that ratios within a run depend little on what else the machine does; counts do not",
        "pairs": "of features, each once; pending: found by traversal or kept by the session; admissible: left by the "
        "distance heuristic, or by the boxes of features",
    }  # fmt: skip


def checks(runs: Sequence[Run]) -> list[Check]:
    """What does not depend on the machine."""
    sessions = [s for r in runs for name, s in r.series.items() if name not in EVERY_FRAME]
    different, wrong = sum(r.different for r in runs), sum(r.wrong for r in runs)
    all_series = [s for r in runs for s in r.series.values()]
    ordered = all(
        c <= a and (a <= p or p == 0)  # a frame alone keeps no list
        for s in all_series
        for c, a, p in zip(*(s.counts[name] for name in ("colliding", "admissible", "pending")), strict=True)
    )
    return [
        Check("frames on which a variant's contacts differ from NoDup's", float(different), 0.0, 0.0,
              "every variant finds the same, times to the bit"),
        Check("frames that differ from bvh", float(wrong), 0.0, 0.0,
              f"pairs and times, {sum(r.compared for r in runs)} frames compared"),
        Check.true("colliding ≤ admissible ≤ pending, on every frame", ordered, "each filter only takes away"),
        Check.true("sessions skip update and traversal", all(s.skipped > 0.0 for s in sessions), "what they are for"),
        Check.true("a stored pair takes at most 48 B", all(s.bytes_per_pair <= MOST_BYTES for s in sessions),
                   "the paper: 48 MB for 142k pairs, about 340 B"),
    ]  # fmt: skip


_COLOURS = {"BVHU": "#2f5d8c", "BVHT": "#c08a2e", "ETP": "#9c2f35"}


def bars(axis: Any, made: Run, title: str, paper: Mapping[str, float] | None = None) -> None:
    """Stages of each variant, one on the other, and above them the speed-up; below it the paper's."""
    pictures.tidy(axis, title)
    axis.set_ylabel("processor time per step [ms]", color=pictures.INK)
    bottom = np.zeros(len(made.series))
    for stage, colour in _COLOURS.items():
        heights = np.array([1e3 * series.stage(stage) for series in made.series.values()])
        axis.bar(list(made.series), heights, 0.72, bottom=bottom, color=colour, label=stage)
        bottom += heights
    for place, (name, top) in enumerate(zip(made.series, bottom, strict=True)):
        own = f"{made.faster(name):.2f}"
        axis.annotate(own, (place, top), (0, 3), textcoords="offset points", ha="center", fontsize=9)
        if paper and name in paper:
            axis.annotate(f"{paper[name]:.2f}", (place, top), (0, 14), textcoords="offset points", ha="center",
                          fontsize=9, color=pictures.FAINT)  # fmt: skip
    axis.set_ylim(0.0, 1.3 * float(bottom.max()))
    axis.tick_params(axis="x", labelsize=8.5, labelrotation=40)
    axis.grid(visible=False, axis="x")
    axis.legend(frameon=False, fontsize=8.5, loc="upper right", ncols=3, handlelength=1.0, columnspacing=0.8)
