"""What errors are measured against, and how far that is to be trusted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clothsim.errors import ClothSimError, InvalidInput
from clothsim.study.axes import Axis, axis
from clothsim.study.closed_forms import ClosedForm
from clothsim.study.metrics import Metric
from clothsim.study.points import Settings, label
from clothsim.study.resolution import refined
from clothsim.study.runner import Run, Runner
from clothsim.study.state import State

__all__ = ["Reference", "by_refinement", "exact", "failed", "measure"]

# Order of convergence in time, for the choice of a reference; among equals Newton's method first.
_ORDERS = {"rk4": 4, "midpoint": 2, "implicit-newton": 1, "implicit-euler": 1, "semi-implicit": 1, "explicit-euler": 1}
_FINER_TOLERANCE, _FLOOR = 0.1, 1e-14
# The time step of the reference, and of the run that tells its error, over the finest of the study: for a method of
# first order the finest point is then off by three times the reference's own error.
_FINER_STEP, _BEFORE = 0.25, 0.5


@dataclass(frozen=True, eq=False)
class Reference:
    """What the runs of one problem are compared with.

    Attributes
    ----------
    kind : {"closed-form", "finest run", "none"}
        What it is.
    statement : str
        In words.
    states : list of State
        Its runs by seed; empty for a closed form.
    closed : ClosedForm or None
        The exact answer.
    values, errors : dict
        By metric: its own value (quantities), and how far it may be off.
    settings : dict
        Of the run.
    """

    kind: str
    statement: str
    states: list[State] = field(default_factory=list)
    closed: ClosedForm | None = None
    values: dict[str, float | None] = field(default_factory=dict)
    errors: dict[str, float | None] = field(default_factory=dict)
    settings: Settings = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "kind": self.kind, "statement": self.statement, "settings": self.settings, "values": self.values,
            "own_errors": self.errors,
        }  # fmt: skip


def measure(metric: Metric, runs: Sequence[State], reference: Reference) -> tuple[list[float], list[float]]:
    """Values of a metric by seed, and of the same quantity in the exact answer where that depends on the run."""
    values, exact_values = [], []
    for run in runs:
        if metric.kind == "distance":
            there = reference.closed.reference(run) if reference.closed else next(iter(reference.states), None)
            value = None if there is None else metric.measure(run, there)
        else:
            value = metric.measure(run)
            if metric.kind == "quantity" and reference.closed:
                there = reference.closed.reference(run)
                if there is not None and (own := metric.measure(there)) is not None:
                    exact_values.append(own)
        if value is not None and math.isfinite(value):
            values.append(value)
    return values, exact_values


def exact(closed: ClosedForm, metrics: Sequence[Metric]) -> Reference:
    """A closed form as the reference."""
    errors: dict[str, float | None] = {m.name: closed.error for m in metrics if m.kind == "distance"}
    errors |= {m.name: 0.0 for m in metrics if m.kind == "quantity"}
    return Reference("closed-form", closed.statement, closed=closed, errors=errors)


def failed(reason: str) -> Reference:
    """No reference."""
    return Reference("none", reason)


def by_refinement(
    runner: Runner, problem: Settings, axes: Sequence[Axis], metrics: Sequence[Metric], progress: Callable[[], None]
) -> Reference:
    """Run a problem finer than every point of the study, and again without each refinement.

    Along every varied axis that refines, the reference lies beyond the finest value: a quarter of the time step, a
    tenth of the tolerance, twice the cells. Its own error is estimated by how far the last halving (or tenth) moved it,
    summed over the axes: for a method of first order and a factor of two that is the error that is left, for higher
    orders it is more than that. Where no such axis is varied the time step is refined.
    """
    reasons = []
    for settings, before in _candidates(runner, problem, axes):
        whole = runner.run([settings, *before.values()], progress, timed=False)
        bad = next((run.error for runs in whole for run in runs if run.error), None)
        if bad is not None:
            reasons.append(f"{label(settings)}: {bad}")
            continue
        return _judged(settings, whole[0], dict(zip(before, whole[1:], strict=True)), metrics)
    return failed("the reference could not be run: " + "; ".join(reasons))


def _candidates(runner: Runner, problem: Settings, axes: Sequence[Axis]) -> list[tuple[Settings, dict[str, Settings]]]:
    """Settings of references, best first, each with those that lack one refinement, by axis."""
    all_axes = list(axes)
    if not any(a.refines for a in axes):
        time = runner.base["time"]
        step = axis("dt_tolerance", [time["dt_tolerance"]]) if time["dt"] == "auto" else axis("dt", [time["dt"]])
        all_axes.append(step)
        runner.axes = [a for a in runner.axes if a.key != step.key] + [step]
    chosen: list[tuple[Settings, dict[str, Settings]]] = []
    for integrator in _integrators(axes):
        finest: Settings = dict(problem)
        for a in all_axes:
            if a.name in problem:
                continue
            if a.key == "time.integrator":
                finest[a.name] = integrator
            else:
                finest[a.name] = a.finest() if a.refines else _usual(runner, a)
        settings = dict(finest)
        steps: dict[str, Any] = {}
        for a in all_axes:
            if a.refines:
                try:
                    steps[a.name] = _finer(runner, a, finest)
                except ClothSimError:
                    continue
        settings.update(steps)
        before = {a.name: {**settings, a.name: _before(a, finest)} for a in all_axes if a.name in steps}
        chosen.append((settings, before))
    return chosen


def _integrators(axes: Sequence[Axis]) -> list[Any]:
    for a in axes:
        if a.key == "time.integrator":
            rank = list(_ORDERS)
            return sorted(a.values, key=lambda v: (-_ORDERS.get(v, 0), rank.index(v) if v in rank else len(rank)))
    return [None]


def _usual(runner: Runner, a: Axis) -> Any:
    """The scene's own value of an axis if it is varied over, else the first; the better precision."""
    if a.key == "precision":
        return max(a.values)
    at: Any = runner.base
    for step in a.key.split("."):
        at = at.get(step) if isinstance(at, dict) else None
    return at if at in a.values else a.values[0]


