"""The cheapest settings that meet a bound, with the evidence."""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from clothsim._files import write_whole
from clothsim.errors import InvalidInput, OutputExists
from clothsim.scene import Scene
from clothsim.study import evaluate, machine, outputs
from clothsim.study.axes import Axis, apply, axis, variant
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.job import Request, based, study_folder
from clothsim.study.points import Settings, label
from clothsim.study.quantities import amount
from clothsim.study.reference import Reference, by_refinement, exact, failed
from clothsim.study.result import COSTS, Row, Study
from clothsim.study.runner import Runner

__all__ = ["Goal", "Tuned", "tune"]

_INTEGRATORS = ("implicit-euler", "implicit-newton", "midpoint", "rk4", "explicit-euler")
# Time steps tried: the scene's own times 4, down to 4/2^11 of it.
_COARSEST, _LEVELS = 4.0, 12
# The reference may be off by this share of the bound; it is refined up to so often.
_SHARE, _DEEPER = 0.1, 5
# Halvings of the gap between the last step that fails a bound and the first that meets it.
_BISECTIONS = 2


@dataclass(frozen=True)
class Goal:
    """What settings have to meet: an error, or a time for each frame (or for the whole run).

    Attributes
    ----------
    error : float or None
        Largest error, in the unit of the metric; the reference's own is added to what was measured.
    budget : float or None
        Most seconds.
    per : {"frame", "run"}
        What the budget is for; a frame lasts 1/``output.fps``.
    """

    error: float | None = None
    budget: float | None = None
    per: str = "frame"

    def __post_init__(self) -> None:
        if (self.error is None) == (self.budget is None):
            raise InvalidInput("tune: expected an error or a budget, one of them", name="error")
        bound = self.error if self.error is not None else self.budget
        if bound is None or not (math.isfinite(bound) and bound > 0.0):
            raise InvalidInput(f"tune: expected a bound > 0, got {bound}", name="error", got=str(bound))
        if self.per not in ("frame", "run"):
            raise InvalidInput(f'per: expected one of frame, run, got "{self.per}"', name="per", got=self.per)


@dataclass(frozen=True, eq=False)
class Tuned:
    """The settings found, and what speaks for them.

    Attributes
    ----------
    goal : Goal
        What was asked for.
    row : Row or None
        The settings chosen, with their error and time; None if none was found.
    again : Row or None
        The same, measured again from the scene that was written.
    met : bool
        Whether what was measured again meets the bound.
    scene : Scene or None
        The scene with these settings.
    study : Study
        All that was tried.
    statement : str
        In words.
    frames : float
        What a run's cost is divided by.
    """

    goal: Goal
    row: Row | None
    again: Row | None
    met: bool
    scene: Scene | None
    study: Study
    statement: str
    frames: float = 1.0
    files: list[Path] = field(default_factory=list)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "met": self.met, "statement": self.statement,
            "goal": {"error": self.goal.error, "budget": self.goal.budget, "per": self.goal.per},
            "chosen": None if self.row is None else self.row.facts(),
            "measured_again": None if self.again is None else self.again.facts(),
            "reference_own_error": None if self.row is None else self.study.own_error(self.row),
            "files": [str(path) for path in self.files],
        }  # fmt: skip


