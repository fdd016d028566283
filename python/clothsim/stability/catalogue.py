"""All cases, in the order of the atlas."""

from __future__ import annotations

import difflib

from clothsim.errors import InvalidInput
from clothsim.stability.case import Case
from clothsim.stability.cases import (
    auto_steps,
    extremes,
    impacts,
    masses,
    meshes,
    piles,
    squeezed,
    starts,
    stiffness,
    tangles,
)

__all__ = ["CATALOGUE", "find"]

_GROUPS = (stiffness, masses, meshes, impacts, squeezed, tangles, piles, starts, extremes, auto_steps)

CATALOGUE: tuple[Case, ...] = tuple(case for group in _GROUPS for case in group.CASES)


def find(name: str) -> Case:
    """Return the case of that name.

    Raises
    ------
    InvalidInput
        The name is not known; the nearest known one is named.
    """
    cases = {case.name: case for case in CATALOGUE}
    wanted = name.strip().lower().replace("_", "-").replace(" ", "-")
    if wanted in cases:
        return cases[wanted]
    near = difflib.get_close_matches(wanted, cases, n=1, cutoff=0.0)[0]
    expected = "a case that clothsim stability --list names"
    raise InvalidInput(
        f"CASE: expected {expected}, got {name!r} (did you mean {near!r}?)", name="CASE", expected=expected, got=name
    )
