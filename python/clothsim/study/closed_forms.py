"""Scenes whose answer is known: what they are recognised by, and where each vertex belongs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim import _core
from clothsim._arrays import Floats
from clothsim.study.elastica import cantilever
from clothsim.study.state import State

__all__ = ["ClosedForm", "find"]

# A strip rests when its fastest vertex takes so long for its length [s].
_REST = 1e3


@dataclass(frozen=True)
class ClosedForm:
    """An exact answer.

    Attributes
    ----------
    name, statement : str
        What it is.
    error : float
        Its own error [m].
    target : callable
        State of a run → positions (n, 3) [m] of its vertices in the exact answer; None where the run is not in the
        state that the answer is about.
    """

    name: str
    statement: str
    error: float
    target: Callable[[State], Floats | None]

    def reference(self, state: State) -> State | None:
        """The run with its vertices where they belong."""
        exact = self.target(state)
        return None if exact is None else replace(state, x_end=exact)


def find(state: State) -> ClosedForm | None:
    """The closed form of a run's scene, if it has one that is known here."""
    return _free_fall(state) or _cantilever(state)


def _gravity(data: dict[str, Any]) -> Floats:
    default = [0.0, -9.81, 0.0] if data["up"] == "y" else [0.0, 0.0, -9.81]
    return np.array(data.get("gravity") or default, dtype=float)


def _no_air(data: dict[str, Any], *, damping: bool) -> bool:
    air = data.get("air") or {}
    blown = air.get("drag") or air.get("lift") or (air.get("damping") and any(air.get("wind") or []))
    return not (blown or (air.get("damping") and not damping))


def _free_fall(state: State) -> ClosedForm | None:
    """Cloth in one piece that nothing holds, touches or turns: x0 + v t + g t²/2."""
    data = state.data
    even = all(np.ptp(state.v_start[own], axis=0).max() == 0.0 for own, _ in state.parts())
    flat = all(cloth["rest"] == "mesh" for cloth in data["cloth"])
    if state.pinned.any() or data.get("contact") or not even or not flat or not _no_air(data, damping=False):
        return None
    seconds, gravity = float(data["duration"]), _gravity(data)

    def target(run: State) -> Floats:
        return np.asarray(run.x_start + seconds * run.v_start + 0.5 * seconds**2 * gravity)

    statement = "free fall, x = x0 + v t + g t²/2"
    return ClosedForm("free-fall", statement, 1e-12 * float(np.abs(state.x_start).max() + seconds**2), target)


def _cantilever(state: State) -> ClosedForm | None:
    """A level strip clamped along one end that has come to rest under its weight."""
    data = state.data
    if len(data["cloth"]) != 1 or data.get("contact") or not _no_air(data, damping=True):
        return None
    cloth = data["cloth"][0]
    material = cloth["material"]
    if isinstance(material, str):
        material = {"fabric": material, "bending": "linear"}
    fabric = material.get("fabric")
    table = json.loads(_core.material_named(fabric, material["bending"])) if fabric else material
    bending = table["bending"]
    fixed = [p for p in cloth.get("pins", []) if not p.get("keyframes") and not p.get("collider")]
    known = bending["model"] in ("hinge", "linear") and cloth["mesh"].get("generator") == "grid"
    gravity = _gravity(data)
    up = 1 if data["up"] == "y" else 2
    falls = gravity[up] < 0.0 and not np.delete(gravity, up).any()
    if not (known and falls and len(fixed) == len(cloth.get("pins", [])) == 1) or _clamp(state, up) is None:
        return None
    weight = float(table["areal_density"]) * -gravity[up]
    rigidity = float(bending["rigidity"])

    def target(run: State) -> Floats | None:
        clamp = _clamp(run, up)
        if clamp is None:
            return None
        axis, sign, line, length = clamp
        if np.linalg.norm(run.v_end, axis=1).max() * _REST > length:
            return None
        s = sign * (run.x_start[:, axis] - line) / length
        reach, droop = cantilever(weight * length**3 / rigidity, s)
        out = run.x_start.copy()
        out[:, axis] = line + sign * length * reach
        out[:, up] = run.x_start[0, up] - length * droop
        return np.asarray(out)

    length = _clamp(state, up)
    assert length is not None  # checked above
    statement = (
        "heavy elastica of the clamped strip at rest (Bickley 1934), without stretch; each mesh is clamped half a cell "
        "before its last pinned row"
    )
    return ClosedForm("cantilever", statement, 1e-9 * length[3], target)


def _clamp(state: State, up: int) -> tuple[int, int, float, float] | None:
    """Axis along the strip, its direction, the clamp line [m] and the free length [m]; None if it is no such strip."""
    x = state.x_start
    if np.ptp(x[:, up]) > 1e-9 or not state.pinned.any() or state.pinned.all():
        return None
    for axis in (0, 2 if up == 1 else 1):
        for sign in (1, -1):
            along = sign * x[:, axis]
            held, free = along[state.pinned], along[~state.pinned]
            if held.max() < free.min() - 1e-12 and len(np.unique(np.round(held, 9))) > 1:
                cell = free.min() - held.max()
                line = held.max() - 0.5 * cell
                return axis, sign, float(sign * line), float(free.max() - line)
    return None
