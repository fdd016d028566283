"""Friction laws alone, and published coefficients of friction of fabrics.

Examples
--------
>>> import clothsim as cs
>>> cs.friction.force("coulomb-stiction", 10.0, 0.0, 1.5, mu_c=0.1, mu_s=0.2)  # sticks: the pull is met
-1.5
>>> cs.friction.force("coulomb-stiction", 10.0, 0.3, 1.5, mu_c=0.1, mu_s=0.2)  # slides
-1.0
>>> cs.friction.pairs["cotton-skin-forearm"].static.value
0.31
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from clothsim import _core
from clothsim._arrays import Floats, floats, number
from clothsim._nearest import hint
from clothsim.errors import InvalidInput

__all__ = ["LAWS", "Coefficient", "Model", "Pair", "Pairs", "force", "pairs"]

Model = Literal["coulomb", "coulomb-stiction", "stribeck", "viscous"]
LAWS: tuple[Model, ...] = ("coulomb", "coulomb-stiction", "stribeck", "viscous")


def force(
    model: Model | str,
    normal_force: ArrayLike,
    tangential_velocity: ArrayLike,
    applied_force: ArrayLike = 0.0,
    *,
    mu_c: float | None = None,
    mu_s: float | None = None,
    v_s: float | None = None,
    delta_s: float | None = None,
    f_v: float | None = None,
    delta_v: float | None = None,
    area: ArrayLike = 1.0,
) -> Any:
    """Force of friction on a body that slides on another or is pulled along it.

    Sliding, with the speed s = |v|: F = −F_k(s) v/s, where

    F_k(s) = N (μ_c + (μ_s − μ_c) exp(−(s/v_s)^δ_s)) + A f_v s^δ_v,

    of which ``coulomb`` and ``coulomb-stiction`` have μ_c N alone and ``stribeck`` all but the last term. At rest
    F = −F_e while |F_e| ≤ μ_s N (μ_c N for ``coulomb``), else −μ_s N F_e/|F_e|.

    The last axis of a velocity or an applied force holds 1, 2 or 3 components; a plain number is motion along a line,
    and n motions along a line have the shape (n, 1). All arguments broadcast.

    Parameters
    ----------
    model : {"coulomb", "coulomb-stiction", "stribeck", "viscous"}
        The law.
    normal_force : float or (n,) array
        N, with which the surfaces are pressed together [N], ≥ 0.
    tangential_velocity : float or (n, 3), (n, 2) or (n, 1) array
        v of the body relative to the other [m/s].
    applied_force : float or array of as many components
        F_e, all tangential force on the body but friction [N]; read only where v = 0.
    mu_c, mu_s : float
        Coefficient of sliding, ≥ 0, and at rest, ≥ ``mu_c``; ``coulomb`` has ``mu_c`` alone.
    v_s, delta_s : float
        Stribeck speed [m/s], > 0, and shape, in (0, 2]; ``stribeck`` and ``viscous``.
    f_v, delta_v : float
        Viscous coefficient [N/m² (s/m)^δ_v], ≥ 0, and exponent, in (0, 2]; ``viscous``.
    area : float or (n,) array
        A, over which the surfaces touch [m²], ≥ 0; only the viscous term depends on it.

    Returns
    -------
    float or array of float64
        F [N], of the velocity's shape broadcast with the other arguments.

    Raises
    ------
    InvalidInput
        The law is not known (the nearest is named), a parameter is missing, out of range or not the law's, an array is
        not finite, negative or of another shape.

    References
    ----------
    Wong 2014, Equations 7.1 to 7.7. F_v is printed there without a mass or an area; here it is per area of contact.

    Examples
    --------
    >>> import clothsim as cs
    >>> cs.friction.force("viscous", 1.0, [[0.4, 0.0, 0.0], [0.0, 0.0, 0.8]], mu_c=0.1, mu_s=0.2, v_s=0.4, delta_s=0.2,
    ...                   f_v=0.5, delta_v=1.0).round(4)
    array([[-0.3368,  0.    ,  0.    ],
           [ 0.    ,  0.    , -0.5317]])
    """
    given = {"mu_c": mu_c, "mu_s": mu_s, "v_s": v_s, "delta_s": delta_s, "f_v": f_v, "delta_v": delta_v}
    keys = {key: None if value is None else number(value, key) for key, value in given.items()}
    velocity, pull = _vectors(tangential_velocity, "tangential_velocity"), _vectors(applied_force, "applied_force")
    pressed, touching = _sizes(normal_force, "normal_force", "N"), _sizes(area, "area", "m²")
    plain = np.ndim(tangential_velocity) == 0 and np.ndim(applied_force) == 0
    if pull.shape[-1] != velocity.shape[-1] and not (np.ndim(applied_force) == 0 and not pull.any()):
        expected, got = f"{velocity.shape[-1]} components, as the velocity has", f"{pull.shape[-1]}"
        raise _wrong("applied_force", expected, got)
    try:
        rows = np.broadcast_shapes(velocity.shape[:-1], pull.shape[:-1], pressed.shape, touching.shape)
    except ValueError as error:
        shapes = ", ".join(str(array.shape) for array in (pressed, velocity, pull, touching))
        expected, got = "arguments that broadcast", f"normal force, velocity, applied force and area of {shapes}"
        raise _wrong("normal_force", expected, got) from error
    count = velocity.shape[-1]
    result: Floats = _core.friction_force(
        str(model), _column(pressed, rows), _rows(velocity, rows), _rows(pull, rows), _column(touching, rows), **keys
    )
    # No negative zeros.
    result = result[:, :count].reshape(*rows, count) + 0.0
    if not plain:
        return result
    return float(result[0]) if not rows else result[..., 0]


def _vectors(value: ArrayLike, name: str) -> Floats:
    """Array whose last axis has 1 to 3 components."""
    array = floats(value, name, "shape (n, 3), (n, 2), (n, 1) or a number")
    if not np.isfinite(array).all():
        raise _wrong(name, "finite numbers", _first(array, ~np.isfinite(array)))
    if np.ndim(value) == 0:
        return array.reshape(1)
    if array.shape[-1] not in (1, 2, 3):
        expected = "1, 2 or 3 components along the last axis (motions along a line have the shape (n, 1))"
        raise _wrong(name, expected, f"shape {array.shape}")
    return array


def _sizes(value: ArrayLike, name: str, unit: str) -> Floats:
    array = floats(value, name, "a number or shape (n,)")
    array = array.reshape(()) if np.ndim(value) == 0 else array
    bad = ~(np.isfinite(array) & (array >= 0.0))
    if bad.any():
        raise _wrong(name, f"finite numbers ≥ 0 [{unit}]", _first(array, bad))
    return array


def _first(array: Floats, bad: np.ndarray[Any, np.dtype[np.bool_]]) -> str:
    at = tuple(int(i) for i in np.argwhere(bad)[0])
    return f"{array[at]}" + (f" at {list(at)}" if array.ndim and array.size > 1 else "")


def _column(array: Floats, rows: tuple[int, ...]) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(array, rows)).reshape(-1)


def _rows(array: Floats, rows: tuple[int, ...]) -> Floats:
    """Vectors of three components, one per row."""
    count = array.shape[-1]
    out = np.zeros((int(np.prod(rows, dtype=int)), 3))
    out[:, :count] = np.broadcast_to(array, (*rows, count)).reshape(-1, count)
    return out


def _wrong(name: str, expected: str, got: str) -> InvalidInput:
    return InvalidInput(f"{name}: expected {expected}, got {got}", name=name, expected=expected, got=got)


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of friction and where it comes from.

    Parameters
    ----------
    value : float
        The coefficient [-].
    kind : {"published", "second-hand", "estimate"}
        Read where it was published; attributed to a publication, but not read there; not measured on this pair.
    source : str
        Key of the reference, as in ``REFERENCES.bib``; empty for an estimate.
    note : str
        Where in the reference, or what the estimate rests on.
    """

    value: float
    kind: Literal["published", "second-hand", "estimate"]
    source: str
    note: str

    def __float__(self) -> float:
        return self.value

    @property
    def is_estimate(self) -> bool:
        """Whether the value was not measured on this pair."""
        return self.kind == "estimate"

    def __str__(self) -> str:
        return f"{self.value:.4g} ({self.kind}: {f'{self.source}, ' if self.source else ''}{self.note})"


