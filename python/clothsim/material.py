"""What cloth is made of, and a library of fabrics by name.

Examples
--------
>>> import clothsim as cs
>>> "cotton" in cs.materials.names()
True
>>> cs.materials["cotton"].areal_density > 0
True
>>> cs.materials.material("cotton", bending="hysteresis", plasticity=0.1).bending["model"]
'hysteresis'
"""

from __future__ import annotations

import json
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from clothsim import _core
from clothsim._plain import plain

__all__ = ["Fabric", "Library", "Material", "Value", "materials"]


@dataclass(frozen=True)
class Material:
    """A fabric: mass per area, resistance to stretch and shear, resistance to bending.

    Parameters
    ----------
    areal_density : float
        Mass per area [kg/m²], > 0.
    in_plane : mapping
        ``{"model": "baraff-witkin", "warp": N/m, "weft": N/m, "shear": N/m, "damping": s}`` or
        ``{"model": "spring", "stiffness": N/m, "damping": N s/m}``.
    bending : mapping, optional
        ``{"model": "none"}``, the default; ``{"model": "hinge", "rigidity": N m, "damping": s}``;
        ``{"model": "bending-spring", "stiffness": N/m, "damping": N s/m}``;
        ``{"model": "nonlinear", "rigidity": N m, "coercive_couple": N m/m, "transition_curvature": 1/m, "damping": s}``
        or with ``b1``, ``b2`` [N m] and ``c1`` [N m²] in place of the three;
        ``{"model": "plastic", "rigidity": N m, "elastic_limit": 1/m, "hardening": N m, "damping": s}``;
        ``{"model": "hysteresis", ...}``: as nonlinear, with ``plasticity`` and ``fatigue`` from 0 to 1.

    Raises
    ------
    InvalidInput
        A key is not known or missing, a value is negative or not finite, the density is not positive.

    Examples
    --------
    >>> import clothsim as cs
    >>> silk = cs.Material(0.08, {"model": "baraff-witkin", "warp": 800, "weft": 700, "shear": 20})
    >>> silk.in_plane["damping"]
    0.0
    """

    areal_density: float
    in_plane: Mapping[str, Any]
    bending: Mapping[str, Any] = field(default_factory=lambda: {"model": "none"})

    def __post_init__(self) -> None:
        checked = json.loads(_core.check_material(json.dumps(self._keys())))
        for key, value in checked.items():
            object.__setattr__(self, key, types.MappingProxyType(value) if isinstance(value, dict) else value)

    def _keys(self) -> dict[str, Any]:
        keys = {"areal_density": self.areal_density, "in_plane": self.in_plane, "bending": self.bending}
        return {key: plain(value, f"material.{key}") for key, value in keys.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return the table that a scene file has for this material."""
        return self._keys()

    def __reduce__(self) -> tuple[Any, ...]:
        return (Material, (self.areal_density, dict(self.in_plane), dict(self.bending)))


@dataclass(frozen=True)
class Value:
    """A value of a fabric with its unit and its source.

    Parameters
    ----------
    value : float
        The value in ``unit``.
    unit : str
        SI unit; ``"1"`` for a pure number.
    source : str
        Key of the reference it is published in, as in ``REFERENCES.bib``; empty for an estimate.
    note : str
        Where in the reference, or what the estimate rests on.
    """

    value: float
    unit: str
    source: str
    note: str

    @property
    def is_estimate(self) -> bool:
        """Whether the value was not measured on this fabric."""
        return not self.source

    def __str__(self) -> str:
        return f"{self.value:.4g} {self.unit} ({f'{self.source}, ' if self.source else 'estimate: '}{self.note})"


@dataclass(frozen=True)
class Fabric:
    """What the library knows of a fabric: :meth:`Library.fabric`.

    Parameters
    ----------
    name, about : str
        Its name in the library, and what it is.
    areal_density : Value
        Mass per area [kg/m²].
    thickness : Value or None
        Thickness under the light pressure of a gauge [m].
    tensile_warp, tensile_weft : Value
        Stiffness along warp and weft per width [N/m].
    shear : Value
        Shear force per width over shear angle [N/m].
    bending_rigidity : Value
        Rigidity B per width, the slope once friction is overcome [N m].
    coercive_couple : Value
        2HB per width: the gap between the straight sides of the loop [N m/m].
    transition_curvature : Value
        Curvature at which the first loading becomes straight [1/m].
    friction : Value or None
        Kinetic friction coefficient on itself.
    in_plane_damping, bending_damping : Value
        Damping times [s].
    """

    name: str
    about: str
    areal_density: Value
    tensile_warp: Value
    tensile_weft: Value
    shear: Value
    bending_rigidity: Value
    coercive_couple: Value
    transition_curvature: Value
    in_plane_damping: Value
    bending_damping: Value
    thickness: Value | None = None
    friction: Value | None = None

    def values(self) -> dict[str, Value]:
        """Return the known values by name."""
        known = ((f.name, getattr(self, f.name)) for f in fields(self))
        return {name: value for name, value in known if isinstance(value, Value)}

    def __str__(self) -> str:
        lines = (f"  {name}: {value}" for name, value in self.values().items())
        return "\n".join([f"{self.name}: {self.about}", *lines])


class Library(Mapping[str, Material]):
    """Fabrics by name: ``clothsim.materials``.

    Examples
    --------
    >>> import clothsim as cs
    >>> cs.materials["linen"].bending["model"]
    'hinge'
    >>> print(cs.materials.fabric("wool-tropical").coercive_couple)
    0.0003236 N m/m (matsudaira2015, table 1, fabric B)
    """

    def names(self) -> list[str]:
        """Names in alphabetical order."""
        return list(_core.material_names())

    def laws(self) -> list[str]:
        """Bending laws that :meth:`material` knows."""
        return list(_core.bending_laws())

    def sources(self) -> dict[str, str]:
        """References of the published values by key: authors, year, title, and how the values were read."""
        return dict(_core.fabric_sources())

    def fabric(self, name: str) -> Fabric:
        """All values of the fabric called ``name``, each with its unit and source.

        Parameters
        ----------
        name : str
            A fabric of the library.

        Raises
        ------
        InvalidInput
            There is no fabric of this name.

        Examples
        --------
        >>> import clothsim as cs
        >>> cotton = cs.materials.fabric("cotton")
        >>> cotton.areal_density
        Value(value=0.1503, unit='kg/m²', source='penava2014', note='table 1')
        >>> cotton.shear.is_estimate
        True
        """
        facts = json.loads(_core.fabric(name))
        values = {
            key: Value(row["value"], row["unit"], row["key"], row["note"]) for key, row in facts["values"].items()
        }
        return Fabric(name=facts["name"], about=facts["about"], **values)

    def material(self, name: str, bending: str = "linear", **parameters: float) -> Material:
        """Return the fabric called ``name`` under a law of bending.

        Parameters
        ----------
        name : str
            A fabric of the library.
        bending : {"none", "linear", "nonlinear", "hysteresis"}
            ``linear`` has the bending rigidity alone; ``nonlinear`` and ``hysteresis`` have the measured loop.
        **parameters : float
            Keys of the law to set or to change, as in :class:`Material`: ``plasticity`` and ``fatigue`` [0 to 1],
            ``damping`` [s], ``rigidity`` [N m], ...

        Raises
        ------
        InvalidInput
            There is no such fabric, law or key, or a value is out of range.

        Examples
        --------
        >>> import clothsim as cs
        >>> crease = cs.materials.material("cotton", bending="hysteresis", plasticity=0.1)
        >>> crease.bending["plasticity"]
        0.1
        >>> cs.materials.material("cotton") == cs.materials["cotton"]
        True
        """
        keys = json.loads(_core.material_named(name, bending))
        keys["bending"] = {**keys["bending"], **parameters}
        return Material(**keys)

    def __getitem__(self, name: str) -> Material:
        return self.material(name)

    def __contains__(self, name: object) -> bool:
        return name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def __len__(self) -> int:
        return len(self.names())

    def __repr__(self) -> str:
        return f"materials({', '.join(self.names())})"


materials = Library()
