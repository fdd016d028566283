"""One study from runs to files."""

from __future__ import annotations

import copy
import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import _core
from clothsim._nearest import one_of
from clothsim.errors import InvalidInput
from clothsim.scene import Scene
from clothsim.study import evaluate, machine, outputs
from clothsim.study.axes import RUN_AXES, Axis, apply, axis, value_text
from clothsim.study.closed_forms import ClosedForm, find
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.metrics import Metric, metrics
from clothsim.study.points import Settings, check_contact, check_each, check_values, product
from clothsim.study.reference import Reference, by_refinement, exact, failed
from clothsim.study.resolution import counted
from clothsim.study.result import COSTS, Study
from clothsim.study.runner import Run, Runner
from clothsim.study.work import kept

__all__ = ["Request", "based", "run"]

_REFERENCES = ("auto", "closed-form", "finest")


class Request:
    """What a study is asked for, checked.

    Parameters
    ----------
    scene : Scene
        What to study.
    vary : mapping of str to sequence, or sequence of Axis
        Values by axis.
    metric, fixed, reference, cost, sample, seeds, …
        As for `clothsim.study.run`.

    Raises
    ------
    InvalidInput
        Nothing varies, an axis, a value, a metric or a choice is not known.
    """

    def __init__(
        self,
        scene: Scene,
        vary: Mapping[str, Any] | Sequence[Axis],
        metric: str | Sequence[str] | None = None,
        *,
        fixed: Mapping[str, Any] | None = None,
        reference: str = "auto",
        cost: str = "seconds",
        sample: int | None = None,
        seeds: int = 1,
        seed: int = 0,
        disturbance: float = 1e-3,
        repeats: int = 3,
        patience: float = 60.0,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: expected a clothsim.Scene, got {type(scene).__name__}")
        self.scene = scene
        self.fixed = dict(fixed or {})
        self.base = based(scene, self.fixed)
        axes = [axis(n, v) for n, v in vary.items()] if isinstance(vary, Mapping) else list(vary)
        self.axes = [
            axis(a.name, [counted(self.base, v) for v in a.values]) if a.key == "resolution" else a for a in axes
        ]
        check_contact(self.base, self.axes)
        check_each(self.base, self.axes)
        self.points = product(self.axes, sample, seed)
        names = [metric] if isinstance(metric, str) else list(metric or (["drape"] if seeds > 1 else ["rms"]))
        self.metrics = metrics(names)
        self.reference = one_of("reference", reference, _REFERENCES)
        self.cost = one_of("cost", cost, tuple(COSTS))
        for name, count, least in (("seeds", seeds, 1), ("repeats", repeats, 1)):
            if not isinstance(count, int) or count < least:
                raise InvalidInput(f"{name}: expected a whole number ≥ {least}, got {count!r}", name=name)
        if seeds > 1 and (wrong := [m.name for m in self.metrics if m.kind == "distance"]):
            expected = "metrics that do not compare positions, such as drape or lowest"
            raise InvalidInput(
                f"seeds: expected {expected}, as every seed ends elsewhere; got {', '.join(wrong)}", name="metric"
            )
        self.seeds, self.seed, self.disturbance = seeds, seed, float(disturbance)
        self.repeats, self.patience = repeats, float(patience)
        check_values(self.base, self.axes, self.points)

    @property
    def digest(self) -> str:
        """Fingerprint of all that results depend on."""
        what = [
            _core.__version__, self.base, [a.facts() for a in self.axes], self.points, [m.name for m in self.metrics],
            self.reference, self.cost, self.seeds, self.seed, self.disturbance, self.repeats,
        ]  # fmt: skip
        arrays = [
            repr((name, getattr(a, "shape", None))).encode() + (a.tobytes() if isinstance(a, np.ndarray) else b"")
            for group in self.scene.assets()
            for name, held in sorted(group.items())
            for a in (held if isinstance(held, tuple) else (held,))
        ]
        return fingerprint(what, b"".join(arrays))


def based(scene: Scene, fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of the scene with what is set for all runs, checked."""
    data = copy.deepcopy(scene.to_dict())
    axes = [axis(name, [value]) for name, value in fixed.items()]
    check_contact(data, axes)
    for only, (name, value) in zip(axes, fixed.items(), strict=True):
        if only.key in RUN_AXES:
            raise InvalidInput(f"set: {name} is no part of a scene; vary it", name=name)
        apply(data, only.key, value)
    checked: dict[str, Any] = json.loads(_core.Scene.from_json(json.dumps(data)).to_json())
    return checked


def run(
    request: Request,
    out: Path | None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    processes: int | None = None,
    limit: float | None = None,
    progress: bool = True,
    command: str = "",
) -> Study | dict[str, Any]:
    """Run a study into a folder; returns the facts of one that was complete already."""
    started = time.monotonic()
    digest = request.digest

    def make(folder: StudyFolder) -> Study:
        study = _measured(request, folder, processes, limit, progress=progress)
        return replace(study, command=command, digest=digest, out=out, seconds=time.monotonic() - started)

    def write(study: Study, out: Path) -> Study:
        return replace(study, files=outputs.write(study, out))

    return kept(StudyFolder, out, digest, make, write, check=outputs.check_packages, resume=resume, overwrite=overwrite)


def _measured(
    request: Request, folder: StudyFolder, processes: int | None, limit: float | None, *, progress: bool
) -> Study:
    from clothsim._progress import progress_bar

    runner = Runner(
        request.scene, request.base, request.axes, folder, seeds=request.seeds, seed=request.seed,
        disturbance=request.disturbance, repeats=request.repeats, patience=request.patience, processes=processes,
        limit=limit,
    )  # fmt: skip
    where = machine.facts()
    bar = progress_bar(len(request.points) * runner.per_point, enabled=progress, name="runs", unit="run")
    try:
        runs = runner.run(request.points, bar.update)
        references = _references(request, runner, runs, bar)
    finally:
        bar.close()
    rows = [
        evaluate.row(settings, own, request.metrics, _of(references, settings))
        for settings, own in zip(request.points, runs, strict=True)
    ]
    return evaluate.study(request, rows, references, where, runner.per_point)


def _of(references: Sequence[tuple[Settings, Reference]], settings: Settings) -> Reference:
    return next(r for problem, r in references if all(settings[k] == v for k, v in problem.items()))


def _references(
    request: Request, runner: Runner, runs: Sequence[Sequence[Run]], bar: Any
) -> list[tuple[Settings, Reference]]:
    """One reference per combination of the axes that change what is asked."""
    physical = [a.name for a in request.axes if not a.numerical]
    problems: dict[str, Settings] = {}
    for settings in request.points:
        own = {name: settings[name] for name in physical}
        problems.setdefault(value_text(own), own)
    needed = any(m.needs_reference for m in request.metrics)
    out = []
    for problem in problems.values():
        if not needed:
            out.append((problem, Reference("none", "not needed: every metric is an error by itself")))
            continue
        same = [k for k, settings in enumerate(request.points) if all(settings[n] == problem[n] for n in physical)]
        out.append((problem, _reference(request, runner, problem, [runs[k] for k in same], bar)))
    return out


def _reference(
    request: Request, runner: Runner, problem: Settings, own: Sequence[Sequence[Run]], bar: Any
) -> Reference:
    if request.reference != "finest":
        closed = _closed(own, request.metrics, sure=request.reference == "closed-form")
        if closed is not None:
            return exact(closed, request.metrics)
        if request.reference == "closed-form":
            return failed("no closed form is known for this scene, or its runs do not come to the state it is about")

    def more() -> None:
        bar.total += 1
        bar.update()

    return by_refinement(runner, problem, request.axes, request.metrics, more)


def _closed(own: Sequence[Sequence[Run]], wanted: Sequence[Metric], *, sure: bool) -> ClosedForm | None:
    """The closed form of a problem, unless most of its runs have not come to the state that it is about."""
    states = [run.state for runs in own for run in runs if run.state is not None]
    closed = find(states[0]) if states and any(m.needs_reference for m in wanted) else None
    if closed is None:
        return None
    met = sum(closed.target(state) is not None for state in states)
    return closed if met == len(states) or (sure and met) or met > math.ceil(0.5 * len(states)) else None
