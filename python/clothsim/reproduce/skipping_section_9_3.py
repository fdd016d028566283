"""Section 9.3 of Wong 2010: the spinning ball beside other methods; memory of the pairs."""

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

# Milliseconds on the spinning ball's 92k to 97k triangles, as the section quotes them; one thread each.
QUOTED = {
    "the paper (2.4 GHz Core 2)": 130.0, "Tang 2008 (2.66 GHz Pentium)": 246.0,
    "Tang 2009 (similar)": 290.0, "Tang 2010 (2.4 GHz)": 144.0,
}  # fmt: skip
PAIRS, BYTES = 142e3, 48e6
THESIS = (
    "spinning ball, 97k triangles with self-collision: 130 ms; others 246, 290 and 144 ms; on average 142k potentially "
    "colliding triangle pairs in 48 MB, about 340 B each, with what dynamics keeps there"
)
FRAMES, QUICK_FRAMES = 60, 12


def measure(effort: Effort) -> runs.Run:
    """Run the spinning ball."""
    variants = {"NoDup": runs.EVERY_FRAME["NoDup"], **runs.ADAPTIVE}
    frames = QUICK_FRAMES if effort.quick else FRAMES
    with runs.jobs(effort, 1, frames, "section 9.3") as bar:
        return runs.run("one", SETS["one"][0], variants, frames, bar, quick=effort.quick)


def parameters(measured: runs.Run) -> Mapping[str, Any]:
    """What was run, on what."""
    return {
        **report.parameters([measured]),
        "quoted": "on other machines, of 2008 to 2010: not comparable with those here",
    }


def tables(measured: runs.Run) -> Mapping[str, Table]:
    """Times and memory, here and quoted; every frame."""
    session = measured.series["SwD"]
    rows: list[Sequence[Any]] = [
        (f"here: {name}", 1e3 * s.total, s.mean("pending"), s.mean("pair_bytes"), s.bytes_per_pair)
        for name, s in measured.series.items()
    ]
    for name, milliseconds in QUOTED.items():
        own = name.startswith("the paper")
        rows.append((name, milliseconds, *((PAIRS, BYTES, BYTES / PAIRS) if own else ("", "", ""))))
    columns = ("method", "time [ms]", "pending pairs", "memory of pairs [B]", "memory per pair [B]")
    frames = Table(
        ("frame", "kind", "pending", "admissible", "colliding", "pair_bytes"),
        [
            (k, session.kinds[k], *(session.counts[n][k] for n in ("pending", "admissible", "colliding", "pair_bytes")))
            for k in range(measured.frames)
        ],
    )
    return {"": Table(columns, rows), "frames": frames}


def here(measured: runs.Run) -> str:
    """Time and memory."""
    session = measured.series["SwD"]
    return (
        f"{measured.cloth:,} + {measured.other:,} triangles, {measured.frames} frames, one thread, processor time: "
        f"{1e3 * session.total:.3g} ms, {measured.faster('SwD'):.2f} times as fast as NoDup; "
        f"{session.mean('pending'):,.0f} feature pairs in {1e-6 * session.mean('pair_bytes'):.3g} MB, "
        f"{session.bytes_per_pair:.1f} B each, for detection alone"
    )


def checks(measured: runs.Run) -> Sequence[Check]:
    """What does not depend on the machine."""
    return report.checks([measured])


def draw(measured: runs.Run) -> bytes:
    """Times beside those quoted; pairs over the frames."""
    note = (
        "Grey: as quoted, on machines of 2008 to 2010. Here: processor time, one thread, taking turns at every frame."
    )
    figure = pictures.figure("Section 9.3: the spinning ball", (12.0, 4.8), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "detection per step, with self-collision [ms]")
    names = [*(f"here: {name}" for name in measured.series), *QUOTED]
    times = [*(1e3 * series.total for series in measured.series.values()), *QUOTED.values()]
    colours = ["#2f5d8c"] * len(measured.series) + ["#b9b5ae"] * len(QUOTED)
    places = np.arange(len(names))[::-1]
    left.barh(places, times, color=colours)
    left.set_yticks(places, names, fontsize=9.5)
    for place, milliseconds in zip(places, times, strict=True):
        left.text(milliseconds, place, f" {milliseconds:.3g}", va="center", fontsize=9.5, color=pictures.INK)
    pictures.tidy(right, "feature pairs of the session (none in a frame alone)", "frame")
    session = measured.series["SwD"]
    for count, colour in (("pending", "#8c8882"), ("admissible", "#c08a2e"), ("colliding", "#9c2f35")):
        kept = [c if p else np.nan for c, p in zip(session.counts[count], session.counts["pending"], strict=True)]
        right.plot(kept, color=colour, label=count)
    right.set_ylim(bottom=0.0)
    right.legend(frameon=False, fontsize=9.5, loc="upper left")
    return pictures.png(figure)