@dataclass(frozen=True)
class Pair:
    """Two surfaces and their coefficients of friction; in a scene a value of ``friction`` or ``self_friction``.

    Parameters
    ----------
    name, about : str
        Its name, and what slides on what.
    static, kinetic : Coefficient
        μ_s, at which sliding starts, and μ_c, of sliding.

    Examples
    --------
    >>> import clothsim as cs
    >>> skin = cs.friction.pairs["cotton-skin-forearm"]
    >>> skin.to_dict()
    {'pair': 'cotton-skin-forearm'}
    >>> print(skin.kinetic)
    0.25 (published: temel2022, abstract, dorsal forearm, ±0.05)
    """

    name: str
    about: str
    static: Coefficient
    kinetic: Coefficient

    def to_dict(self) -> dict[str, str]:
        """Return the table that a scene file has for this pair: Coulomb's law with stiction."""
        return {"pair": self.name}

    @property
    def coefficients(self) -> dict[str, float]:
        """``mu_c`` and ``mu_s``, as `force` takes them."""
        return {"mu_c": self.kinetic.value, "mu_s": self.static.value}

    def __str__(self) -> str:
        return f"{self.name}: {self.about}\n  static: {self.static}\n  kinetic: {self.kinetic}"


class Pairs(Mapping[str, Pair]):
    """Pairs of surfaces by name: ``clothsim.friction.pairs``.

    Examples
    --------
    >>> import clothsim as cs
    >>> cs.friction.pairs["denim-denim"].kinetic.kind
    'estimate'
    >>> scene = cs.Scene(contact={"friction": cs.friction.pairs["cotton-skin-forearm"]})
    """

    def __init__(self) -> None:
        rows = json.loads(_core.friction_pairs())
        self._pairs = {
            row["name"]: Pair(row["name"], row["about"], Coefficient(**row["static"]), Coefficient(**row["kinetic"]))
            for row in rows
        }

    def names(self) -> list[str]:
        """Names in alphabetical order."""
        return list(self._pairs)

    def sources(self) -> dict[str, str]:
        """References by key: authors, year, title, and how the values were read."""
        return dict(_core.friction_sources())

    def __getitem__(self, name: str) -> Pair:
        try:
            return self._pairs[name]
        except KeyError as error:
            raise KeyError(
                f"expected one of {', '.join(self._pairs)}, got {name!r}{hint(name, self._pairs, 0.6)}"
            ) from error

    def __iter__(self) -> Iterator[str]:
        return iter(self._pairs)

    def __len__(self) -> int:
        return len(self._pairs)

    def __repr__(self) -> str:
        return f"pairs({', '.join(self._pairs)})"


pairs = Pairs()
