"""What cloth is made of, and a library of fabrics by name.

Examples
--------
>>> import clothsim as cs
>>> "cotton" in cs.materials.names()
True
>>> cs.materials["cotton"].areal_density > 0
True
"""

from __future__ import annotations

import json
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from clothsim import _core
from clothsim._plain import plain

__all__ = ["Library", "Material", "materials"]


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
        ``{"model": "hinge", "rigidity": N m, "damping": s}``,
        ``{"model": "bending-spring", "stiffness": N/m, "damping": N s/m}`` or ``{"model": "none"}``, the default.

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


class Library(Mapping[str, Material]):
    """Fabrics by name: ``clothsim.materials``."""

    def names(self) -> list[str]:
        """Names in alphabetical order."""
        return list(_core.material_names())

    def __getitem__(self, name: str) -> Material:
        return Material(**json.loads(_core.material_named(name)))

    def __contains__(self, name: object) -> bool:
        return name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def __len__(self) -> int:
        return len(self.names())

    def __repr__(self) -> str:
        return f"materials({', '.join(self.names())})"


materials = Library()
