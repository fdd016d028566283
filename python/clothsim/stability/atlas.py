"""What a run of the atlas is asked for, and what came of it."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim.errors import InvalidInput
from clothsim.stability.case import Axis, Case
from clothsim.stability.catalogue import CATALOGUE, find
from clothsim.stability.verdict import Judged, Verdict, judge
from clothsim.study.folder import fingerprint

__all__ = ["Atlas", "Cell", "Map", "Request", "parse_values", "value_text", "values_by_name"]


@dataclass(frozen=True)
class Cell:
    """One cell: its parameters and, once it has run, what was seen of it."""

    case: Case
    x: Any
    y: Any
    facts: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @property
    def judged(self) -> Judged:
        """Its verdict and why."""
        return judge(self.facts)

    @property
    def broken(self) -> bool:
        """Whether a promise of the engine was broken here."""
        return self.judged.verdict.broken and self.case.promised(self.x, self.y)


class Request:
    """Which cells, checked.

    Parameters
    ----------
    cases : sequence of str
        Names; all of them if there is none.
    quick : bool
        The few cells of the quick form.
    at : mapping of str to sequence, optional
        Values of axes in place of their own, in every case that has the axis.
    fixed : mapping, optional
        Keys of every scene, as for studies: ``{"integrator": "rk4"}``.

    Raises
    ------
    InvalidInput
        A case, an axis or a value is not known; the nearest is named.
    """

    def __init__(
        self,
        cases: Sequence[str] = (),
        *,
        quick: bool = False,
        at: Mapping[str, Sequence[Any]] | None = None,
        fixed: Mapping[str, Any] | None = None,
    ) -> None:
        self.cases = [find(name) for name in dict.fromkeys(cases)] or list(CATALOGUE)
        self.quick, self.at, self.fixed = quick, dict(at or {}), dict(fixed or {})
        axes = {axis.name for case in self.cases for axis in (case.x, case.y)}
        for name in self.at:
            if name not in axes:
                near = difflib.get_close_matches(name, axes, n=1, cutoff=0.0)[0]
                expected = "an axis of a case that was asked for"
                raise InvalidInput(
                    f"--at: expected {expected}, got {name!r} (did you mean {near!r}?)", name="at", got=name
                )

    def values(self, axis: Axis) -> list[Any]:
        """Values of an axis in this run."""
        if axis.name not in self.at:
            return list(axis.quick if self.quick else axis.values)
        values = list(self.at[axis.name])
        words = [v for v in axis.values if isinstance(v, str)]
        for value in values:
            if words and value not in words:
                near = difflib.get_close_matches(str(value), words, n=1, cutoff=0.0)[0]
                raise InvalidInput(
                    f"--at {axis.name}: expected one of {', '.join(words)}, got {value!r} (did you mean {near!r}?)",
                    name="at", got=str(value),
                )  # fmt: skip
            if not words and (isinstance(value, str) or (axis.name == "dt" and not value > 0.0)):
                expected = "a number > 0 [s]" if axis.name == "dt" else "a number"
                raise InvalidInput(
                    f"--at {axis.name}: expected {expected}, got {value!r}", name="at", expected=expected
                )
        return values

    def cells(self) -> list[Cell]:
        """All cells, case by case, row by row."""
        return [Cell(case, x, y) for case in self.cases for y in self.values(case.y) for x in self.values(case.x)]

    @property
    def digest(self) -> str:
        """Fingerprint of all that results depend on, the engine and the cases themselves among it."""
        return fingerprint([[(c.case.name, c.x, c.y) for c in self.cells()], self.fixed, engine_digest()])


@cache
def engine_digest() -> str:
    """Fingerprint of the compiled engine and of the sources of this package."""
    sha = hashlib.sha256(Path(_core.__file__).read_bytes())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        sha.update(path.read_bytes())
    return sha.hexdigest()[:24]


@dataclass(frozen=True)
class Map:
    """The cells of one case."""

    case: Case
    xs: list[Any]
    ys: list[Any]
    cells: list[Cell]

    def rows(self) -> list[list[Cell]]:
        """Row by row, as the values of ``y`` go."""
        n = len(self.xs)
        return [self.cells[k * n : (k + 1) * n] for k in range(len(self.ys))]

    def counts(self) -> dict[Verdict, int]:
        """How many cells have which verdict."""
        seen = [cell.judged.verdict for cell in self.cells]
        return {v: seen.count(v) for v in Verdict if v in seen}

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        case = self.case
        return {
            "case": case.name, "title": case.title, "about": case.about,
            "x": {"name": case.x.name, "label": case.x.label, "values": self.xs},
            "y": {"name": case.y.name, "label": case.y.label, "values": self.ys},
            "counts": {v.words: n for v, n in self.counts().items()},
            "broken": sum(cell.broken for cell in self.cells),
            "cells": [
                {"x": c.x, "y": c.y, "verdict": c.judged.verdict.words, "why": c.judged.why,
                 "promised": case.promised(c.x, c.y), **c.facts}
                for c in self.cells
            ],
        }  # fmt: skip


@dataclass(frozen=True)
class Atlas:
    """What came of all cells.

    Attributes
    ----------
    maps : list of Map
        Case by case.
    machine : dict
        Where it ran.
    command : str
        How to do it again.
    digest : str
        Of the request.
    seconds : float
        What it took.
    """

    maps: list[Map]
    machine: dict[str, Any]
    command: str = ""
    digest: str = ""
    seconds: float = 0.0

    @property
    def cells(self) -> list[Cell]:
        """All cells."""
        return [cell for own in self.maps for cell in own.cells]

    @property
    def broken(self) -> list[Cell]:
        """Cells in which a promise was broken."""
        return [cell for cell in self.cells if cell.broken]

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "digest": self.digest, "command": self.command, "machine": self.machine, "seconds": round(self.seconds, 1),
            "cells": len(self.cells), "broken": len(self.broken), "cases": [own.facts() for own in self.maps],
        }  # fmt: skip


def value_text(value: Any) -> str:
    """A value for maps and commands: steps of frames as fractions."""
    if isinstance(value, float) and 0.0 < value < 1.0:
        for frames in (24, 30, 60):
            if abs(value * frames - 1.0) < 1e-9:
                return f"1/{frames}"
    return value if isinstance(value, str) else f"{value:g}"


def parse_values(text: str) -> tuple[str, list[Any]]:
    """``"dt=1e-3,1/60"`` as a name and its values: numbers, fractions, or words.

    Raises
    ------
    InvalidInput
        There is no name, or no value.
    """
    name, equals, values = text.partition("=")
    found = [part.strip() for part in values.split(",") if part.strip()]
    if not equals or not name.strip() or not found:
        expected = "NAME=VALUE, several by commas"
        raise InvalidInput(f"--at: expected {expected}, got {text!r}", name="at", expected=expected, got=text)
    return name.strip(), [_value(part) for part in found]


def values_by_name(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Several of `parse_values`.

    Raises
    ------
    InvalidInput
        A name comes twice.
    """
    out: dict[str, list[Any]] = {}
    for name, values in map(parse_values, texts):
        if name in out:
            raise InvalidInput(f"--at {name}: expected it once, several values by commas, got it twice", name="at")
        out[name] = values
    return out


def _value(text: str) -> Any:
    try:
        return float(Fraction(text)) if "/" in text else float(text)
    except (ValueError, ZeroDivisionError):
        return text
