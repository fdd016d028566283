"""Energies and timings of a run as a picture."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import optional
from clothsim._files import write_whole

__all__ = ["write"]

_INK, _GRID = "#343230", "#e4e1db"
_ENERGIES = {
    "total": "#343230", "kinetic": "#9c2f35", "gravity": "#2f5d8c", "stretch": "#c08a2e", "shear": "#3f7a57",
    "bending": "#7a5195",
}  # fmt: skip
_WORKS = {"pins": "#8d8a84", "air": "#5aa0a8"}
_STAGES = ("#2f5d8c", "#9c2f35", "#c08a2e", "#3f7a57", "#7a5195", "#8d8a84", "#5aa0a8", "#c46f9b", "#a8a03c")


def write(frames: list[dict[str, Any]], path: Path, title: str) -> None:
    """Draw energy by kind over time, wall-clock time per stage and contacts per frame, into a PNG."""
    figures = optional("matplotlib.figure", extra="plot", purpose="drawing plots")
    optional("matplotlib.backends.backend_agg", extra="plot", purpose="drawing plots")
    times = np.array([frame["time"] for frame in frames])
    has_contact = any(frame["contact"] for frame in frames)
    figure = figures.Figure(figsize=(10, 10.5 if has_contact else 7.5), dpi=150, layout="constrained")
    axes = figure.subplots(3 if has_contact else 2, 1, sharex=True)
    figure.suptitle(title or "clothsim", fontsize=15, color=_INK, x=0.01, ha="left")
    _energies(axes[0], times, frames)
    _timings(axes[1], times, frames)
    if has_contact:
        _contacts(axes[2], times, frames)
    axes[-1].set_xlabel("simulated time [s]", color=_INK)
    for axis in axes:
        axis.grid(color=_GRID, linewidth=0.8)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(colors=_INK)
        axis.margins(x=0.01)
        axis.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor="white")
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
