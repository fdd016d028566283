"""A study as CSV, JSON, Markdown and text."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import Any

from clothsim.study.axes import value_text
from clothsim.study.points import label
from clothsim.study.quantities import amount
from clothsim.study.result import COSTS, Row, Study

__all__ = ["csv_text", "facts", "json_text", "markdown", "summary"]


def csv_text(study: Study) -> str:
    """One line per point, failed ones included."""
    names = [axis.name for axis in study.axes]
    measured = [f"{m.name}{end}" for m in study.metrics for end in ("", "_error", "_reference_error", "_spread")]
    columns = ["seconds", "cpu_seconds", "spread", "repeats", "peak_bytes", "state_bytes"]
    counts = ["steps", "substeps", "retries", "not_converged", "linear_iterations"]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([*names, *measured, *columns, *counts, "on_front", "status", "notes"])
    for k, row in enumerate(study.rows):
        cells: list[Any] = [_plain(row.settings[name]) for name in names]
        for m in study.metrics:
            value = row.values.get(m.name)
            own = study.own_error(row, m.name) if value and value.error is not None else None
            cells += [None] * 4 if value is None else [value.value, value.error, own, value.spread]
        cells += [getattr(row, column) if row.error is None else None for column in columns]
        cells += [row.totals.get(count) for count in counts]
        cells += [int(k in study.front), row.error or "ok", "; ".join(row.notes)]
        writer.writerow([_cell(cell) for cell in cells])
    return buffer.getvalue()


def _plain(value: Any) -> Any:
    return value if isinstance(value, (int, float, str)) else value_text(value)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def facts(study: Study) -> dict[str, Any]:
    """Everything, with nothing that JSON does not hold."""
    return dict(_finite(study.facts()))


def json_text(study: Study) -> str:
    """Everything."""
    return json.dumps(facts(study), indent=1, ensure_ascii=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _errors(study: Study, row: Row) -> list[str]:
    out = []
    for m in study.metrics:
        value = row.values.get(m.name)
        if value is None or value.value is None:
            out.append("–")
            continue
        text = amount(value.value, m.unit)
        if value.spread is not None:
            text += f" ± {amount(value.spread, m.unit)}"
        if m.kind == "quantity" and value.error is not None:
            text += f" (off by {amount(value.error, m.unit)})"
        if value.error is not None and not value.resolved and m.kind != "quantity":
            text = f"≤ {amount(max(value.error, study.own_error(row, m.name)), m.unit)}"
        out.append(text)
    return out


def markdown(study: Study) -> str:
    """A page: what was done, what came of it, how far to trust it."""
    lines = [f"# Study of {study.name}", ""]
    lines += ["```sh", study.command, "```", ""] if study.command else []
    lines += ["![work and precision](study.png)", ""]
    lines += [*(f"- {line}" for line in study.statement), ""]
    best = study.best()
    if best:
        words = COSTS[study.cost][1]
        lines += [f"## The front: {study.metric.name} over {words}", ""]
        lines += _table(study, [(str(n), row) for n, row in enumerate(best, start=1)])
    if study.orders:
        lines += ["", "## Measured orders", "", "| along | at | order |", "|---|---|---|"]
        lines += [f"| {o.axis} | {label(o.settings) or '–'} | {o.order:.2f} |" for o in study.orders]
    lines += ["", "## All points", ""]
    lines += _table(study, [("●" if k in study.front else "", row) for k, row in enumerate(study.rows)])
    where = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in study.machine.items() if v is not None)
    lines += ["", f"{len(study.rows)} points of {study.duration:g} s in {study.seconds:.0f} s. {where}."]
    return "\n".join(lines) + "\n"


def _table(study: Study, rows: list[tuple[str, Row]]) -> list[str]:
    names = [axis.name for axis in study.axes]
    titles = ["", *names, *(m.name for m in study.metrics), "time", "spread", "processor", "peak memory", "notes"]
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for mark, row in rows:
        cells = [mark, *(value_text(row.settings[name]) for name in names)]
        if row.error is not None:
            cells += ["–"] * (len(study.metrics) + 4) + [row.error.replace("|", "\\|").replace("\n", " ")]
        else:
            spread = "–" if row.spread is None else f"{100 * row.spread:.0f} %"
            cells += [
                *_errors(study, row), amount(row.seconds, "s"), spread, amount(row.cpu_seconds, "s"),
                amount(row.peak_bytes, "B"), "; ".join(row.notes),
            ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def summary(study: Study) -> str:
    """A few lines for a terminal."""
    failures = sum(row.error is not None for row in study.rows)
    lines = [f"{study.name}: {len(study.rows)} points in {study.seconds:.1f} s"]
    if failures:
        lines[0] += f", {failures} failed"
    lines += [f"  {line}" for line in study.statement]
    if study.front:
        lines.append(f"  front of {study.metric.name} over {COSTS[study.cost][1]}:")
        width = max(len(row.label) for row in study.best())
        for n, row in enumerate(study.best(), start=1):
            cost = amount(getattr(row, study.cost), COSTS[study.cost][0])
            lines.append(f"    {n:>2}  {row.label:<{width}}  {cost:>9}  {_errors(study, row)[0]}")
    for o in study.orders:
        at = f" ({label(o.settings)})" if o.settings else ""
        lines.append(f"  order in {o.axis}: {o.order:.2f}{at}")
    lines += [f"  {path}" for path in study.files]
    return "\n".join(lines)
