"""Work and precision in a picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import Any

from clothsim._arrays import optional
from clothsim.reproduce.pictures import FAINT, INK, figure, tidy
from clothsim.study.axes import Axis, value_text
from clothsim.study.pareto import slopes
from clothsim.study.points import label
from clothsim.study.quantities import amount
from clothsim.study.result import COSTS, Row, Study

__all__ = ["draw"]

_COLOURS = ("#2f5d8c", "#9c2f35", "#c08a2e", "#3f7a57", "#7a5195", "#5aa0a8", "#c46f9b", "#8d8a84", "#a8a03c")
_MARKS = "os^Dv<>Ph*"
_MOST_NAMED = 12
# Lines of text beside the plots, and what an entry of the legend takes of them.
_LINES, _ENTRY = 27.5, 1.05
# Where numbers stand beside their points, in turn where points are close [pt].
_BESIDE = ((8, 7), (-16, -17), (-16, 8), (9, -17))


def draw(study: Study, error: float | None = None, cost: float | None = None) -> tuple[bytes, bytes]:
    """PNG and SVG: error over cost with the front, and error over what refines; lines at an error and a cost."""
    along = _along(study)
    steps = along is not None and any(_points(study, along, series) for series in _series(study, along))
    title = f"{study.name}: what accuracy costs"
    widths = [1.3, 1.1, 0.5] if steps else [1.3, 0.5]
    made = figure(title, (15.0 if steps else 10.0, 6.4), _note(study))
    axes = made.subplots(1, len(widths), width_ratios=widths)
    _work(axes[0], study, along)
    if steps and along is not None:
        _convergence(axes[1], study, along)
    if error is not None:
        axes[0].axhline(error, color=INK, lw=1, ls="--")
    if cost is not None:
        axes[0].axvline(cost, color=INK, lw=1, ls="--")
    _names(axes[-1], study, along)
    png, svg = io.BytesIO(), io.BytesIO()
    made.savefig(png, format="png", facecolor="white", metadata={"Software": None})
    made.savefig(svg, format="svg", facecolor="white", metadata={"Date": None})
    return png.getvalue(), svg.getvalue()


def _note(study: Study) -> str:
    where = study.machine
    fixed = ", ".join(f"{k} = {value_text(v)}" for k, v in study.fixed.items())
    parts = [f"{study.duration:g} s simulated" + (f" with {fixed}" if fixed else "")]
    parts.append(f"{where['processor']}, one process per core, medians")
    if any(not v.resolved for row in study.rows for k, v in row.values.items() if k == study.metric.name):
        parts.append("hollow: no larger than twice the reference's own error")
    if not study.converged:
        parts.append("THE REFERENCE IS NOT CONVERGED")
    return "; ".join(parts)


def _along(study: Study) -> Axis | None:
    """The axis whose values a line joins: the one that refines with most values."""
    fit = [a for a in study.axes if a.refines and a.is_number and len(a.values) > 1]
    return max(fit, key=lambda a: len(a.values), default=None)


def _series(study: Study, along: Axis | None) -> list[tuple[str, str, str, list[Row]]]:
    """Lines: name, colour by the first of the other axes, mark by the second, and rows in order."""
    others = [a for a in study.axes if a is not along]
    if along is None:  # points that no line joins go by the first axis, as far as there are colours
        others = others[:1] if len(others[0].values) <= len(_COLOURS) else []
    groups: dict[str, list[Row]] = {}
    for row in study.rows:
        name = label(row.settings, [a.name for a in others]) if others or along else "points"
        groups.setdefault(name, []).append(row)
    out = []
    for name, rows in groups.items():
        colour, mark = 0, 0
        if others:
            colour = _place(others[0], rows[0])
            mark = _place(others[1], rows[0]) if len(others) > 1 else colour
        own = sorted(rows, key=lambda r: float(r.settings[along.name])) if along else rows
        out.append((name, _COLOURS[colour % len(_COLOURS)], _MARKS[mark % len(_MARKS)], own))
    return out


def _place(axis: Axis, row: Row) -> int:
    return [value_text(v) for v in axis.values].index(value_text(row.settings[axis.name]))


def _error(study: Study, row: Row) -> float | None:
    if row.error is not None:
        return None
    error = row.values[study.metric.name].error
    return error if error else None


def _points(study: Study, along: Axis, series: tuple[str, str, str, list[Row]]) -> list[tuple[float, float]]:
    return [(float(r.settings[along.name]), e) for r in series[3] if (e := _error(study, r)) is not None]


def _work(axis: Any, study: Study, along: Axis | None) -> None:
    unit, words = COSTS[study.cost]
    for name, colour, mark, rows in _series(study, along):
        known = [(getattr(r, study.cost), e) for r in rows if (e := _error(study, r)) is not None]
        known = [(c, e) for c, e in known if c]
        if known:
            style = "-" if along else ""
            axis.plot(*zip(*known, strict=True), style + mark, color=colour, ms=5.5, lw=1.2, alpha=0.85, label=name)
        _hollow(axis, study, rows, colour, mark, lambda r: getattr(r, study.cost))
        for r in rows:  # over seeds: what the mean is uncertain by
            if (e := _error(study, r)) is not None and (own := r.values[study.metric.name].uncertain):
                axis.plot([getattr(r, study.cost)] * 2, [max(e - own, 0.01 * e), e + own], color=colour, lw=1.2)
    best = [(float(getattr(r, study.cost)), e) for r in study.best() if (e := _error(study, r)) is not None]
    most = _most_named(study, along)
    if best:
        axis.plot(*zip(*best, strict=True), "-", color=INK, lw=4.5, alpha=0.13, zorder=1, solid_capstyle="round")
        axis.plot(*zip(*best, strict=True), "o", mfc="none", mec=INK, ms=12, mew=1.4, zorder=4, label="front")
        turn = 0
        for n, (c, e) in enumerate(best, start=1):
            near = n > 1 and c < 1.25 * best[n - 2][0] and e > 0.4 * best[n - 2][1]
            turn = (turn + 1) % len(_BESIDE) if near else 0
            if _named(n - 1, len(best), most):
                axis.annotate(
                    str(n), (c, e), xytext=_BESIDE[turn], textcoords="offset points", fontsize=9.5, color=INK,
                    weight="bold",
                )  # fmt: skip
    _scales(axis, study)
    _floor(axis, study, left=True)
    tidy(axis, f"{_what(study)} over {words}", f"{words} [{unit}]", f"{_what(study)} [{study.metric.unit}]")


def _what(study: Study) -> str:
    """What the upright axis shows."""
    return ("error in " if study.metric.kind == "quantity" else "") + study.metric.name


def _hollow(axis: Any, study: Study, rows: list[Row], colour: str, mark: str, at: Callable[[Row], float]) -> None:
    """Points whose error the reference cannot tell."""
    for r in rows:
        if (e := _error(study, r)) is not None and not r.values[study.metric.name].resolved and at(r):
            axis.plot([at(r)], [e], mark, mfc="white", mec=colour, ms=5.5, zorder=3)


def _most_named(study: Study, along: Axis | None) -> int:
    """How many of the front are named in two lines each, above the legend."""
    return max(2, min(_MOST_NAMED, int((_LINES - _ENTRY * (1 + len(_series(study, along)))) // 2)))


def _named(k: int, count: int, most: int) -> bool:
    """Whether the k-th of the front is named: all, or ``most`` of them, evenly spread."""
    return count <= most or k in {round(j * (count - 1) / (most - 1)) for j in range(most)}


def _brief(study: Study, text: str) -> str:
    """A label without what the tables of an axis share: ``hinge (rigidity 1, damping 2)`` as ``hinge (damping 2)``."""
    pairs = []
    for axis in study.axes:
        tables = [v for v in axis.values if isinstance(v, Mapping)]
        for table in tables:
            head = value_text(table).split(" (")[0]
            alike = [t for t in tables if value_text(t).split(" (")[0] == head]
            own = {k: v for k, v in table.items() if str(v) == head or any(t.get(k) != v for t in alike)}
            pairs.append((value_text(table), value_text(own)))
    for long, short in sorted(pairs, key=lambda p: -len(p[0])):
        text = text.replace(long, short)
    return text


def _scales(axis: Any, study: Study) -> None:
    """Logarithmic axes with room around the points, and numbers that can be read."""
    seen = [e for row in study.rows if (e := _error(study, row)) is not None]
    if not axis.lines or not seen:
        axis.text(0.5, 0.5, "no errors: see the statement", transform=axis.transAxes, ha="center", color=FAINT)
        return
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.margins(x=0.08)
    axis.set_ylim(0.3 * min(seen), 3.5 * max(seen))
    low, high = axis.get_xlim()
    if high / low < 3e3:
        ticker = optional("matplotlib.ticker", extra="plot", purpose="drawing plots")
        subs = (1.0, 2.0, 5.0) if high / low < 60.0 else (1.0, 3.0)
        axis.xaxis.set_major_locator(ticker.LogLocator(subs=subs))
        axis.xaxis.set_major_formatter(ticker.FuncFormatter(lambda v, _: f"{v:g}"))
        axis.xaxis.set_minor_formatter(ticker.NullFormatter())


def _floor(axis: Any, study: Study, *, left: bool) -> None:
    """Shade what lies within the reference's own error; its name stands at the left or the right."""
    if len(study.references) > 1:
        return
    own = max((r.errors.get(study.metric.name) or 0.0 for _, r in study.references), default=0.0)
    low, high = axis.get_ylim()
    if own <= low or not any(_error(study, row) for row in study.rows):
        return
    axis.axhspan(low * 1e-3, own, color=FAINT, alpha=0.16, lw=0, zorder=0)
    axis.text(
        0.01 if left else 0.99, min(own, high), "the reference's own error", transform=axis.get_yaxis_transform(),
        fontsize=8.5, color=FAINT, ha="left" if left else "right", va="bottom" if own < 2.5 * low else "top",
    )  # fmt: skip
    axis.set_ylim(low, high)


