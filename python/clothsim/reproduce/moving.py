"""Meshes in motion, made by formulas: what the generated benchmarks of detection have in common."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.errors import InvalidInput

__all__ = ["Moving", "joined", "length_of", "sheet", "whole"]


@dataclass(frozen=True, eq=False)
class Moving:
    """A mesh and some steps of its motion, apart in time.

    Attributes
    ----------
    triangles : (m, 3) int64
        Vertex indices.
    steps : tuple of ((n, 3) float64, (n, 3) float64)
        Positions at both ends of each step [m]. At the start of a step nothing passes through anything; what comes of
        it is where a step would end if nothing were in the way.
    """

    triangles: Ints
    steps: tuple[tuple[Floats, Floats], ...]


def whole(value: int, name: str, least: int) -> int:
    """Accept a whole number of at least ``least``."""
    try:
        count = operator.index(value)
    except TypeError:
        count = least - 1
    if count < least or isinstance(value, bool):
        expected = f"a whole number ≥ {least}"
        raise InvalidInput(f"{name}: expected {expected}, got {value!r}", name=name, expected=expected, got=repr(value))
    return count


def length_of(value: float, name: str) -> float:
    """Accept a finite length > 0."""
    if not (np.isfinite(value) and value > 0.0):
        expected = "a finite length > 0 m"
        raise InvalidInput(f"{name}: expected {expected}, got {value!r}", name=name, expected=expected, got=repr(value))
    return float(value)


def sheet(rows: int, columns: int, *, closed: bool = False) -> Ints:
    """Triangles of ``rows`` × ``columns`` cells whose diagonals alternate; ``closed``: the last column joins the first.

    Vertices are numbered row by row, ``columns`` (+ 1 unless closed) in each of ``rows`` + 1.
    """
    stride = columns if closed else columns + 1
    r, k = (index.ravel() for index in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a, b = r * stride + k, r * stride + (k + 1) % stride
    c, d = a + stride, b + stride
    turned = ((r + k) % 2 == 0)[:, None]
    first = np.where(turned, np.stack([a, c, d], 1), np.stack([a, c, b], 1))
    second = np.where(turned, np.stack([a, d, b], 1), np.stack([b, c, d], 1))
    return np.stack([first, second], axis=1).reshape(-1, 3)


def joined(triangles: Sequence[Ints], counts: Sequence[int]) -> Ints:
    """Triangles of several meshes whose vertices follow each other, ``counts`` of them in each."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return np.concatenate([part + start for part, start in zip(triangles, starts, strict=True)])
