"""Bringing cloth to rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import clothsim as cs

# At rest when the fastest vertex would take this long for its own length scale [s], and energy stands still.
REST_SECONDS = 1e4
REST_ENERGY = 1e-9
# Most steps until rest.
MAX_STEPS = 400


class Rest(NamedTuple):
    """How a cloth came to rest: positions [m], steps taken, and whether it stood still."""

    positions: np.ndarray
    steps: int
    still: bool


def settle(simulation: cs.Simulation, length: float, seconds: float = 1.0) -> Rest:
    """Step until nothing moves.

    Backward Euler with steps of many periods takes the energy out itself: each step is nearly a minimisation. Rest is
    when no vertex is faster than ``length``/`REST_SECONDS` and the energy has changed by less than `REST_ENERGY` of the
    energy that it changed by in all.
    """
    start = before = simulation.energy["total"]
    for step in range(1, MAX_STEPS + 1):
        simulation.advance(seconds)
        now = simulation.energy["total"]
        fastest = float(np.linalg.norm(simulation.velocities, axis=1).max())
        if fastest * REST_SECONDS < length and abs(now - before) <= REST_ENERGY * abs(now - start):
            return Rest(simulation.positions, step, True)
        before = now
    return Rest(simulation.positions, MAX_STEPS, False)


def stepping(seconds: float = 1.0) -> dict[str, dict[str, object]]:
    """Tables of a scene for `settle`: Newton's method, a direct solver, and a little air."""
    return {
        "time": {
            "dt": seconds,
            "integrator": "implicit-newton",
            "newton_tolerance": 1e-8,
            "newton_max_iterations": 200,
        },
        "solver": {"method": "faer-llt"},
        "air": {"damping": 1.0},
    }
