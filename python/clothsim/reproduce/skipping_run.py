"""Detection over an animation by the variants of Wong 2010, which take turns at every frame, on one thread."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats
from clothsim.reproduce.animations import Animation, Listed
from clothsim.reproduce.contract import Bar, Effort

__all__ = ["ADAPTIVE", "COUNTS", "EVERY_FRAME", "STAGES", "Run", "Series", "fixed", "jobs", "run"]

Options = Mapping[str, Any]

STAGES = ("BVHU", "BVHT", "ETP")  # tree update, traversal, elementary tests
COUNTS = ("pending", "admissible", "colliding", "pair_bytes", "dangling_triangles", "work", "frames")
EVERY_FRAME: Mapping[str, Options] = {name: {"variant": name} for name in ("NoDup", "R-TRI", "nSwD")}
ADAPTIVE: Mapping[str, Options] = {"SwD": {"variant": "SwD"}}


def fixed(*pairs: tuple[int, int]) -> Mapping[str, Options]:
    """The paper's αxfy: sessions of y frames with α = x."""
    return {
        f"α{alpha}f{frames}": {"variant": "SwD", "frames": frames, "alpha": float(alpha)} for alpha, frames in pairs
    }


@dataclass
class Series:
    """What one variant took and counted, frame by frame.

    Attributes
    ----------
    seconds : dict of list of float
        Wall-clock time by stage.
    processor : list of float
        Processor time of the whole call [s]: other programs on the machine lengthen it less than wall-clock time.
    counts : dict of list of int
        By the name in the session's stats.
    kinds : list of str
        Whether the frame was alone, a session's first, or skipped update and traversal.
    """

    seconds: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})
    processor: list[float] = field(default_factory=list)
    counts: dict[str, list[int]] = field(default_factory=lambda: {name: [] for name in COUNTS})
    kinds: list[str] = field(default_factory=list)

    def take(self, stats: Mapping[str, Any], processor: float) -> None:
        """Add a frame."""
        seconds = {stage: float(stats["seconds"][stage]) for stage in STAGES}
        for stage, time_ in seconds.items():
            self.seconds[stage].append(time_)
        # The first call builds the tree's topology too, which no stage counts.
        self.processor.append(processor if self.kinds else min(processor, sum(seconds.values())))
        for name in COUNTS:
            self.counts[name].append(int(stats[name]))
        self.kinds.append(str(stats["frame"]))

    def wall(self, stage: str) -> float:
        """Mean wall-clock time of a stage [s]."""
        return float(np.mean(self.seconds[stage]))

    @property
    def total(self) -> float:
        """Mean processor time of detection [s]."""
        return float(np.mean(self.processor))

    def stage(self, stage: str) -> float:
        """A stage's part of the processor time [s]: as large as its part of the wall-clock time."""
        return self.total * self.wall(stage) / sum(self.wall(name) for name in STAGES)

    def mean(self, name: str) -> float:
        """Mean of a count."""
        return float(np.mean(self.counts[name]))

    def sum(self, name: str) -> int:
        """Sum of a count."""
        return sum(self.counts[name])

    @property
    def bytes_per_pair(self) -> float:
        """Memory per stored pair [B], mean over the frames that store any; 0 without."""
        pairs = [(b, p) for b, p in zip(self.counts["pair_bytes"], self.counts["pending"], strict=True) if b and p]
        return float(np.mean([b / p for b, p in pairs])) if pairs else 0.0

    @property
    def skipped(self) -> float:
        """Share of frames that skipped update and traversal."""
        return float(np.mean([kind == "skipping" for kind in self.kinds]))


@dataclass
class Run:
    """An animation by several variants.

    Attributes
    ----------
    experiment : str
        Set one or two.
    listed : Listed
        Which animation.
    pace : float
        Time between frames over the animation's own.
    motion : float
        Mean way of the cloth's vertices per frame over the mean length of its edges.
    cloth, other : int
        Triangles.
    frames : int
        Steps detected.
    self_collision : bool
        Whether the cloth's pairs with itself are found too.
    series : dict of Series
        By variant.
    different : int
        Times that a variant's contacts were not those of the first, in pairs and times, to the bit.
    compared, wrong : int
        Frames compared with bvh, and how many of them differed.
    """

    experiment: str
    listed: Listed
    pace: float
    motion: float
    cloth: int
    other: int
    frames: int
    self_collision: bool
    series: dict[str, Series]
    different: int = 0
    compared: int = 0
    wrong: int = 0

    def faster(self, variant: str, than: str = "NoDup") -> float:
        """By how much in processor time."""
        return float(np.sum(self.series[than].processor) / np.sum(self.series[variant].processor))