def _convergence(axis: Any, study: Study, along: Axis) -> None:
    orders = {label(o.settings): o.order for o in study.orders if o.axis == along.name}
    others = [a.name for a in study.axes if a is not along]
    guided: set[int] = set()
    for series in _series(study, along):
        known = _points(study, along, series)
        if not known:
            continue
        _, colour, mark, rows = series
        axis.plot(*zip(*known, strict=True), "-" + mark, color=colour, ms=5.5, lw=1.2, alpha=0.85)
        _hollow(axis, study, rows, colour, mark, lambda r: float(r.settings[along.name]))
        order = orders.get(label(rows[0].settings, others))
        if order is not None and order > 0.5 and round(order) not in guided:
            guided.add(round(order))
            floor = 10.0 * study.own_error(rows[0])
            finest_first = known if along.refines < 0 else known[::-1]
            _guide(axis, [(h, e) for h, e in finest_first if e > floor], -along.refines * round(order))
    _scales(axis, study)
    _floor(axis, study, left=along.refines > 0)
    title = "the same over " + ("the time step" if along.key == "time.dt" else along.name)
    if len(orders) == 1:
        title += f": order {next(iter(orders.values())):.1f}"
    unit = " [s]" if along.key == "time.dt" else ""
    tidy(axis, title, f"{along.name}{unit}", "")


