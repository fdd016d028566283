"""Figure 7 of Wong 2010: experiment set two without self-collision, stages by the length of the session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.reproduce import pictures
from clothsim.reproduce import skipping_report as report
from clothsim.reproduce import skipping_run as runs
from clothsim.reproduce.animations import SETS
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "animations two to four, half a million triangles, without self-collision: sessions are two to five times as fast "
    "as NoDup; animation one, 320k triangles with self-collision: 660 ms against 830 ms of NoDup"
)
FIXED = ((1, 2), (3, 4), (7, 8), (15, 16), (31, 32))
FRAMES, QUICK_FRAMES = 48, 12


def measure(effort: Effort) -> list[runs.Run]:
    """Run the four animations, the first with self-collision."""
    every = {name: runs.EVERY_FRAME[name] for name in ("NoDup", "nSwD")}
    variants = {**every, **runs.fixed(*FIXED), **runs.ADAPTIVE}
    frames = QUICK_FRAMES if effort.quick else FRAMES
    with runs.jobs(effort, len(SETS["two"]), frames, "figure 7") as bar:
        return [
            runs.run(
                "two", item, {**every, **runs.ADAPTIVE} if item.number == "one" else variants, frames, bar,
                quick=effort.quick, self_collision=item.number == "one",
            )
            for item in SETS["two"]
        ]  # fmt: skip


def parameters(measured: Sequence[runs.Run]) -> Mapping[str, Any]:
    """What was run, on what."""
    return {**report.parameters(measured), "self-collision": "animation one only"}


def tables(measured: Sequence[runs.Run]) -> Mapping[str, Table]:
    """Stages and counts; every frame."""
    return report.tables(measured)


def here(measured: Sequence[runs.Run]) -> str:
    """Speed-ups."""
    first, *others = measured
    words = []
    for made in others:
        factors = ", ".join(f"{name} {made.faster(name):.2f}" for name in made.series if name != "NoDup")
        words.append(f"{made.listed.title} ({made.cloth:,} triangles): {factors}")
    return (
        f"{first.frames} frames, one thread, processor time, times as fast as NoDup: {'; '.join(words)}; "
        f"{first.listed.title} with self-collision ({first.cloth:,} triangles): "
        f"{1e3 * first.series['SwD'].total:.3g} ms against {1e3 * first.series['NoDup'].total:.3g} ms of NoDup"
    )


def checks(measured: Sequence[runs.Run]) -> Sequence[Check]:
    """What does not depend on the machine."""
    return report.checks(measured)


def draw(measured: Sequence[runs.Run]) -> bytes:
    """Stages of each variant."""
    note = (
        "Processor time on one thread; the variants take turns at every frame. Numbers: speed-up to NoDup. αxfy: "
        "sessions of y frames, α = x; SwD: adaptive."
    )
    title = "Figure 7: experiment set two; two to four without self-collision"
    figure = pictures.figure(title, (15.0, 4.8), note)
    axes = figure.subplots(1, len(measured), width_ratios=[len(made.series) + 2.5 for made in measured])
    for axis, made in zip(np.atleast_1d(axes), measured, strict=True):
        report.bars(axis, made, f"{made.listed.number}: {made.listed.title}")
    return pictures.png(figure)
