"""What is known about each frame: energy, counts and seconds of its steps."""

from __future__ import annotations

import json
import time
from typing import Any

from clothsim.simulation import Simulation

__all__ = ["FrameFacts"]


class FrameFacts:
    """Collects the steps between frames, through checkpoints."""

    def __init__(self, simulation: Simulation, header: dict[str, Any]) -> None:
        self._simulation = simulation
        self._steps = int(header["steps"])
        self._wall = float(header["wall_seconds"])
        self._effects: dict[str, float] = header.get("effects") or _effects(simulation)
        self._started = time.monotonic()

    @property
    def steps(self) -> int:
        """Steps that the frames so far have told of: a checkpoint needs the reports of later ones only."""
        return self._steps

    def wall_seconds(self) -> float:
        """Wall-clock seconds spent so far, earlier sessions included."""
        return self._wall + time.monotonic() - self._started

    def header(self, frames: int, digest: str) -> dict[str, Any]:
        """Header of a checkpoint that ``frames`` frames belong to."""
        return {
            "frames": frames, "steps": self._steps, "wall_seconds": self.wall_seconds(), "digest": digest,
            "effects": self._effects,
        }  # fmt: skip

    def next(self, frame: int) -> dict[str, Any]:
        """Facts about the state now, and about the steps since the frame before."""
        steps = json.loads(self._simulation._core.steps(self._steps))
        self._steps += len(steps)
        before, self._effects = self._effects, _effects(self._simulation)
        return {
            "frame": frame,
            "time": self._simulation.time,
            "energy": self._simulation.energy,
            "work": _work(steps),
            "steps": len(steps),
            "substeps": sum(step["substeps"] for step in steps),
            "retries": sum(step["retries"] for step in steps),
            "linear_iterations": sum(step["linear_iterations"] for step in steps),
            "residual": max((step["residual"] for step in steps), default=0.0),
            "converged": all(step["converged"] for step in steps),
            "contact": _contact(steps),
            "intersections": steps[-1]["intersections"] if steps else None,
            "seconds": _seconds(steps),
            "effects": {name: total - before.get(name, 0.0) for name, total in self._effects.items()},
        }


def _effects(simulation: Simulation) -> dict[str, float]:
    """What each effect that has a time of its own has cost so far [ms]."""
    rows = json.loads(simulation._core.summary())["effects"]
    return {row["name"]: row["milliseconds"] for row in rows if row["milliseconds"] is not None}


def _work(steps: list[dict[str, Any]]) -> dict[str, float] | None:
    """Work of pins and of air on the cloth [J]; None unless it is known of every step."""
    entries = [step["energy"] for step in steps]
    if not entries or None in entries:
        return None
    return {kind: sum(entry[kind] for entry in entries) for kind in ("pins", "air")}


def _contact(steps: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Counts summed over steps; residual and exempt pairs at their largest."""
    contacts = [step["contact"] for step in steps if step["contact"] is not None]
    if not contacts:
        return None
    return {
        key: max(c[key] for c in contacts) if key in ("residual", "exempt") else sum(c[key] for c in contacts)
        for key in contacts[0]
    }


def _seconds(steps: list[dict[str, Any]]) -> dict[str, float]:
    total: dict[str, float] = {}
    for step in steps:
        for stage, seconds in step["seconds"]:
            total[stage] = total.get(stage, 0.0) + seconds
    return total
