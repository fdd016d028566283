"""Runs points, each seed of each in a process of its own, and keeps what came of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from clothsim import _core
from clothsim._files import write_whole
from clothsim.scene import Scene
from clothsim.study.axes import Axis
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.points import Built, Settings, build
from clothsim.study.pool import Job, run_jobs
from clothsim.study.state import State
from clothsim.study.worker import pack_scene

__all__ = ["Run", "Runner"]


@dataclass(frozen=True, eq=False)
class Run:
    """One seed of one point: its facts, and its state unless it failed."""

    facts: dict[str, Any]
    state: State | None

    @property
    def error(self) -> str | None:
        """Why it failed."""
        return self.facts.get("error")


class Runner:
    """Runs of one scene.

    Parameters
    ----------
    scene : Scene
        What every run starts from.
    base : mapping
        Its tables, with what is set for all runs.
    axes : sequence of Axis
        What settings may name.
    folder : StudyFolder
        Where results are kept; it is locked and claimed.
    seeds : int
        Runs of each point, each with another disturbance; 1: none, undisturbed.
    """

    def __init__(
        self,
        scene: Scene,
        base: Mapping[str, Any],
        axes: Sequence[Axis],
        folder: StudyFolder,
        *,
        seeds: int = 1,
        seed: int = 0,
        disturbance: float = 1e-3,
        repeats: int = 3,
        patience: float = 60.0,
        processes: int | None = None,
        limit: float | None = None,
    ) -> None:
        self.base = dict(base)
        self.axes = list(axes)
        self._folder = folder
        self._seeds: list[int | None] = [None] if seeds <= 1 else [seed + k for k in range(seeds)]
        self._disturbance, self._repeats, self._patience = disturbance, repeats, patience
        self._processes, self._limit = processes, limit
        packed = pack_scene(scene)
        self._scene = folder.work / "scene.pickle"
        self._digest = fingerprint(_core.__version__, packed)
        write_whole(self._scene, packed)

    @property
    def per_point(self) -> int:
        """Runs that a point takes."""
        return len(self._seeds)

    def built(self, settings: Settings) -> Built:
        """The tables of a point's scene."""
        return build(self.base, self.axes, settings)

    def run(
        self, points: Iterable[Settings], progress: Callable[[], None] = lambda: None, *, timed: bool = True
    ) -> list[list[Run]]:
        """Run points and return, for each, its runs by seed; what has run before is not run again."""
        per_point: list[tuple[Built, list[Job]]] = []
        unique: dict[str, Job] = {}
        for settings in points:
            built = self.built(settings)
            jobs = [] if built.error else [self._job(built, seed, timed=timed) for seed in self._seeds]
            if built.error:
                for _ in self._seeds:
                    progress()
            per_point.append((built, [unique.setdefault(job.path.name, job) for job in jobs]))
        run_jobs(list(unique.values()), self._processes, self._limit, progress)
        return [
            [self._load(job, built) for job in jobs] if not built.error else [Run({"error": built.error}, None)]
            for built, jobs in per_point
        ]

    def _job(self, built: Built, seed: int | None, *, timed: bool) -> Job:
        spec = {
            "data": built.data, "threads": built.threads, "device": built.device, "seed": seed,
            "disturbance": self._disturbance if seed is not None else 0.0, "precision": built.precision,
        }  # fmt: skip
        name = fingerprint([self._digest, spec])
        more = {"scene": str(self._scene), "repeats": self._repeats if timed else 0, "patience": self._patience}
        return Job(self._folder.work / name, {**spec, **more})

    def _load(self, job: Job, built: Built) -> Run:
        facts = json.loads(job.path.with_suffix(".result").read_bytes())
        if "error" in facts:
            return Run(facts, None)
        return Run(facts, State.load(job.path.with_suffix(".npz"), facts, built.data))