class _Search:
    """Candidates by level: every combination of the other axes, at one time step after the other."""

    def __init__(self, request: Request, runner: Runner, goal: Goal, progress: Callable[[], None]) -> None:
        self.request, self.runner, self.goal, self.progress = request, runner, goal, progress
        self.metric = request.metrics[0]
        self.rows: dict[str, Row] = {}
        self.reference = failed("not looked for yet")
        frames = max(1.0, float(request.base["duration"]) * float(request.base["output"]["fps"]))
        self.unit = COSTS[request.cost][0]
        self.frames = frames if goal.per == "frame" and self.unit == "s" else 1.0
        self.dt = next(a for a in request.axes if a.key == "time.dt")
        self.others: list[Settings] = []
        for point in request.points:
            other = {k: v for k, v in point.items() if k != self.dt.name}
            if other not in self.others:
                self.others.append(other)

    def cost(self, row: Row) -> float:
        """What a row costs: seconds per frame or run, or bytes."""
        value = getattr(row, self.request.cost)
        return math.inf if row.error is not None or value is None else value / self.frames

    def bound(self, row: Row) -> float:
        """What the error of a row is at most."""
        value = row.values.get(self.metric.name)
        if value is None or value.error is None:
            return math.inf
        return value.error + (self.reference.errors.get(self.metric.name) or 0.0)

    def meets(self, row: Row) -> bool:
        """Whether a row meets the goal."""
        if self.goal.error is not None:
            return self.bound(row) <= self.goal.error
        return self.goal.budget is not None and self.cost(row) <= self.goal.budget

    def try_all(self, points: Sequence[Settings]) -> list[Row]:
        """Run points that have not been run."""
        runs = self.runner.run(points, self.progress)
        rows = [evaluate.row(p, own, self.request.metrics, self.reference) for p, own in zip(points, runs, strict=True)]
        self.rows.update({label(p): row for p, row in zip(points, rows, strict=True)})
        return rows

    def judge_again(self) -> None:
        """Measure all rows against the reference there is by then."""
        self.try_all([row.settings for row in self.rows.values()])

    def best(self) -> Row | None:
        """The cheapest row that meets an error, or the most precise one within a budget."""
        good = [row for row in self.rows.values() if self.meets(row) and math.isfinite(self.bound(row))]
        key = self.cost if self.goal.error is not None else self.bound
        return min(good, key=lambda row: (key(row), self.cost(row)), default=None)


def tune(
    scene: Scene,
    goal: Goal,
    *,
    metric: str = "rms",
    vary: Sequence[Axis] = (),
    fixed: dict[str, Any] | None = None,
    reference: str = "auto",
    cost: str = "seconds",
    repeats: int = 3,
    patience: float = 60.0,
    processes: int | None = None,
    limit: float | None = None,
    progress: bool = True,
    out: Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    command: str = "",
) -> Tuned:
    """Find the cheapest settings whose error meets a bound, or the most precise ones within a budget of time.

    Every integrator (and combination of the other axes) is tried at time steps from coarse to fine, until it meets the
    bound or costs more than one that does; two halvings of the gap then find how coarse the step may be. The reference
    is refined until its own error is a tenth of the bound; what is compared with the bound is the sum of both.

    Raises
    ------
    InvalidInput
        An axis changes what is asked, or there is nothing to choose from.
    OutputExists, CheckpointError
        The folder holds a study already, or another one.
    """
    from clothsim.simulation import progress_bar

    started = time.monotonic()
    axes = _axes(based(scene, fixed or {}), vary)
    request = Request(
        scene, axes, metric, fixed=fixed, reference=reference, cost=cost, repeats=repeats, patience=patience
    )
    if goal.budget is not None and COSTS[cost][0] != "s":
        raise InvalidInput(f"cost: expected seconds or cpu_seconds for a budget, got {cost}", name="cost", got=cost)
    digest = fingerprint([request.digest, goal.error, goal.budget, goal.per])
    where = machine.facts()
    with study_folder(out) as folder:
        if out is not None:
            outputs.check_packages()
            if folder.begin(digest, resume=resume, overwrite=overwrite) is not None:
                raise OutputExists(f"{out}: holds these settings already; --overwrite finds them anew")
        with folder.locked():
            folder.claim(digest, overwrite=overwrite)
            runner = Runner(
                scene, request.base, request.axes, folder, repeats=repeats, patience=patience, processes=processes,
                limit=limit,
            )  # fmt: skip
            bar = progress_bar(0, enabled=progress, name="runs")
            bar.unit = "run"
            try:
                search = _Search(request, runner, goal, bar.update)
                _look(search)
                best = search.best()
                row, again, made = _confirmed(search, best, scene, request, out)
            finally:
                bar.close()
            rows = sorted(search.rows.values(), key=lambda r: [str(v) for v in r.settings.values()])
            study = evaluate.study(request, rows, [({}, search.reference)], where, 1)
            study = replace(study, command=command, digest=digest, out=out, seconds=time.monotonic() - started)
            met = again is not None and search.meets(again)
            statement = _statement(search, row, again, met=met)
            found = Tuned(goal, row, again, met, made, study, statement, search.frames)
            if out is not None:
                found = replace(found, files=_write(found, out))
                folder.remove_work()
    return found


