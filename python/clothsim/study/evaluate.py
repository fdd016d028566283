"""Runs into rows, and rows into what a study says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.study import pareto
from clothsim.study.axes import Axis
from clothsim.study.metrics import Metric
from clothsim.study.points import Settings, label
from clothsim.study.reference import Reference, measure
from clothsim.study.result import Order, Row, Study, Value
from clothsim.study.runner import Run

if TYPE_CHECKING:
    from clothsim.study.job import Request

__all__ = ["orders", "row", "study"]

# An error is resolved if it is more than this many times the reference's own.
_RESOLVED = 2.0
# Axes along which errors have an order.
_MESH_AND_STEP = ("time.dt", "resolution")
# Wall-clock over processor time of one thread, from which on a machine counts as busy.
_BUSY = 1.1


def row(settings: Settings, runs: Sequence[Run], metrics: Sequence[Metric], reference: Reference) -> Row:
    """Make the row of a point from its runs by seed."""
    bad = next((run for run in runs if run.error), None)
    states = [run.state for run in runs if run.state is not None]
    if bad is not None:
        return Row(settings, error=bad.error)
    walls = [w for run in runs for w in run.facts["walls"]]
    cpus = [c for run in runs for c in run.facts["cpus"]]
    values, notes = {}, []
    for metric in metrics:
        values[metric.name] = value = _value(metric, states, reference)
        if value.value is None:
            notes.append(f"no {metric.name}: {_why(metric, reference)}")
    totals: dict[str, Any] = {}
    for run in runs:
        for key, n in run.facts["totals"].items():
            if n is not None and key != "wall_seconds":
                if key.startswith(("max", "largest")):
                    totals[key] = max(totals.get(key, 0), n)
                elif key.startswith("smallest"):
                    totals[key] = min(totals.get(key, n), n)
                else:
                    totals[key] = totals.get(key, 0) + n
    if totals.get("retries"):
        notes.append(f"steps retried with a smaller one: {totals['retries']}")
    if totals.get("not_converged"):
        notes.append(f"steps that met a cap before their tolerance: {totals['not_converged']}")
    if found := max(run.facts["intersections"] for run in runs):
        notes.append(f"pairs of triangles that pass through each other at the end: {found}")
    totals["disturbed"] = sum(run.facts["disturbed"] for run in runs)
    if any(run.facts.get("repeatable") is False for run in runs):
        notes.append("repeats did not end with the same bits")
    median = float(np.median(walls)) if walls else None
    return Row(
        settings, None, values, median, float(np.median(cpus)) if cpus else None,
        (max(walls) - min(walls)) / median if median and len(walls) > 1 else None, len(walls),
        max(run.facts["peak_bytes"] for run in runs), max(run.facts["state_bytes"] for run in runs), totals, notes,
    )  # fmt: skip


def _value(metric: Metric, states: Sequence[Any], reference: Reference) -> Value:
    if metric.kind == "distance" and reference.kind == "none":
        return Value(None, None)
    values, exact = measure(metric, states, reference)
    if not values:
        return Value(None, None)
    mean = float(np.mean(values))
    spread = float(np.std(values, ddof=1)) if len(values) > 1 else None
    error: float | None = mean
    if metric.kind == "quantity":
        there = float(np.mean(exact)) if exact else reference.values.get(metric.name)
        error = None if there is None else abs(mean - there)
    own = reference.errors.get(metric.name) if metric.needs_reference else 0.0
    uncertain = 0.0 if spread is None else spread / math.sqrt(len(values))
    resolved = error is not None and own is not None and error > _RESOLVED * (own + uncertain)
    return Value(mean, error, spread, resolved or not metric.needs_reference, uncertain)


def _why(metric: Metric, reference: Reference) -> str:
    if metric.needs_reference and reference.kind == "none":
        return "there is no reference"
    if reference.kind == "closed-form" and metric.kind == "distance":
        return "the run has not come to rest"
    return "the scene has no such number"


def study(
    request: Request,
    rows: list[Row],
    references: list[tuple[Settings, Reference]],
    machine: dict[str, Any],
    per_point: int,
) -> Study:
    """Put together what a study says."""
    metric = request.metrics[0]
    made = Study(
        str(request.base["name"]), request.axes, request.fixed, request.metrics, request.cost, rows, references, [], [],
        True, [], machine, "", "", float(request.base["duration"]), per_point=per_point,
    )  # fmt: skip
    known = [
        (k, getattr(r, request.cost), max(r.values[metric.name].error or 0.0, made.own_error(r)))
        for k, r in enumerate(rows)
        if r.error is None and r.values[metric.name].error is not None and getattr(r, request.cost)
    ]
    chosen = pareto.front([c for _, c, _ in known], [e for _, _, e in known])
    converged, statement = _statement(made)
    return replace(
        made, front=[known[k][0] for k in chosen], orders=orders(made), converged=converged, statement=statement
    )


def orders(made: Study) -> list[Order]:
    """Order along the time step and the resolution, where all other settings are equal."""
    name, out = made.metric.name, []
    for axis in made.axes:
        if axis.key not in _MESH_AND_STEP or not axis.is_number or len(axis.values) < 2 or made.per_point > 1:
            continue
        groups: dict[str, tuple[Settings, dict[float, float], float]] = {}
        for r in made.rows:
            if r.error is not None or r.values[name].error is None:
                continue
            others = {k: v for k, v in r.settings.items() if k != axis.name}
            _, errors, _ = groups.setdefault(label(others), (others, {}, made.own_error(r)))
            errors[_step(axis, r.settings[axis.name])] = float(r.values[name].error or 0.0)
        for others, errors, floor in groups.values():
            order = pareto.order(errors, floor) if len(errors) > 1 else None
            if order is not None:
                out.append(Order(axis.name, others, order))
    return out


def _step(axis: Axis, value: Any) -> float:
    """What goes to zero: the value itself, or the length of a cell in units of the cloth's."""
    return float(value) if axis.refines < 0 else 1.0 / max(1e-12, float(value) - 1.0)


