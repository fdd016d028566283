"""A run whose path is known at every step that the engine takes.

The engine cuts a step that fails, and its parts are not seen from outside. Where they turn back and forth, a law with a
memory has had a cycle of which the states at the ends of steps say nothing. Here the stretch in which a step was
cut is taken again from its beginning in steps of half the size, until none is cut.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from clothsim._arrays import Floats
from clothsim.simulation import Simulation

__all__ = ["advance"]

_STRETCH = 20  # steps: a checkpoint is written at the beginning of each stretch
_FINEST = 64  # parts of a step, as many as the engine itself cuts it into


def advance(
    simulation: Simulation, steps: int, dt: float, look: Callable[[Simulation], Floats], path: list[Floats], file: Path
) -> Simulation:
    """Take ``steps`` steps of ``dt`` [s], the scene's, whole or in equal parts that are.

    Parameters
    ----------
    simulation : Simulation
        Of one thread; where a stretch is taken again, another one goes on from its beginning.
    look : callable
        What is seen of the simulation after each step or part of one.
    path : list
        Where that is appended.
    file : path
        For checkpoints.

    Returns
    -------
    Simulation
        The one that has come to the end. A stretch that fails in 64 parts of a step is left as the engine cuts these.
    """
    while steps > 0:
        count = min(_STRETCH, steps)
        steps -= count
        simulation.save_checkpoint(file, steps=False)
        parts = 1
        while (seen := _stretch(simulation, count, dt, parts, look)) is None:
            simulation = Simulation.resume(file, threads=1)
            parts *= 2
        path += seen
    return simulation


def _stretch(
    simulation: Simulation, count: int, dt: float, parts: int, look: Callable[[Simulation], Floats]
) -> list[Floats] | None:
    """What was seen after each part of ``count`` steps; None as soon as one was cut."""
    seen = []
    if parts == 1:
        for _ in range(count):
            if simulation.step()["substeps"] > 1:
                return None
            seen.append(look(simulation))
        return seen
    before = simulation.report["totals"]["substeps"]
    for _ in range(count * parts):
        simulation.advance(dt / parts)
        seen.append(look(simulation))
    taken = simulation.report["totals"]["substeps"] - before
    return seen if taken == count * parts or parts == _FINEST else None