def _write(found: Tuned, out: Path) -> list[Path]:
    """Write the evidence; the scene is there already."""
    scene = [out / "tuned.toml"] if found.scene is not None else []
    written = replace(found.study, statement=[found.statement, *found.study.statement])
    budget = None if found.goal.budget is None else found.goal.budget * found.frames
    files = [*scene, *outputs.write(written, out, (found.goal.error, budget)), out / "tune.json"]
    facts = json.dumps(replace(found, files=files).facts(), indent=1, ensure_ascii=False)
    write_whole(out / "tune.json", (facts + "\n").encode())
    return files


def _axes(base: dict[str, Any], vary: Sequence[Axis]) -> list[Axis]:
    for a in vary:
        if not a.numerical:
            raise InvalidInput(
                f"tune: expected axes that do not change what is asked, such as integrator, dt, resolution or "
                f"solver_tolerance, got {a.name}",
                name="vary",
                got=a.name,
            )
    axes = list(vary)
    keys = {a.key for a in axes}
    if "time.integrator" not in keys:
        own = base["time"]["integrator"]
        held = (base.get("contact") or {}).get("method") == "constraints"  # what only implicit schemes can do
        others = [i for i in _INTEGRATORS if i != own and (i.startswith("implicit") or not held)]
        axes.insert(0, axis("integrator", [own, *others]))
    if "time.dt" not in keys:
        dt, most = float(base["time"]["dt"]), float(base["duration"])
        steps = [dt * _COARSEST / 2**k for k in range(_LEVELS)]
        axes.append(axis("dt", [s for s in steps if s <= most]))
    return axes


def _look(search: _Search) -> None:
    """Find candidates and a reference that can judge them."""
    goal, steps = search.goal, sorted((float(v) for v in search.dt.values), reverse=True)
    if goal.error is not None:
        _refer(search, steps, _SHARE * goal.error)
        if search.reference.kind == "none" and search.metric.needs_reference:
            return
    alive = list(range(len(search.others)))
    met: dict[int, float] = {}
    for step in steps:
        if not alive:
            break
        rows = search.try_all([{**search.others[k], search.dt.name: step} for k in alive])
        kept = []
        cheapest = min((search.cost(r) for r in search.rows.values() if search.meets(r)), default=math.inf)
        for k, row in zip(alive, rows, strict=True):
            if goal.error is not None:
                if search.meets(row):
                    met[k] = step
                elif not (search.cost(row) >= cheapest and row.error is None):
                    kept.append(k)
            elif row.error is not None or search.meets(row):
                kept.append(k)
        alive = kept
    if goal.error is not None:
        _bisect(search, met, steps)
    elif search.metric.needs_reference:
        _refer_to_best(search, steps)


def _bisect(search: _Search, met: dict[int, float], steps: Sequence[float]) -> None:
    gaps = {k: (step, steps[steps.index(step) - 1]) for k, step in met.items() if steps.index(step) > 0}
    for _ in range(_BISECTIONS):
        if not gaps:
            return
        tried = {k: float(f"{math.sqrt(low * high):.4g}") for k, (low, high) in gaps.items()}
        rows = search.try_all([{**search.others[k], search.dt.name: dt} for k, dt in tried.items()])
        for (k, dt), row in zip(tried.items(), rows, strict=True):
            low, high = gaps[k]
            gaps[k] = (dt, high) if search.meets(row) else (low, dt)


def _refer(search: _Search, steps: Sequence[float], enough: float) -> None:
    """Refine the reference until its own error is small enough, or steps are as small as they get."""
    if _closed(search) or not search.metric.needs_reference:
        return
    name = search.metric.name
    for depth in range(_DEEPER):
        finest = steps[min(len(steps) - 1, 3 + 2 * depth)]
        axes = [axis(a.name, [finest]) if a.key == "time.dt" else a for a in search.request.axes]
        found = by_refinement(search.runner, {}, axes, search.request.metrics, search.progress)
        if (
            found.kind != "none" and _own(found, name) < _own(search.reference, name)
        ) or search.reference.kind == "none":
            search.reference = found
        if _own(search.reference, name) <= enough or finest <= steps[-1]:
            return