def jobs(effort: Effort, runs: int, frames: int, name: str) -> Bar:
    """A bar for so many runs."""
    return effort.bar(runs * frames, name, "frame")


def run(
    experiment: str, listed: Listed, variants: Mapping[str, Options], frames: int, bar: Bar, *,
    quick: bool, self_collision: bool = True, pace: float = 1.0,
) -> Run:  # fmt: skip
    """Detect from frame to frame; the variants' order turns, so that what else the machine does meets all alike."""
    animation = listed.make(quick=quick)
    animation = replace(animation, dt=pace * animation.dt)
    sessions = {
        name: collision.SkippingSession(
            animation.triangles, rest=animation.rest, threads=1, low_curvature=self_collision,
            bodies=_bodies(animation, self_collision=self_collision), **options,
        )
        for name, options in variants.items()
    }  # fmt: skip
    oracle = _oracle(animation, self_collision=self_collision)
    names = list(variants)
    made = Run(
        experiment, listed, pace, _motion(animation), animation.count(cloth=True), animation.count(cloth=False), frames,
        self_collision, {name: Series() for name in names},
    )  # fmt: skip
    start = animation.frame(0)
    for index in range(frames):
        end = animation.frame(index + 1)
        found = {}
        for name in names[index % len(names) :] + names[: index % len(names)]:
            before = time.process_time()
            found[name] = sessions[name].detect(start, end, animation.thickness)
            made.series[name].take(found[name].stats, time.process_time() - before)
        made.different += sum(not _same(found[names[0]], found[name]) for name in names[1:])
        made.compared += 1
        made.wrong += not _same(oracle(start, end), found[names[0]])
        start = end
        bar.update()
    return made


def _motion(animation: Animation) -> float:
    ways = []
    triangles = animation.triangles[: animation.count(cloth=True)]
    for index in (0, animation.frames // 2, animation.frames - 1):
        x, after = animation.frame(index), animation.frame(index + 1)
        way = np.linalg.norm(after - x, axis=1)[: animation.cloth_vertices()].mean()
        ways.append(way / np.linalg.norm(x[triangles] - x[np.roll(triangles, 1, axis=1)], axis=2).mean())
    return float(np.mean(ways))


def _bodies(animation: Animation, *, self_collision: bool) -> list[tuple[int, bool, bool]]:
    """The cloth as one body, the rest as another that does not move by forces."""
    vertices = animation.cloth_vertices()
    return [(vertices, True, self_collision), (int(animation.parts[-1].vertices.stop) - vertices, False, False)]


def _same(one: collision.Detection, other: collision.Detection) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("vertex_triangle", "time_vertex_triangle", "edge_edge", "time_edge_edge")
    )


def _oracle(animation: Animation, *, self_collision: bool) -> Callable[[Floats, Floats], collision.Detection]:
    """All contacts by bvh, without those that no session is asked for: within the bodies, within the cloth."""
    vertices, triangles = animation.cloth_vertices(), animation.count(cloth=True)

    def find(start: Floats, end: Floats) -> collision.Detection:
        found = collision.detect(start, end, animation.triangles, thickness=animation.thickness)
        kept = []
        for pairs, limits in ((found.vertex_triangle, [vertices, triangles]), (found.edge_edge[:, [0, 2]], vertices)):
            of_cloth = (pairs < limits).sum(axis=1)
            kept.append(of_cloth >= 1 if self_collision else of_cloth == 1)
        return collision.Detection(
            found.vertex_triangle[kept[0]], found.time_vertex_triangle[kept[0]], found.edge_edge[kept[1]],
            found.time_edge_edge[kept[1]], found.stats,
        )  # fmt: skip

    return find