def _statement(made: Study) -> tuple[bool, list[str]]:
    """Whether the references can be trusted, and what is to be known before reading a number."""
    name, unit = made.metric.name, made.metric.unit
    lines, converged = [], True
    for problem, reference in made.references:
        what = f"{label(problem)}: " if problem else ""
        rows = [r for r in made.rows if r.error is None and all(r.settings[k] == v for k, v in problem.items())]
        errors = [v.error for r in rows if (v := r.values[name]).error is not None]
        if reference.kind == "none":
            if made.metric.needs_reference:
                converged = False
                lines.append(f"{what}NO REFERENCE: {reference.statement}; there are times and no errors")
            continue
        lines.append(f"{what}the reference is {reference.statement}.")
        own = reference.errors.get(name)
        if not made.metric.needs_reference or not errors:
            continue
        if own is None:
            converged = False
            lines.append(f"{what}THE REFERENCE'S OWN ERROR COULD NOT BE ESTIMATED: errors below are not to be trusted.")
            continue
        resolved = sum(r.values[name].resolved for r in rows if r.values[name].error is not None)
        lines.append(
            f"Its own error in {name} is {own:.2g} {unit}; {resolved} of {len(errors)} errors are above it twice."
        )
        if resolved < 0.5 * len(errors) and made.per_point > 1:
            lines.append(f"{what}Most means differ by no more than they are uncertain by; more seeds would tell more.")
        elif resolved < 0.5 * len(errors):
            converged = False
            lines.append(
                f"{what}THE REFERENCE HAS NOT CONVERGED: most errors are no larger than its own. Refine further."
            )
    if len(made.references) > 1:
        lines.append("Every error is against the answer of its own problem; the front is over all of them.")
    failures = [r for r in made.rows if r.error is not None]
    if failures:
        lines.append(f"{len(failures)} of {len(made.rows)} points could not be run; the table says why.")
    waits = [r.seconds / r.cpu_seconds for r in made.rows if r.seconds and r.cpu_seconds]
    if waits and float(np.median(waits)) > _BUSY and all(a.key != "threads" for a in made.axes):
        lines.append(
            "The machine was busy with other work: half of the points waited for a core for "
            f"{100 * (1 - 1 / float(np.median(waits))):.0f} % of their time or more. Processor time leaves that out."
        )
    if made.per_point > 1:
        lines.append(f"Means over {made.per_point} seeded disturbances of the start; the spread is over them.")
    return converged, lines