def _guide(axis: Any, points: list[tuple[float, float]], slope: int) -> None:
    """A dotted line of a whole order beside a series, finest point first, where its slope is nearest to that."""
    if len(points) < 2:
        return
    off = [abs(s - slope) for s in slopes(points)]
    at = off.index(min(off))
    (finest, error), coarsest = points[at], points[min(at + 2, len(points) - 1)][0]
    apart = 0.45
    end = apart * error * (coarsest / finest) ** slope
    axis.plot([finest, coarsest], [apart * error, end], ":", color=INK, lw=1.3, zorder=0)
    beside = (5, -3) if slope > 0 else (-5, -3)
    axis.annotate(
        f"order {abs(slope)}", (coarsest, end), fontsize=9, color=INK, xytext=beside, textcoords="offset points",
        va="center", ha="left" if slope > 0 else "right",
    )  # fmt: skip


def _names(axis: Any, study: Study, along: Axis | None) -> None:
    """The front in words, and what the lines are."""
    axis.axis("off")
    unit, _ = COSTS[study.cost]
    lines = []
    best = study.best()
    most = _most_named(study, along)
    for k, row in enumerate(best):
        if _named(k, len(best), most):
            error = amount(row.values[study.metric.name].error, study.metric.unit)
            lines.append(
                f"{k + 1}  {_brief(study, row.label)}\n     {error} for {amount(getattr(row, study.cost), unit)}"
            )
    if lines:
        axis.text(
            0.0, 1.0, "The front\n" + "\n".join(lines), transform=axis.transAxes, va="top", fontsize=9, color=INK,
            linespacing=1.45,
        )  # fmt: skip
    handles, names = axis.figure.axes[0].get_legend_handles_labels()
    orders = {label(o.settings): o.order for o in study.orders if along and o.axis == along.name}
    names = [_brief(study, name) + (f": order {orders[name]:.1f}" if name in orders else "") for name in names]
    if len(names) > (1 if along else 2):  # the front is one, which tells nothing beside nameless points
        axis.legend(handles, names, frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(-0.02, -0.06))
