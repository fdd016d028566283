"""Energies and timings of a run as a picture."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import optional
from clothsim._files import write_whole

__all__ = ["costliest", "write"]

_INK, _GRID = "#343230", "#e4e1db"
_ENERGIES = {
    "total": "#343230", "kinetic": "#9c2f35", "gravity": "#2f5d8c", "stretch": "#c08a2e", "shear": "#3f7a57",
    "bending": "#7a5195",
}  # fmt: skip
_WORKS = {"pins": "#8d8a84", "air": "#5aa0a8"}
_STAGES = ("#2f5d8c", "#9c2f35", "#c08a2e", "#3f7a57", "#7a5195", "#8d8a84", "#5aa0a8", "#c46f9b", "#a8a03c")

_MOST_EFFECTS = 8  # curves that are told apart


def write(frames: list[dict[str, Any]], path: Path, title: str, *, effects: list[dict[str, Any]] | None = None) -> None:
    """Draw energy by kind over time, wall-clock time per stage and per effect, and contacts, into a PNG, SVG or PDF.

    With ``effects``, the table of a report, also what each effect cost in the whole run.
    """
    figures = optional("matplotlib.figure", extra="plot", purpose="drawing plots")
    optional("matplotlib.backends.backend_agg", extra="plot", purpose="drawing plots")
    times = np.array([frame["time"] for frame in frames])
    has_contact = any(frame["contact"] for frame in frames)
    costs = sorted((e["milliseconds"], e["name"]) for e in effects or [] if e["milliseconds"])
    priced = costliest(frames)
    drawn = [_energies, _timings, *([_effects] if priced else []), *([_contacts] if has_contact else [])]
    over_time = len(drawn)
    heights = [3.5] * over_time + [0.9 + 0.26 * len(costs)] * bool(costs)
    figure = figures.Figure(figsize=(10, sum(heights)), dpi=150, layout="constrained")
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    axes = [figure.add_subplot(grid[0])]
    axes += [figure.add_subplot(grid[row], sharex=axes[0]) for row in range(1, over_time)]
    figure.suptitle(title or "clothsim", fontsize=15, color=_INK, x=0.01, ha="left")
    for draw, axis in zip(drawn, axes, strict=True):
        draw(axis, times, frames)
    for axis in axes[:-1]:
        axis.tick_params(labelbottom=False)
    axes[-1].set_xlabel("simulated time [s]", color=_INK)
    if costs:
        _costs(figure.add_subplot(grid[over_time]), costs)
    for axis in axes:
        axis.grid(color=_GRID, linewidth=0.8)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(colors=_INK)
        axis.margins(x=0.01)
        axis.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    buffer = io.BytesIO()
    kind = path.suffix.lower().lstrip(".") or "png"
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)  # equal runs give equal files
    with optional("matplotlib", extra="plot", purpose="drawing plots").rc_context({"svg.hashsalt": "clothsim"}):
        figure.savefig(buffer, format=kind, facecolor="white", metadata=undated)
    write_whole(path, buffer.getvalue())


def _energies(axis: Any, times: Any, frames: list[dict[str, Any]]) -> None:
    for kind, colour in _ENERGIES.items():
        values = np.array([frame["energy"][kind] for frame in frames])
        if kind in ("gravity", "total"):  # their zero is arbitrary: shown from the start
            values = values - values[0]
        if not np.any(values):
            continue
        label = f"{kind} (change)" if kind in ("gravity", "total") else kind
        axis.plot(times, values, color=colour, linewidth=2.2 if kind == "total" else 1.5, label=label)
    if len(frames) > 1 and all(frame.get("work") for frame in frames[1:]):
        for kind, colour in _WORKS.items():
            done = np.cumsum([frame["work"][kind] if k else 0.0 for k, frame in enumerate(frames)])
            if np.any(done):
                axis.plot(times, done, color=colour, linewidth=1.5, linestyle="--", label=f"work of {kind} (sum)")
    axis.set_ylabel("energy [J]", color=_INK)


def _costs(axis: Any, costs: list[tuple[float, str]]) -> None:
    """Bars of what each effect cost in the whole run [s]."""
    seconds = [1e-3 * milliseconds for milliseconds, _ in costs]
    total = sum(seconds)
    axis.barh([name for _, name in costs], seconds, color="#2f5d8c", height=0.66)
    for row, value in enumerate(seconds):
        axis.text(value, row, f"  {value:.3g} s, {value / total:.0%}", va="center", fontsize=8.5, color=_INK)
    axis.set_xlim(0.0, 1.18 * max(seconds))
    axis.set_xlabel("wall-clock time of each effect in the whole run [s]", color=_INK)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="x", color=_GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    axis.tick_params(colors=_INK, labelsize=9)


def _timings(axis: Any, times: Any, frames: list[dict[str, Any]]) -> None:
    stages = list(dict.fromkeys(stage for frame in frames for stage in frame["seconds"]))
    if not stages or len(frames) < 2:
        axis.set_ylabel("time per frame [ms]", color=_INK)
        axis.plot([], [], label="no steps")
        return
    rows = [[1e3 * frame["seconds"].get(stage, 0.0) for frame in frames[1:]] for stage in stages]
    colours = [_STAGES[k % len(_STAGES)] for k in range(len(stages))]
    axis.stackplot(times[1:], rows, labels=stages, colors=colours, linewidth=0)
    axis.set_ylabel("time per frame [ms]", color=_INK)


def costliest(frames: list[dict[str, Any]]) -> dict[str, list[float]]:
    """What each effect cost between each frame and the one before [ms], the dearest first; the cheap ones together.

    Empty where frames do not say so. The frame at which a run began has no steps: its cost is zero.
    """
    names = dict.fromkeys(name for frame in frames for name in frame.get("effects", {}))
    rows = {name: [frame.get("effects", {}).get(name, 0.0) for frame in frames] for name in names}
    ranked = sorted((name for name in rows if any(rows[name])), key=lambda name: -sum(rows[name]))
    found = {name: rows[name] for name in ranked[:_MOST_EFFECTS]}
    if rest := ranked[_MOST_EFFECTS:]:
        found[f"{len(rest)} others"] = [sum(values) for values in zip(*(rows[name] for name in rest), strict=True)]
    return found


def _effects(axis: Any, times: Any, frames: list[dict[str, Any]]) -> None:
    priced = costliest(frames)
    colours = [_STAGES[k % len(_STAGES)] for k in range(len(priced))]
    rows = [values[1:] for values in priced.values()]
    axis.stackplot(times[1:], rows, labels=list(priced), colors=colours, linewidth=0)
    axis.set_ylabel("cost of each effect\nper frame [ms]", color=_INK)


def _contacts(axis: Any, times: Any, frames: list[dict[str, Any]]) -> None:
    names = {
        "proximities": ("within the thickness", "#2f5d8c"), "collisions": ("colliding", "#9c2f35"),
        "zone_vertices": ("vertices in impact zones", "#c08a2e"), "held_vertices": ("vertices held back", "#7a5195"),
    }  # fmt: skip
    for key, (label, colour) in names.items():
        values = np.array([(frame["contact"] or {}).get(key, 0) / max(1, frame["steps"]) for frame in frames])
        shown = label if np.any(values) else f"{label}: none"
        axis.plot(times, values, color=colour, linewidth=1.5, label=shown)
    if any(frame["intersections"] for frame in frames):
        values = np.array([frame["intersections"] or 0 for frame in frames])
        axis.plot(times, values, color=_INK, linewidth=1.5, label="intersecting triangles")
    axis.set_yscale("symlog", linthresh=1.0)
    axis.set_ylim(bottom=0)
    axis.set_ylabel("pairs per step", color=_INK)
