"""Which points no other beats, and at which order errors fall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

__all__ = ["front", "order"]

# What an error has to be of that of all cheaper points.
_GAIN = 0.99
# Values that a fit of an order takes at most, from the finest.
_MOST = 3
# Steps nearer to each other than by this factor say too little about a slope.
_APART = 1.4


def front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Indices, cheapest first, of the points whose error no cheaper point comes near; a hundredth is no gain."""
    best, chosen = np.inf, []
    for k in sorted(range(len(costs)), key=lambda k: (costs[k], errors[k])):
        if errors[k] < _GAIN * best:
            best = errors[k]
            chosen.append(k)
    return chosen


def order(errors: Mapping[float, float], floor: float) -> float | None:
    """Slope of log(error) over log(step), by least squares over the finest three values that can be trusted.

    Parameters
    ----------
    errors : mapping
        Error by step (time step, or length of a cell).
    floor : float
        The reference's own error: errors below ten times that are not used.
    """
    good: list[tuple[float, float]] = []
    for h, e in sorted(errors.items()):
        if e > 10.0 * floor and e > 0.0 and (not good or h > _APART * good[-1][0]):
            good.append((h, e))
    good = good[:_MOST]
    if len(good) < 2:
        return None
    h, e = np.log(np.array(good)).T
    return float(np.polyfit(h, e, 1)[0])
