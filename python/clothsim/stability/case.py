"""What a hard case is: a scene built from two parameters, and what must not change in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from clothsim._arrays import Floats, Ints
from clothsim.scene import Scene

__all__ = ["Axis", "Case", "Setup", "Sides", "dt_axis"]

# Labels that no motion without a passage changes, from the positions of all cloth and of all colliders [m].
Sides = Callable[[Floats, Floats], Ints]


@dataclass(frozen=True)
class Axis:
    """One parameter of a case.

    Attributes
    ----------
    name : str
        As in ``--at NAME=VALUE``.
    values : sequence
        Of the full form, numbers or words, in the order of the map.
    quick : sequence
        Of the quick form.
    unit : str
        Of the numbers.
    words : str
        What it is.
    """

    name: str
    values: Sequence[Any]
    quick: Sequence[Any]
    unit: str = ""
    words: str = ""

    @property
    def label(self) -> str:
        """For a map: what it is and its unit."""
        return (self.words or self.name) + (f" [{self.unit}]" if self.unit else "")


@dataclass(frozen=True)
class Setup:
    """What a cell runs.

    Attributes
    ----------
    scene : Scene
        With its own duration and time step.
    sides : callable, optional
        Labels that must stay as they were at the start: on which side of what each vertex is. What passes through
        changes them, even if nothing intersects before and after.
    """

    scene: Scene
    sides: Sides | None = None


@dataclass(frozen=True)
class Case:
    """A hard case over a grid of two parameters.

    Attributes
    ----------
    name : str
        On the command line.
    title : str
        In words.
    about : str
        What makes it hard and what to look for in its map.
    x, y : Axis
        Parameters along the map and up it.
    build : callable
        Makes the `Setup` from a value of ``x`` and one of ``y``; an error that it raises is the cell's.
    promised : callable
        Whether the engine's promise holds for a cell: defaults but for what the case varies, implicit integration.
    """

    name: str
    title: str
    about: str
    x: Axis
    y: Axis
    build: Callable[[Any, Any], Setup] = field(compare=False)
    promised: Callable[[Any, Any], bool] = field(default=lambda _x, _y: True, compare=False)


def dt_axis(values: Sequence[float] = (1e-4, 1e-3, 5e-3, 1 / 60, 1 / 24), quick: Sequence[float] = (5e-3,)) -> Axis:
    """The time step."""
    return Axis("dt", values, quick, "s", "time step")
