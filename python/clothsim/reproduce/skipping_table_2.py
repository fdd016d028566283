"""Table 2 of Wong 2010: detection time per step in experiment set one, self-collision included, by variant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clothsim.reproduce import pictures
from clothsim.reproduce import skipping_report as report
from clothsim.reproduce import skipping_run as runs
from clothsim.reproduce.animations import SETS
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

PRINTED = {
    "one": (0.23, 0.18, 0.15, 0.13), "two": (0.12, 0.10, 0.082, 0.074), "three": (0.31, 0.27, 0.23, 0.16),
    "four": (0.092, 0.076, 0.062, 0.052),
}  # fmt: skip
NAMES = ("NoDup", "R-TRI", "nSwD", "SwD")
THESIS = (
    "NoDup, R-TRI, nSwD, SwD on one thread of a 2.4 GHz Core 2: 230, 180, 150, 130 ms; 120, 100, 82, 74 ms; "
    "310, 270, 230, 160 ms; 92, 76, 62, 52 ms: SwD is 1.77, 1.62, 1.94, 1.77 times as fast as NoDup"
)
FIXED = ((3, 4), (7, 8), (15, 16))
FRAMES, QUICK_FRAMES = 60, 12
PACES, QUICK_PACES = (0.25, 4.0, 16.0), (16.0,)  # of the first animation, time between frames over its own


@dataclass(frozen=True)
class Measured:
    """The four animations, and the first at other paces."""

    four: list[runs.Run]
    paces: list[runs.Run]

    @property
    def all(self) -> list[runs.Run]:
        """Both."""
        return [*self.four, *self.paces]


def measure(effort: Effort) -> Measured:
    """Run the animations."""
    variants = {**runs.EVERY_FRAME, **runs.ADAPTIVE, **runs.fixed(*FIXED)}
    frames = QUICK_FRAMES if effort.quick else FRAMES
    others = QUICK_PACES if effort.quick else PACES
    with runs.jobs(effort, len(SETS["one"]) + len(others), frames, "table 2") as bar:
        four = [runs.run("one", item, variants, frames, bar, quick=effort.quick) for item in SETS["one"]]
        few = {"NoDup": variants["NoDup"], "nSwD": variants["nSwD"], "SwD": variants["SwD"]}
        paces = [runs.run("one", SETS["one"][0], few, frames, bar, quick=effort.quick, pace=pace) for pace in others]
    return Measured(four, paces)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was run, on what."""
    return {**report.parameters(measured.four), "paces": "the first animation with other times between frames"}


def tables(measured: Measured) -> Mapping[str, Table]:
    """Beside the paper's times; stages and counts; every frame."""
    rows = []
    for made in measured.four:
        printed = PRINTED[made.listed.number]
        for name, paper in zip(NAMES, printed, strict=True):
            series = made.series[name]
            rows.append(
                (made.listed.number, made.listed.title, name, 1e3 * series.total, made.faster(name), 1e3 * paper,
                 printed[0] / paper)
            )  # fmt: skip
    columns = ("animation", "what", "variant", "time [ms]", "speed-up to NoDup", "paper [ms]", "paper's speed-up")
    more = report.tables(measured.all)
    return {"": Table(columns, rows), "stages": more[""], "frames": more["frames"]}


def here(measured: Measured) -> str:
    """Times and speed-ups, animation by animation."""
    words = []
    for made in measured.four:
        times = ", ".join(f"{1e3 * made.series[name].total:.3g}" for name in NAMES)
        session = made.series["SwD"]
        words.append(
            f"{made.listed.title}: {times} ms, SwD {made.faster('SwD'):.2f} times as fast as NoDup, "
            f"{session.mean('pending'):,.0f} pending, {session.mean('admissible'):,.0f} admissible, "
            f"{session.mean('colliding'):,.0f} colliding pairs, {session.bytes_per_pair:.0f} B per pair"
        )
    first = sorted([measured.four[0], *measured.paces], key=lambda made: made.motion)
    paces = ", ".join(f"{made.motion:.2g}: {made.faster('SwD'):.2f}" for made in first)
    return (
        f"{measured.four[0].frames} frames, one thread, processor time; {'; '.join(words)}; {first[0].listed.title} by "
        f"motion in edges per frame, SwD times as fast as NoDup: {paces}"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """What does not depend on the machine."""
    return report.checks(measured.all)


def draw(measured: Measured) -> bytes:
    """Stages of each variant."""
    note = (
        "Processor time on one thread; the variants take turns at every frame. Numbers: speed-up to NoDup; in grey "
        "the paper's (2.4 GHz Core 2). αxfy: sessions of y frames, α = x."
    )
    figure = pictures.figure("Table 2: collision detection per step, experiment set one", (17.0, 4.8), note)
    *axes, last = figure.subplots(1, len(measured.four) + 1)
    for axis, made in zip(axes, measured.four, strict=True):
        printed = dict(zip(NAMES, PRINTED[made.listed.number], strict=True))
        factors = {name: printed["NoDup"] / paper for name, paper in printed.items()}
        report.bars(axis, made, f"{made.listed.number}: {made.listed.title}", factors)
    pictures.tidy(last, "one: by its pace", "mean motion [edges per frame]", "speed-up to NoDup")
    paces = sorted([measured.four[0], *measured.paces], key=lambda made: made.motion)
    for variant, colour in (("nSwD", "#8c8882"), ("SwD", "#9c2f35")):
        speedups = [made.faster(variant) for made in paces]
        last.plot([made.motion for made in paces], speedups, "o-", color=colour, label=variant)
    last.set_xscale("log")
    last.set_ylim(bottom=0.0)
    last.legend(frameon=False, fontsize=9)
    return pictures.png(figure)
