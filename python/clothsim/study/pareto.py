"""Which points no other beats, and at which order errors fall."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

__all__ = ["front", "order", "slopes"]

# What an error has to be of that of all cheaper points.
_GAIN = 0.99
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
    """Median of the slopes of log(error) over log(step) between neighbouring steps whose errors can be trusted.

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
    return float(np.median(slopes(good))) if len(good) > 1 else None


def slopes(points: Sequence[tuple[float, float]]) -> list[float]:
    """Slopes between neighbours, both axes logarithmic."""
    return [math.log(e2 / e1) / math.log(h2 / h1) for (h1, e1), (h2, e2) in pairwise(points)]
