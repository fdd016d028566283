"""Runs one cell and notes what happens, without asking the engine whether all is well."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim import collision
from clothsim._arrays import Floats, Ints
from clothsim.errors import ClothSimError
from clothsim.simulation import Simulation
from clothsim.stability.case import Setup
from clothsim.stability.energy import Entry, external, growth
from clothsim.study.state import pinned

__all__ = ["observe"]

# Moments at which a cell is looked at; cells with fewer steps at each of them.
_LOOKS = 40
_STANDARD_GRAVITY = 9.80665  # m/s²


def observe(setup: Setup) -> dict[str, Any]:
    """Run a scene for its duration in steps of its ``time.dt``; returns what `clothsim.stability.verdict.judge` reads.

    Errors of the engine are facts too; then the state that it kept is looked at as well.
    """
    started = time.process_time()
    facts: dict[str, Any] = {"finite": True, "time": 0.0, "started": False}
    try:
        simulation = Simulation(setup.scene, threads=1, device="cpu")
    except ClothSimError as error:
        return {**facts, "error": str(error), "error_type": type(error).__name__}
    facts["started"] = True
    watch = _Watch(setup, simulation)
    facts.update(_planned(setup))
    try:
        for advance in _pieces(simulation, setup):
            advance()
            watch.look()
            if not watch.facts["finite"]:
                break
    except ClothSimError as error:
        facts.update(error=str(error), error_type=type(error).__name__)
        watch.look()
    totals = json.loads(simulation._core.summary())["totals"]
    grown = growth(watch.entries, watch.allowed)
    facts.update(watch.facts, growth=grown.most, growth_left=grown.left, time=simulation.time)
    facts.update({k: totals[k] for k in ("steps", "substeps", "retries", "not_converged", "zones", "held_vertices")})
    facts["cpu_seconds"] = time.process_time() - started
    return facts


def _planned(setup: Setup) -> dict[str, Any]:
    """Steps and their length, unless the engine chooses them."""
    data = setup.scene.to_dict()
    dt, duration = data["time"]["dt"], float(data["duration"])
    return {"dt": dt, "steps_asked": None if isinstance(dt, str) else max(1, round(duration / float(dt)))}


def _pieces(simulation: Simulation, setup: Setup) -> Iterator[Callable[[], None]]:
    """What runs between two looks."""
    steps = _planned(setup)["steps_asked"]
    if steps is None:
        for _ in range(_LOOKS):
            yield lambda: simulation.advance(setup.scene.duration / _LOOKS)
        return
    done = 0

    def take(count: int) -> None:
        for _ in range(count):
            simulation._core.step()  # not `step`, which reads a report that nobody looks at

    for mark in sorted({max(1, round(steps * k / _LOOKS)) for k in range(1, _LOOKS + 1)}):
        yield partial(take, mark - done)
        done = mark


class _Watch:
    """What is seen of a simulation."""

    def __init__(self, setup: Setup, simulation: Simulation) -> None:
        self._simulation, self._sides = simulation, setup.sides
        data = setup.scene.to_dict()
        bodies = simulation.bodies
        cloths = [b for b in bodies if b.kind == "cloth"]
        self._x, self._colliders = simulation.positions, simulation.collider_positions
        self._cloth_triangles = sum(len(b.triangles) for b in cloths)
        self._triangles = _joined(bodies)
        self._pinned: NDArray[np.bool_] = pinned(data, cloths, self._x)
        self._masses = simulation.masses
        up = {"y": [0.0, -9.81, 0.0], "z": [0.0, 0.0, -9.81]}[data.get("up", "y")]
        self._gravity = np.asarray(up if data.get("gravity") is None else data["gravity"], dtype=float)
        self._origin = self._x.mean(axis=0)
        contact = data.get("contact")
        self._meets = contact is not None
        # What contact does within its thickness: see `clothsim.stability.energy`.
        thickness = float(contact["thickness"]) if contact is not None else 0.0
        self.allowed = float(self._masses.sum()) * _STANDARD_GRAVITY * thickness
        self.facts: dict[str, Any] = {"finite": True, "intersections": 0, "passed": 0}
        self.entries: list[Entry] = []
        self._labels: Ints | None = None
        self._first = 0
        self.look()
        self._first = self.facts.pop("first_intersections", 0)

    def look(self) -> None:
        """Check the state as it is."""
        simulation = self._simulation
        x, v, colliders = simulation.positions, simulation.velocities, simulation.collider_positions
        if not (np.isfinite(x).all() and np.isfinite(v).all()):
            self.facts["finite"] = False
            return
        moved = (x[self._pinned] != self._x[self._pinned]).any() or (colliders != self._colliders).any()
        kinetic, gravity = external(self._masses, x, v, self._gravity, self._origin)
        energy = simulation.energy
        elastic = sum(value for name, value in energy.items() if name not in ("kinetic", "gravity", "total"))
        self.entries.append(Entry(kinetic, elastic, gravity, bool(moved)))
        self._x, self._colliders = x, colliders
        if self._meets:
            self._crossings(np.concatenate([x, colliders]))
        if self._sides is not None:
            labels = self._sides(x, colliders)
            if self._labels is None:
                self._labels = labels
            elif (passed := int((labels != self._labels).sum())) > self.facts["passed"]:
                self.facts.setdefault("passed_at", simulation.time)
                self.facts["passed"] = passed

    def _crossings(self, x: Floats) -> None:
        pairs = collision.self_intersections(x, self._triangles, threads=1)
        count = int((pairs < self._cloth_triangles).any(axis=1).sum())  # colliders may pass through each other
        if "first_intersections" not in self.facts and not self.entries[1:]:
            self.facts["first_intersections"] = count
        elif count - self._first > self.facts["intersections"]:
            self.facts.setdefault("intersected_at", self._simulation.time)
            self.facts["intersections"] = count - self._first


def _joined(bodies: list[Any]) -> Ints:
    first, out = 0, []
    for body in bodies:
        out.append(np.asarray(body.triangles) + first)
        first += body.vertex_count
    return np.concatenate(out)
