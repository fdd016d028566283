"""Pins that are moved while the simulation goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs

PACE = 0.05  # s


def held(keyframes: list[dict[str, Any]] | None = None, **pin: Any) -> cs.Scene:
    scene = cs.Scene(duration=0.4, time={"dt": 0.01}, contact={"thickness": 0.005})
    pin = {"vertices": [0, 1, 5], **({"keyframes": keyframes} if keyframes else {}), **pin}
    scene.add_collider("ball", shape={"type": "sphere", "radius": 0.05, "tolerance": 0.005})
    scene.add_cloth(cs.Mesh.grid(0.3, 0.3, 5, 5), "cotton", name="towel", position=(0.0, 0.3, 0.0), pins=[pin])
    return scene


PLACES = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.02, 0.03, 0.01], [-0.01, 0.03, 0.01]]
TURNS = [0.0, 0.3, 0.3, -0.2]


def planned() -> cs.Scene:
    """The motion of the tests as keyframes."""
    return held([
        {"time": k * PACE, "position": place, "rotation": {"axis": [0, 1, 0], "angle": turn}}
        for k, (place, turn) in enumerate(zip(PLACES, TURNS, strict=True))
    ])  # fmt: skip


def go(sim: cs.Simulation, first: int = 1) -> np.ndarray[Any, Any]:
    for place, turn in list(zip(PLACES, TURNS, strict=True))[first:]:
        sim.steer("towel", 0, position=place, rotation={"angle": turn}, seconds=PACE)
        sim.advance(PACE)
    return sim.positions


def test_steps_taken_one_by_one_are_the_keyframes() -> None:
    sim = cs.Simulation(planned())
    sim.advance(3 * PACE)
    steered = cs.Simulation(held())
    # Times of keyframes are sums here and products there: they differ in the last bit.
    np.testing.assert_allclose(go(steered), sim.positions, rtol=0, atol=1e-12)
    still = cs.Simulation(held())
    still.advance(3 * PACE)
    assert np.abs(still.positions - sim.positions).max() > 5e-3, "the motion does not matter: the test proves nothing"


def test_a_checkpoint_keeps_where_the_pin_was_sent(tmp_path: Path) -> None:
    sim = cs.Simulation(held())
    sim.steer("towel", 0, position=PLACES[1], rotation={"angle": TURNS[1]}, seconds=PACE)
    sim.advance(0.6 * PACE)
    sim.save_checkpoint(tmp_path / "half")
    again = cs.Simulation.resume(tmp_path / "half")
    for one in (sim, again):
        one.advance(0.4 * PACE)
        go(one, 2)
    np.testing.assert_array_equal(again.positions, sim.positions)


def test_a_pin_on_its_way_turns_round_where_it_is() -> None:
    sim = cs.Simulation(held())
    start = sim.positions[[0, 1, 5]]
    sim.steer("towel", position=(0.04, 0.0, 0.0), rotation={"axis": (0, 0, 1), "angle": 0.4}, seconds=2 * PACE)
    sim.advance(PACE)
    half = sim.positions[[0, 1, 5]]
    pivot = start.mean(axis=0)
    turn = np.array([[np.cos(0.2), -np.sin(0.2), 0], [np.sin(0.2), np.cos(0.2), 0], [0, 0, 1]])
    np.testing.assert_allclose(half, (start - pivot) @ turn.T + pivot + [0.02, 0, 0], atol=1e-12)
    sim.steer("towel", position=(0.0, 0.0, 0.0), seconds=PACE)
    sim.advance(PACE / 5)
    assert np.abs(sim.positions[[0, 1, 5]] - half).max() < 0.02 / 5 + 0.2 / 5 * 0.1 + 1e-9, "no jump"
    sim.advance(PACE * 4 / 5)
    np.testing.assert_allclose(sim.positions[[0, 1, 5]], start, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cloth": "sheet"}, "cloth: expected one of 'towel', got 'sheet'"),
        ({"pin": 1}, "pin: expected a pin of the cloth, got 1 of 1"),
        ({"pin": -1}, "pin: expected the number of a pin, got -1"),
        ({"seconds": 0.0}, r"seconds: expected a finite number > 0 \[s\], got 0"),
        ({"seconds": float("nan")}, r"seconds: expected a finite number > 0 \[s\], got NaN"),
        ({"position": (0.0, 1.0)}, r"position: expected shape \(3,\), got shape \(2,\)"),
        ({"position": (0.0, float("inf"), 0.0)}, "position: .*finite"),
        ({"rotation": {"axis": (0, 1, 0)}}, "rotation: expected axis and angle"),
        ({"rotation": {"axis": (0, 0, 0), "angle": 1.0}}, "axis: expected an axis of any length but zero"),
    ],
)
def test_bad_input_changes_nothing(arguments: dict[str, Any], message: str) -> None:
    sim, other = cs.Simulation(held()), cs.Simulation(held())
    good: dict[str, Any] = {"cloth": "towel", "pin": 0, "position": (0.1, 0.0, 0.0), "seconds": PACE}
    with pytest.raises(ValueError, match=message):
        sim.steer(**{**good, **arguments})
    for one in (sim, other):
        one.advance(PACE)
    np.testing.assert_array_equal(sim.positions, other.positions)


def test_a_pin_that_a_collider_carries_is_refused() -> None:
    sim = cs.Simulation(held(collider="ball"))
    with pytest.raises(cs.InvalidInput, match='expected a pin that no collider carries, got one on "ball"'):
        sim.steer("towel", position=(0.0, 0.1, 0.0), seconds=PACE)
