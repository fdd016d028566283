"""Whole random scenes against what a step promises.

A scene is refused by name, or runs; a step is taken, or refused by an error that leaves a state. Always: finite
numbers; no intersections where there were none and contact is on; the same bits with two threads, and from a
checkpoint written in mid-run; pinned vertices of which nobody asks anything stay where they are; energies that are
numbers, none negative that cannot be; a report that counts the steps.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import _core
from clothsim._logs import step_reports
from clothsim.errors import (
    IntersectingStart,
    InvalidInput,
    InvalidScene,
    MeshError,
    SimulationDiverged,
    SimulationStuck,
    SolverFailed,
)  # fmt: skip
from fuzz.target import Target, dump_json, load_json, refused

__all__ = ["target"]


def target() -> Target:
    """Whole scenes."""
    return Target(
        "runs", "whole random scenes against the contract of a step", _scenes(), check, dump_json, load_json, plant,
        quick=60, seconds=120.0,
    )  # fmt: skip


_SMALL = st.sampled_from([-0.3, -0.1, -0.02, 0.0, 0.001, 0.01, 0.05, 0.1, 0.3])
_AXIS = st.sampled_from([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1e-90, 0.0, 0.0]])


def _maybe(draw: Any, table: dict[str, Any], key: str, values: Any, chance: int = 3) -> None:
    """Set a key once in so many times."""
    if draw(st.integers(1, chance)) == 1:
        table[key] = draw(values)


def _point(draw: Any, values: Any = _SMALL) -> list[float]:
    return [draw(values) for _ in range(3)]


@st.composite
def _generators(draw: Any) -> dict[str, Any]:
    size = st.sampled_from([0.2, 0.2, 0.2, 0.05, 1.0, 1e-6, 1e3])
    match draw(st.sampled_from(["grid", "grid", "grid", "disc", "ribbon", "cylinder", "sphere", "box"])):
        case "grid":
            return {"generator": "grid", "width": draw(size), "height": draw(size), "nx": draw(st.integers(2, 7)),
                    "ny": draw(st.integers(2, 7)),
                    "diagonals": draw(st.sampled_from(["alternating", "one-way", "crossed"]))}  # fmt: skip
        case "disc":
            return {"generator": "disc", "radius": draw(size), "rings": draw(st.integers(1, 3))}
        case "ribbon":
            return {"generator": "ribbon", "length": draw(size), "width": draw(size), "nx": draw(st.integers(2, 9)),
                    "ny": 2, "twist": draw(st.sampled_from([0.0, 1.0, 7.0]))}  # fmt: skip
        case "cylinder":
            return {"generator": "cylinder", "radius": draw(size), "height": draw(size),
                    "segments": draw(st.integers(3, 7)),
                    "rows": draw(st.integers(1, 3)), "caps": draw(st.booleans())}  # fmt: skip
        case "sphere":
            return {"generator": "sphere", "radius": draw(size), "subdivisions": draw(st.integers(0, 1))}
    return {
        "generator": "box",
        "size": [draw(size) for _ in range(3)],
        "cells": [draw(st.integers(1, 2)) for _ in range(3)],
    }


@st.composite
def _materials(draw: Any) -> Any:
    if draw(st.booleans()):
        name = draw(st.sampled_from(["cotton", "denim", "silk", "wool", "polyester"]))
        bending = draw(st.sampled_from([None, "none", "linear", "nonlinear", "hysteresis"]))
        return name if bending is None else {"fabric": name, "bending": bending}
    stiffness = st.sampled_from([0.0, 1.0, 100.0, 1e5, 1e12])
    damping = st.sampled_from([0.0, 0.001, 1.0, 1e6])
    in_plane = (
        {"model": "spring", "stiffness": draw(stiffness), "damping": draw(damping)}
        if draw(st.booleans())
        else {
            "model": "baraff-witkin",
            "warp": draw(stiffness),
            "weft": draw(stiffness),
            "shear": draw(stiffness),
            "damping": draw(damping),
        }
    )
    rigidity = st.sampled_from([0.0, 1e-6, 1e-3, 1e3])
    bending = draw(st.sampled_from(["none", "hinge", "spring", "plastic", "hysteresis", "nonlinear"]))
    law: dict[str, Any] = {"model": bending}
    match bending:
        case "hinge":
            law |= {"rigidity": draw(rigidity), "damping": draw(damping)}
        case "spring":
            law |= {"stiffness": draw(stiffness), "damping": draw(damping)}
        case "plastic":
            law |= {"rigidity": draw(rigidity), "elastic_limit": draw(st.sampled_from([0.1, 10.0])), "hardening": 1e-7}
        case "hysteresis":
            law |= {"rigidity": 1e-6, "coercive_couple": 1e-4, "plasticity": draw(st.sampled_from([0.0, 0.5, 1.0])),
                    "fatigue": draw(st.sampled_from([0.0, 0.5, 1.0]))}  # fmt: skip
        case "nonlinear":
            law |= {"rigidity": 1e-6, "coercive_couple": 1e-4}
    if bending not in ("none", "spring") and draw(st.booleans()):
        law["hinges"] = "independent"
    density = draw(st.sampled_from([0.15, 0.15, 1e-9, 1e-3, 1e3, 1e6]))
    return {"areal_density": density, "in_plane": in_plane, "bending": law}


_FRICTION = st.one_of(
    st.sampled_from([0.0, 0.3, 1.0, 50.0]),
    st.sampled_from([
        {"law": "coulomb-stiction", "mu_c": 0.1, "mu_s": 0.4},
        {"law": "stribeck", "mu_c": 0.1, "mu_s": 0.4, "v_s": 0.01, "delta_s": 1.0},
        {"law": "viscous", "mu_c": 0.1, "mu_s": 0.4, "v_s": 0.4, "delta_s": 0.2, "f_v": 0.24, "delta_v": 1.0},
        {"pair": "cotton-cotton"},
    ]),
)  # fmt: skip


@st.composite
def _frames(draw: Any) -> list[dict[str, Any]]:
    times = sorted(draw(st.lists(st.sampled_from([0.0, 0.01, 0.02, 0.05, 0.5]), min_size=1, max_size=3, unique=True)))
    out = []
    for time in times:
        frame: dict[str, Any] = {"time": time}
        _maybe(draw, frame, "position", st.lists(_SMALL, min_size=3, max_size=3), 2)
        _maybe(
            draw, frame, "rotation", st.fixed_dictionaries({"axis": _AXIS, "angle": st.sampled_from([0.5, 3.0, 100.0])})
        )
        out.append(frame)
    return out


@st.composite
def _cloths(draw: Any, number: int, colliders: list[str]) -> dict[str, Any]:
    table: dict[str, Any] = {
        "name": f"cloth {number}", "mesh": draw(_generators()), "material": draw(_materials()),
        "position": [draw(_SMALL), 0.1 * number + draw(_SMALL), draw(_SMALL)],
    }  # fmt: skip
    rotations = st.fixed_dictionaries({"axis": _AXIS, "angle": st.sampled_from([0.3, 1.57, 3.0])})
    _maybe(draw, table, "rotation", rotations)
    _maybe(draw, table, "velocity", st.lists(st.sampled_from([0.0, 1.0, -5.0, 300.0]), min_size=3, max_size=3))
    _maybe(draw, table, "self_collision", st.booleans())
    _maybe(draw, table, "friction", _FRICTION)
    _maybe(draw, table, "self_friction", _FRICTION)
    _maybe(draw, table, "strain_limit", st.sampled_from([1e-9, 0.05, 0.5, {"stretch": 0.1, "compression": 0.1}]))
    _maybe(draw, table, "rest", st.just("uv"), 8)
    if draw(st.integers(1, 3)) == 1:
        pin: dict[str, Any] = {"vertices": draw(st.lists(st.integers(0, 3), min_size=1, max_size=3, unique=True))}
        if colliders and draw(st.booleans()):
            pin["collider"] = draw(st.sampled_from(colliders))
        else:
            _maybe(draw, pin, "keyframes", _frames(), 2)
        table["pins"] = [pin]
    if draw(st.integers(1, 5)) == 1:
        seam: dict[str, Any] = {"pairs": [[0, 3]], "start": draw(st.sampled_from([0.0, 0.01]))}
        _maybe(draw, seam, "duration", st.sampled_from([0.0, 0.02]), 2)
        _maybe(draw, seam, "stiffness", st.sampled_from([1.0, 1e4]), 2)
        table["seams"] = [seam]
    if draw(st.integers(1, 5)) == 1:
        table["regions"] = [{"triangles": [0, 1], "material": draw(_materials())}]
    return table


@st.composite
def _colliders(draw: Any, number: int) -> dict[str, Any]:
    shape = draw(st.sampled_from([
        {"type": "sphere", "radius": 0.1, "tolerance": 0.02}, {"type": "plane", "half_size": 0.5},
        {"type": "capsule", "radius": 0.03, "half_height": 0.1, "tolerance": 0.01},
        {"type": "box", "half_extents": [0.1, 0.02, 0.1]}, {"type": "cone", "radius": 0.1, "height": 0.2,
        "tolerance": 0.02},
        {"type": "sphere", "radius": 1e-3, "tolerance": 1e-4},
    ]))  # fmt: skip
    table = {"name": f"body {number}", "shape": shape, "position": [draw(_SMALL), -0.15 + draw(_SMALL), draw(_SMALL)]}
    _maybe(draw, table, "keyframes", _frames(), 2)
    _maybe(draw, table, "friction", _FRICTION)
    return table


@st.composite
def _scenes(draw: Any) -> dict[str, Any]:
    colliders = [draw(_colliders(k)) for k in range(draw(st.integers(0, 2)))]
    names = [table["name"] for table in colliders]
    scene: dict[str, Any] = {"collider": colliders, "duration": 1.0}
    scene["cloth"] = [draw(_cloths(k, names)) for k in range(draw(st.sampled_from([1, 1, 2, 3])))]
    time: dict[str, Any] = {"dt": draw(st.sampled_from([0.005, 0.005, 0.02, 1e-4, 1e-9, 0.5, 100.0, "auto"]))}
    integrators = ["explicit-euler", "midpoint", "rk4", "implicit-euler", "implicit-newton", "semi-implicit"]
    _maybe(draw, time, "integrator", st.sampled_from(integrators), 2)
    _maybe(draw, time, "max_halvings", st.sampled_from([0, 1, 6, 20]))
    _maybe(draw, time, "indefinite", st.just("raw"), 6)
    _maybe(draw, time, "bending_substeps", st.sampled_from([1, 7]), 4)
    scene["time"] = time
    if draw(st.integers(1, 4)) > 1:
        contact: dict[str, Any] = {"thickness": draw(st.sampled_from([0.004, 0.004, 1e-9, 1e-4, 0.03, 1.0]))}
        _maybe(draw, contact, "method", st.just("constraints"), 4)
        _maybe(draw, contact, "friction", _FRICTION)
        _maybe(draw, contact, "self", st.booleans(), 4)
        _maybe(draw, contact, "max_passes", st.sampled_from([0, 1, 6]), 4)
        _maybe(draw, contact, "max_zone_passes", st.sampled_from([0, 1, 8]), 4)
        _maybe(draw, contact, "repulsion_stiffness", st.sampled_from([0.0, 1.0, 1e4]), 4)
        _maybe(draw, contact, "detector", st.sampled_from(["bvh", "session", "auto", "brute"]), 3)
        scene["contact"] = contact
    if draw(st.integers(1, 3)) == 1:
        effects: dict[str, Any] = {}
        for key in ("self_collision", "ccd", "friction"):
            _maybe(draw, effects, key, st.just("auto"), 2)
        _maybe(
            draw, effects, "sleep", st.sampled_from([{"speed": 1.0, "time": 0.005}, {"speed": 1e-3, "time": 0.1}]), 2
        )
        scene["effects"] = effects
    if draw(st.integers(1, 3)) == 1:
        scene["air"] = {
            "wind": _point(draw, st.sampled_from([0.0, 3.0, -80.0])), "drag": draw(st.sampled_from([0.0, 1.0])),
            "lift": draw(st.sampled_from([0.0, 1.0])), "damping": draw(st.sampled_from([0.0, 1.0, 1e4])),
        }  # fmt: skip
    _maybe(draw, scene, "gravity", st.sampled_from([[0.0, 0.0, 0.0], [0.0, 1e7, 0.0], [3.0, -1.0, 0.0]]), 5)
    _maybe(draw, scene, "up", st.just("z"), 6)
    _maybe(draw, scene, "start", st.just("untangle"), 5)
    if draw(st.integers(1, 4)) == 1:
        method = draw(st.sampled_from(["faer-cg", "faer-llt", "pcg", "pcg-jacobi"]))
        scene["solver"] = {"method": method, "max_iterations": draw(st.sampled_from([1, 500]))}
    return {"scene": scene, "steps": draw(st.integers(1, 6))}


# What a scene may be refused by, and what a step may stop with. `SolverFailed` only for strain limits that pins, seams
# or contact do not let be met; for no other reason.
_REFUSED = (InvalidScene, InvalidInput, MeshError, IntersectingStart)
_STOPPED = (SimulationDiverged, SimulationStuck, SolverFailed)


def check(case: dict[str, Any]) -> None:
    """Run it with one thread and with two, the second through a checkpoint."""
    scene = case["scene"]
    try:
        one = cs.Simulation(cs.Scene(**scene), threads=1, device="cpu")
    except _REFUSED as error:
        refused(error)
        return
    two = cs.Simulation(cs.Scene(**scene), threads=2, device="cpu")
    start = one.positions
    _sound(one, scene)
    half = case["steps"] // 2
    for number in range(case["steps"]):
        stops = [_step(simulation) for simulation in (one, two)]
        assert stops[0] == stops[1], f"step {number}: {stops[0]} with one thread, {stops[1]} with two"
        _sound(one, scene)
        _same(one, two, f"step {number}, one and two threads")
        if stops[0] is not None:
            break
        assert step_reports(one._core) == number + 1
        if number == half:
            two = cs.Simulation._from_bytes(two._core.checkpoint(number % 2), 2, "cpu")
            _same(one, two, f"checkpoint after step {number}")
    _pinned(one, scene, start)


def _step(simulation: cs.Simulation) -> str | None:
    before = simulation.time
    try:
        simulation.step()
    except _STOPPED as error:
        refused(error)
        if isinstance(error, SolverFailed):
            assert "beyond their strain limit" in str(error), f"SolverFailed: {error}"
        else:
            assert error.time <= simulation.time, "the error names a time after the state"
        return f"{type(error).__name__}: {error}"
    assert simulation.time > before, "a step of no time"
    return None


def _same(one: cs.Simulation, two: cs.Simulation, where: str) -> None:
    for what in ("positions", "velocities", "collider_positions", "contact_forces"):
        a, b = getattr(one, what), getattr(two, what)
        assert a.tobytes() == b.tobytes(), f"{where}: {what} differ by {np.abs(a - b).max()}"
    assert (one.time, one.energy) == (two.time, two.energy), where


def _sound(simulation: cs.Simulation, scene: dict[str, Any]) -> None:
    for what in ("positions", "velocities", "collider_positions", "contact_forces"):
        assert np.isfinite(getattr(simulation, what)).all(), f"{what} are not finite at t = {simulation.time}"
    energy = simulation.energy
    assert all(np.isfinite(value) for value in energy.values()), f"energy: {energy}"
    assert energy["kinetic"] >= 0.0 and energy["stretch"] >= 0.0 and energy["shear"] >= 0.0, f"energy: {energy}"
    pairs = simulation.intersections()
    assert not len(pairs), f"{len(pairs)} intersections at t = {simulation.time}, the first {pairs[0].tolist()}"
    contact = scene.get("contact")
    if (
        contact
        and contact.get("self", True)
        and not any(key in table for table in scene["cloth"] for key in ("pins", "seams", "self_collision"))
    ):
        _no_crossings(simulation)


def _no_crossings(simulation: cs.Simulation) -> None:
    """The same, asked of all triangles without the scene's rules: only colliders may pass through each other."""
    first, rows, own = 0, [], 0
    for body in simulation.bodies:
        rows.append(np.asarray(body.triangles) + first)
        first += body.vertex_count
        own += len(body.triangles) if body.kind == "cloth" else 0
    x = np.concatenate([simulation.positions, simulation.collider_positions])
    pairs = cs.collision.self_intersections(x, np.concatenate(rows), threads=1)
    pairs = pairs[(pairs < own).any(axis=1)]
    assert not len(pairs), f"triangles {pairs[0].tolist()} pass through each other at t = {simulation.time}"


def _pinned(simulation: cs.Simulation, scene: dict[str, Any], start: Any) -> None:
    bodies = [body for body in simulation.bodies if body.kind == "cloth"]
    first = 0
    for body, table in zip(bodies, scene["cloth"], strict=True):
        for pin in table.get("pins", ()):
            if not ("collider" in pin or "keyframes" in pin or table.get("velocity")):
                held = first + np.array(pin["vertices"])
                assert np.array_equal(simulation.positions[held], start[held]), "a pin that nothing moves has moved"
        first += body.vertex_count


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A checkpoint that keeps the state in single precision."""
    honest = _core.Simulation.resume

    class Careless:
        def __new__(cls, *arguments: Any) -> Any:
            return _HONEST(*arguments)

        @staticmethod
        def resume(content: bytes, threads: int | None, device: str) -> Any:
            found = honest(content, threads, device)
            if len(found.velocities()) > 4:
                found.round_state()
            return found

    with mock.patch.object(_core, "Simulation", Careless):
        yield


_HONEST = _core.Simulation
