"""The search for settings that meet a bound: what is tried, in which order, and against what it is judged."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from clothsim.errors import InvalidInput
from clothsim.study import evaluate
from clothsim.study.axes import axis
from clothsim.study.job import Request
from clothsim.study.points import Settings, label
from clothsim.study.reference import Reference, by_refinement, exact, failed
from clothsim.study.result import COSTS, Row
from clothsim.study.runner import Runner

__all__ = ["SHARE", "Goal", "Search", "look", "own_error"]

# The reference may be off by this share of the bound; it is refined up to so often.
SHARE, _DEEPER = 0.1, 5
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


class Search:
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

    def met(self, other: Settings, dt: float) -> bool:
        """Whether the row at a step was run and meets the goal."""
        row = self.rows.get(label({**other, self.dt.name: dt}))
        return row is not None and self.meets(row)

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


def look(search: Search) -> None:
    """Find candidates and a reference that can judge them."""
    goal, steps = search.goal, sorted((float(v) for v in search.dt.values), reverse=True)
    if goal.error is not None:
        _refer(search, steps, SHARE * goal.error)
        if search.reference.kind == "none" and search.metric.needs_reference:
            return
    alive = list(range(len(search.others)))
    gaps: dict[int, tuple[float, float]] = {}
    for before, step in zip([math.nan, *steps[:-1]], steps, strict=True):
        if not alive:
            break
        rows = search.try_all([{**search.others[k], search.dt.name: step} for k in alive])
        kept = []
        cheapest = min((search.cost(r) for r in search.rows.values() if search.meets(r)), default=math.inf)
        for k, row in zip(alive, rows, strict=True):
            if goal.error is not None:
                if search.meets(row):
                    if math.isfinite(before):
                        gaps[k] = (step, before)
                elif not (search.cost(row) >= cheapest and row.error is None):
                    kept.append(k)
            elif row.error is not None or search.meets(row):
                kept.append(k)
            elif math.isfinite(before) and search.met(search.others[k], before):
                gaps[k] = (before, step)
        alive = kept
    _bisect(search, gaps)
    if goal.error is None and search.metric.needs_reference:
        _refer_to_best(search, steps)


def _bisect(search: Search, gaps: dict[int, tuple[float, float]]) -> None:
    """Halve the gaps between a step that meets the goal and a neighbour that does not."""
    for _ in range(_BISECTIONS if gaps else 0):
        tried = {k: float(f"{math.sqrt(good * bad):.4g}") for k, (good, bad) in gaps.items()}
        rows = search.try_all([{**search.others[k], search.dt.name: dt} for k, dt in tried.items()])
        for (k, dt), row in zip(tried.items(), rows, strict=True):
            good, bad = gaps[k]
            gaps[k] = (dt, bad) if search.meets(row) else (good, dt)


def _refer(search: Search, steps: Sequence[float], enough: float) -> None:
    """Refine the reference until its own error is small enough, or steps are as small as they get."""
    if _closed(search) or not search.metric.needs_reference:
        return
    name = search.metric.name
    for depth in range(_DEEPER):
        finest = steps[min(len(steps) - 1, 3 + 2 * depth)]
        axes = [axis(a.name, [finest]) if a.key == "time.dt" else a for a in search.request.axes]
        found = by_refinement(search.runner, {}, axes, search.request.metrics, search.progress)
        if (
            found.kind != "none" and own_error(found, name) < own_error(search.reference, name)
        ) or search.reference.kind == "none":
            search.reference = found
        if own_error(search.reference, name) <= enough or finest <= steps[-1]:
            return


def own_error(reference: Reference, name: str) -> float:
    """How far a reference may be off; infinite where that is not known."""
    own = reference.errors.get(name)
    return math.inf if own is None else own


def _refer_to_best(search: Search, steps: Sequence[float]) -> None:
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
        enough = SHARE * min((e for e in errors if e), default=0.0)
        if not enough or own_error(search.reference, search.metric.name) <= enough:
            return


def _closed(search: Search) -> bool:
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