def _own(reference: Reference, name: str) -> float:
    own = reference.errors.get(name)
    return math.inf if own is None else own


def _refer_to_best(search: _Search, steps: Sequence[float]) -> None:
    """Refine the reference until it can tell the best of what is within the budget."""
    within = [row for row in search.rows.values() if search.meets(row)]
    if not within:
        return
    enough = 0.0
    for _ in range(2):
        _refer(search, steps, enough if enough else math.inf)
        search.judge_again()
        errors = [
            v.error for row in search.rows.values() if search.meets(row) and (v := row.values[search.metric.name])
        ]
        enough = _SHARE * min((e for e in errors if e), default=0.0)
        if not enough or _own(search.reference, search.metric.name) <= enough:
            return


def _closed(search: _Search) -> bool:
    """Take a closed form as the reference, if the scene has one that a run of its own settings comes to."""
    from clothsim.study.closed_forms import find

    if search.request.reference == "finest":
        return False
    own = {a.name: a.values[0] for a in search.request.axes}
    own[search.dt.name] = search.request.base["time"]["dt"]
    runs = search.runner.run([own], search.progress, timed=False)[0]
    closed = find(runs[0].state) if runs[0].state is not None else None
    if closed is None or runs[0].state is None or closed.target(runs[0].state) is None:
        return False
    search.reference = exact(closed, search.request.metrics)
    return True


def _confirmed(
    search: _Search, best: Row | None, scene: Scene, request: Request, out: Path | None
) -> tuple[Row | None, Row | None, Scene | None]:
    """Write the scene, read it again, and measure it anew, without any result from before."""
    for _ in range(3):
        if best is None:
            return None, None, None
        data = json.loads(json.dumps(request.base))
        for a in request.axes:
            apply(data, a.key, best.settings[a.name])
        made = variant(scene, data)
        path = None if out is None else out / "tuned.toml"
        if path is not None:
            made.save(path)
            made = Scene.load(path)
        with tempfile.TemporaryDirectory(prefix="clothsim-tune-") as name:
            folder = StudyFolder(Path(name))
            with folder.locked():
                runner = Runner(made, made.to_dict(), [], folder, repeats=request.repeats, patience=request.patience)
                again = evaluate.row({}, runner.run([{}], search.progress)[0], request.metrics, search.reference)
        if search.meets(again) or search.goal.error is not None:
            return best, again, made
        # Over the budget when measured again: the next best.
        del search.rows[label(best.settings)]
        best = search.best()
    return None, None, None


def _statement(search: _Search, row: Row | None, again: Row | None, *, met: bool) -> str:
    metric, goal = search.metric, search.goal
    own = _own(search.reference, metric.name) if metric.needs_reference else 0.0
    if goal.error is not None:
        wanted = f"{metric.name} ≤ {amount(goal.error, metric.unit)}"
    else:
        wanted = f"≤ {amount(goal.budget, 's')} per {goal.per}"
    if row is None or again is None:
        if search.reference.kind == "none" and metric.needs_reference:
            return f"{wanted}: no settings can be judged: {search.reference.statement}"
        if goal.error is not None and own > _SHARE * goal.error and metric.needs_reference:
            return (
                f"{wanted}: not found; the reference's own error is {amount(own, metric.unit)} at its finest. "
                "A scene that buckles or touches by chance has no single answer: try --metric shape or drape"
            )
        return f"{wanted}: no settings that were tried meet it"
    at = f"{amount(search.bound(again), metric.unit)} (the reference's own {amount(own, metric.unit)} included)"
    cost = amount(search.cost(again), search.unit) + (f" per {goal.per}" if search.unit == "s" else "")
    verdict = "" if met else " NOT MET when measured again"
    return f"{wanted}:{verdict} {row.label}, measured again: {metric.name} ≤ {at}, {cost}"
