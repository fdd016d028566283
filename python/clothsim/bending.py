"""Bending laws alone: the moment of a fabric along any path of curvatures, for plots and tests.

Examples
--------
>>> import clothsim as cs
>>> loop = cs.bending.trace([0.0, 200.0, -200.0, 200.0], b1=7.5e-5, b2=2.5e-5, c1=-3.7e-7)
>>> bool(loop.dissipated[-1] > 0.0)
True
"""

from __future__ import annotations

import difflib
import json
import math
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from clothsim import _core
from clothsim._arrays import Floats, floats, number
from clothsim.errors import InvalidInput

__all__ = ["Trace", "trace"]

Model = Literal["linear", "nonlinear", "plastic", "hysteresis"]
_MODELS = ("linear", "nonlinear", "plastic", "hysteresis")


@dataclass(frozen=True, eq=False)
class Trace:
    """What a law answers along a path, one entry per sample.

    Attributes
    ----------
    curvature : (n,) float64
        The path [1/m].
    moment : (n,) float64
        Moment per width [N].
    rest_curvature : (n,) float64
        Curvature about which the fabric rests [1/m].
    b1 : (n,) float64
        Initial rigidity that fatigue has left [N m].
    frictional_moment : (n,) float64
        Frictional moment M0 that fatigue has left [N]; of the plastic law the moment at its limit.
    dissipated : (n,) float64
        Work per area that came in and is no longer stored [J/m²]; never falls.
    """

    curvature: Floats
    moment: Floats
    rest_curvature: Floats
    b1: Floats
    frictional_moment: Floats
    dissipated: Floats

    def __repr__(self) -> str:
        return f"Trace({len(self.moment)} samples)"


def trace(
    curvature: ArrayLike,
    model: Model | str = "hysteresis",
    *,
    b1: float | None = None,
    b2: float | None = None,
    c1: float | None = None,
    rigidity: float | None = None,
    coercive_couple: float | None = None,
    transition_curvature: float | None = None,
    plasticity: float = 0.0,
    fatigue: float = 0.0,
    elastic_limit: float | None = None,
    hardening: float = 0.0,
) -> Trace:
    """Follow a bending law along a path of curvatures, from a flat and unused state.

    Between two samples the curvature is monotone, and what happens there is solved exactly: a path needs its turning
    points only. What a cycle leaves behind when a reversal ends it shows in the samples after the reversal.

    Parameters
    ----------
    curvature : (n,) array of float64
        Change of curvature (θ − θ0)/h̄ against the rest shape [1/m].
    model : {"linear", "nonlinear", "plastic", "hysteresis"}
        The law.
    b1, b2, c1 : float
        Initial rigidity [N m], rigidity once friction is overcome [N m], quadratic coefficient of positive
        curvatures [N m²]; b1 ≥ b2 > 0, c1 < 0. The linear law takes its rigidity from ``b2``, the plastic law its
        rigidity from ``b2`` and its limit from the transition curvature K0 = (b1 − b2)/(2 |c1|).
    rigidity, coercive_couple, transition_curvature : float
        Instead of b1, b2, c1: rigidity B = b2 [N m], coercive couple 2HB = 2 M0 [N m/m] and K0 [1/m] (50 by default).
    plasticity : float
        λ in [0, 1], share of a residual curvature that stays (hysteresis).
    fatigue : float
        μ in [0, 1], share of the friction that a full cycle takes away (hysteresis).
    elastic_limit : float
        Change of curvature from which the plastic law flows [1/m].
    hardening : float
        Hardening of the plastic law [N m].

    Returns
    -------
    Trace

    Raises
    ------
    InvalidInput
        The law is not known, its coefficients give no loop (which one and why), a sample is not finite, a parameter
        is missing or does not belong to the law.

    Examples
    --------
    A full loop dissipates 4 M0 (Km − 2/3 K0) per area:

    >>> import clothsim as cs
    >>> loop = cs.bending.trace([3.0, -3.0, 3.0], b1=3.0, b2=1.0, c1=-2.0)
    >>> float(round(loop.dissipated[2] - loop.dissipated[0], 9))
    5.333333333
    """
    name = _model(model)
    path = floats(curvature, "curvature", "shape (n,)")
    given = {
        "b1": b1,
        "b2": b2,
        "c1": c1,
        "rigidity": rigidity,
        "coercive_couple": coercive_couple,
        "transition_curvature": transition_curvature,
        "elastic_limit": elastic_limit,
        "plasticity": plasticity or None,
        "fatigue": fatigue or None,
        "hardening": hardening or None,
    }
    keys = {key: _finite(value, key) for key, value in given.items() if value is not None}
    return Trace(path, *_core.bending_trace(path, json.dumps({"model": name, **_law(name, keys)})))


# What each law reads, beside the coefficients of the curve.
_OWN = {
    "hinge": {"rigidity"},
    "nonlinear": {"rigidity", "coercive_couple", "transition_curvature"},
    "plastic": {"rigidity", "elastic_limit", "hardening"},
    "hysteresis": {"rigidity", "coercive_couple", "transition_curvature", "plasticity", "fatigue"},
}
_CURVE = {"b1", "b2", "c1"}


def _model(model: str) -> str:
    if isinstance(model, str) and model in _MODELS:
        return "hinge" if model == "linear" else model
    known = "one of " + ", ".join(f'"{name}"' for name in _MODELS)
    near = difflib.get_close_matches(str(model), _MODELS, 1)
    hint = f' (nearest: "{near[0]}")' if near else ""
    raise InvalidInput(f"model: expected {known}, got {model!r}{hint}", name="model", expected=known, got=repr(model))


def _law(model: str, keys: dict[str, float]) -> dict[str, float]:
    """Keys of the law's table in a scene file."""
    for key, value in keys.items():
        if key not in _OWN[model] | _CURVE:
            expected = f"no value for this law, which reads {', '.join(sorted(_OWN[model] | _CURVE))}"
            raise InvalidInput(f"{key}: expected {expected}, got {value}", name=key, expected=expected, got=str(value))
    if model in ("nonlinear", "hysteresis"):
        return keys
    own = {key: value for key, value in keys.items() if key in _OWN[model]}
    if "b2" in keys:
        own.setdefault("rigidity", keys["b2"])
    if model == "plastic" and keys.keys() >= _CURVE and keys["c1"] != 0.0:
        own.setdefault("elastic_limit", (keys["b1"] - keys["b2"]) / (2.0 * abs(keys["c1"])))
    for key, unit in (("rigidity", "N m"), ("elastic_limit", "1/m")):
        if key in _OWN[model] and key not in own:
            expected = f"a value > 0 in {unit}, or b1, b2 and c1"
            raise InvalidInput(f"{key}: expected {expected}, got nothing", name=key, expected=expected, got="nothing")
    return own


def _finite(value: float, name: str) -> float:
    found = number(value, name)
    if not math.isfinite(found):
        expected = "a finite number"
        raise InvalidInput(f"{name}: expected {expected}, got {found}", name=name, expected=expected, got=str(found))
    return found
