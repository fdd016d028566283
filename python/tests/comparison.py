"""Reported pairs against the ground truth."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Difference(NamedTuple):
    """Pairs that differ: truly colliding but not reported; reported but in no list; reported but truly apart."""

    missed: int
    outside: int
    false_positives: int


def compare(reported: NDArray[Any], listed: NDArray[Any], true: NDArray[Any]) -> Difference:
    """Compare sets of pairs, each a row of indices; an edge pair is the same with its edges or their ends swapped."""
    got = _keys(reported)
    in_list = _keys(listed)
    truth = {key for key, hit in zip(in_list, true, strict=True) if hit}
    found = set(got)
    if len(found) != len(got):
        raise AssertionError(f"{len(got) - len(found)} pairs are reported twice")
    outside = len(found - set(in_list))
    return Difference(len(truth - found), outside, len(found - truth))


def _keys(pairs: NDArray[Any]) -> list[tuple[int, ...]]:
    if pairs.shape[1] == 2:
        return list(map(tuple, pairs.tolist()))
    edges = np.sort(pairs.reshape(-1, 2, 2), axis=2)
    swap = (edges[:, 0, 0] > edges[:, 1, 0]) | ((edges[:, 0, 0] == edges[:, 1, 0]) & (edges[:, 0, 1] > edges[:, 1, 1]))
    edges[swap] = edges[swap, ::-1]
    return list(map(tuple, edges.reshape(-1, 4).tolist()))