def _finer(runner: Runner, a: Axis, finest: Settings) -> Any:
    if a.key == "resolution":
        return refined(runner.built(finest).data)
    if finest[a.name] == "auto":
        raise InvalidInput(f'{a.name}: expected a number to refine, got "auto"', name=a.name, got="auto")
    value = float(finest[a.name])
    return _FINER_STEP * value if a.key == "time.dt" else max(_FINER_TOLERANCE * value, _FLOOR)


def _before(a: Axis, finest: Settings) -> Any:
    """The value that the last refinement of the reference began from."""
    return _BEFORE * float(finest[a.name]) if a.key == "time.dt" else finest[a.name]


def _judged(
    settings: Settings, runs: Sequence[Run], before: dict[str, Sequence[Run]], metrics: Sequence[Metric]
) -> Reference:
    states = [run.state for run in runs if run.state is not None]
    reference = Reference("finest run", "", states=states, settings=settings)
    for metric in metrics:
        if not metric.needs_reference:
            continue
        values, _ = measure(metric, states, reference)
        moved = 0.0
        for others in before.values():
            coarser, _ = measure(metric, [run.state for run in others if run.state is not None], reference)
            if metric.kind == "distance":
                moved += float(np.mean(coarser)) if coarser else math.nan
            else:
                moved += abs(float(np.mean(coarser)) - float(np.mean(values))) if coarser and values else math.nan
        if metric.kind == "quantity":
            reference.values[metric.name] = float(np.mean(values)) if values else None
            if len(values) > 1:  # and what the mean over seeds is uncertain by
                moved += float(np.std(values, ddof=1) / np.sqrt(len(values)))
        reference.errors[metric.name] = moved if math.isfinite(moved) else None
    refinements = ", ".join(before)
    text = f"the run at {label(settings)}; its own error from runs without the last refinement of {refinements}"
    return Reference(reference.kind, text, states, None, reference.values, reference.errors, settings)
