"""What a simulation hands out: frames, its plan, what bending has left behind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clothsim._arrays import Floats, Ints

__all__ = ["Frame", "Hinges", "Plan"]


@dataclass(frozen=True, eq=False)
class Frame:
    """The state at one moment of a run.

    Attributes
    ----------
    index : int
        Number of the frame; 0 is the state at which the run began.
    time : float
        Simulated time [s].
    positions : (n, 3) float64
        Positions of all cloth vertices [m].
    velocities : (n, 3) float64
        Their velocities [m/s].
    collider_positions : (k, 3) float64
        Positions of all collider vertices [m].
    """

    index: int
    time: float
    positions: Floats
    velocities: Floats
    collider_positions: Floats


class Plan(dict[str, Any]):
    """Which effects run and why, as the tables of its JSON; ``print`` it for a table to read.

    Parameters
    ----------
    tables : dict
        The plan as ``clothsim plan --json`` prints it.
    text : str
        The plan as ``clothsim plan`` prints it.
    """

    def __init__(self, tables: dict[str, Any], text: str) -> None:
        super().__init__(tables)
        self._text = text

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"Plan(on: {', '.join(self.running)})"

    @property
    def running(self) -> list[str]:
        """Names of the effects that run, in the order of the step."""
        return [effect["name"] for effect in self["effects"] if effect["on"]]


@dataclass(frozen=True, eq=False)
class Hinges:
    """The shared edges of bending laws that remember, as they stand.

    Attributes
    ----------
    vertices : (h, 4) int64
        Cloth vertices: the shared edge, then the two opposite it.
    curvature : (h,) float64
        Change of curvature (θ − θ0)/h̄ against the rest shape [1/m].
    moment : (h,) float64
        Moment per width [N].
    rest_curvature : (h,) float64
        Curvature about which the hinge rests now [1/m].
    b1 : (h,) float64
        Initial rigidity that fatigue has left [N m].
    frictional_moment : (h,) float64
        Frictional moment that fatigue has left [N].
    """

    vertices: Ints
    curvature: Floats
    moment: Floats
    rest_curvature: Floats
    b1: Floats
    frictional_moment: Floats
