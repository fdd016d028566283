"""The verdict of a cell, from what was observed alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

__all__ = ["GROWN", "RUNAWAY", "Verdict", "judge"]

# Growth over what was available (`clothsim.stability.energy`): above the first at any time the energy grew; above the
# second in the end the cell has run away. docs/stability.md says why.
GROWN, RUNAWAY = 0.05, 10.0


class Verdict(Enum):
    """What became of a cell; value, letter in text maps, colour, and whether it breaks the engine's promise."""

    STABLE = ("stable", ".", "#5b9a74", False)
    GREW = ("energy grew", "E", "#e2c044", False)
    CAUGHT = ("diverged, caught", "D", "#7a6aa8", False)
    STUCK = ("stuck", "S", "#6f9bc4", False)
    REFUSED = ("refused", "R", "#c9c5bd", False)
    SILENT = ("diverged silently", "!", "#1f1d1b", True)
    INTERSECTED = ("intersected", "X", "#b3303b", True)
    TUNNELLED = ("tunnelled", "T", "#e0762f", True)
    FAILED = ("failed", "F", "#e58fb0", True)
    UNKNOWN = ("time limit", "?", "#ffffff", False)

    def __init__(self, words: str, letter: str, colour: str, broken: bool) -> None:
        self.words, self.letter, self.colour, self.broken = words, letter, colour, broken

    @classmethod
    def of(cls, words: str) -> Verdict:
        """The one with these words."""
        return next(v for v in cls if v.words == words)


@dataclass(frozen=True)
class Judged:
    """A verdict and why."""

    verdict: Verdict
    why: str


# Errors by class: those that refuse a start, and those that end a run.
_REFUSALS = ("IntersectingStart", "InvalidScene", "MeshError", "InvalidInput")
_ENDS = {"SimulationDiverged": Verdict.CAUGHT, "SimulationStuck": Verdict.STUCK}


def judge(facts: Mapping[str, Any]) -> Judged:
    """Judge a cell by its facts, the worst first: what is wrong and was not said comes before what was.

    Parameters
    ----------
    facts : mapping
        ``finite``, ``intersections`` (most pairs at once, beyond those of a start that may have some), ``passed``
        (labels that changed), ``growth`` and ``growth_left`` (`clothsim.stability.energy.Growth`), and ``error``,
        ``error_type`` where one was raised.
    """
    error, kind = facts.get("error"), facts.get("error_type", "")
    if kind == "TimeLimit":
        return Judged(Verdict.UNKNOWN, str(error))
    if facts.get("passed"):
        return Judged(Verdict.TUNNELLED, f"{facts['passed']} labels of side changed, at {facts['passed_at']:.6g} s")
    if facts.get("intersections"):
        return Judged(
            Verdict.INTERSECTED, f"{facts['intersections']} pairs of triangles, at {facts['intersected_at']:.6g} s"
        )
    if not facts.get("finite", True):
        return Judged(Verdict.SILENT, f"not finite at {facts['time']:.6g} s")
    if error is not None:
        if kind in _REFUSALS and not facts.get("started"):
            return Judged(Verdict.REFUSED, f"{kind}: {error}")
        return Judged(_ENDS.get(kind, Verdict.FAILED), f"{kind}: {error}")
    growth = facts.get("growth", 0.0)
    if (left := facts.get("growth_left", 0.0)) > RUNAWAY:
        return Judged(Verdict.SILENT, f"energy grew by {growth:.3g} of what was available, and {left:.3g} stayed")
    if growth > GROWN:
        return Judged(Verdict.GREW, f"energy grew by {growth:.3g} of what was available")
    return Judged(Verdict.STABLE, "")
