"""What a recording keeps of its scene."""

from __future__ import annotations

import json
from collections.abc import Container
from typing import Any, Literal

import numpy as np

from clothsim import _core
from clothsim._arrays import Ints
from clothsim.recording import Body

__all__ = ["bodies_of", "contact_thickness", "rest_source"]


def contact_thickness(scene: dict[str, Any]) -> float | None:
    """Distance up to which surfaces of a scene are in contact [m]; None in a scene without contact."""
    contact = scene.get("contact")
    return None if contact is None else float(contact["thickness"])


def rest_source(scene: dict[str, Any], cloth: dict[str, Any]) -> Literal["uv", "start"] | None:
    """Where a recording of a scene finds the undeformed shape of a cloth; None where nothing in it has that shape."""
    if cloth.get("rest", "mesh") == "uv":
        return "uv"
    return "start" if scene.get("start", "as-given") == "as-given" else None


def bodies_of(core: _core.Simulation) -> list[Body]:
    """Names and meshes of the bodies of a simulation, cloth first, in scene order."""
    scene = json.loads(core.scene())
    moving = {c["name"] for c in scene["collider"] if c.get("keyframes") or c.get("sequence")}
    rests = {c["name"]: rest_source(scene, c) for c in scene["cloth"]}
    regions: dict[int, dict[str, Ints]] = {}
    for number, region, own in core.regions():
        named = regions.setdefault(number, {})
        named[_region_name(scene["cloth"][number]["regions"][region], region, named)] = own.astype(np.int64)
    bodies = []
    for number, (name, kind, (first, last), (_, triangles, uv)) in enumerate(core.bodies()):
        if kind == "cloth":
            parts = regions.get(number, {})
            bodies.append(Body(name, "cloth", last - first, triangles, uv, rest=rests[name], regions=parts))
        else:
            bodies.append(Body(name, "collider", last - first, triangles, uv, name not in moving))
    return bodies


def _region_name(region: dict[str, Any], number: int, used: Container[str]) -> str:
    """Its group's name, else its fabric's, else its number; with numbers behind it where that is taken."""
    material = region["material"]
    fabric = material if isinstance(material, str) else material.get("fabric")
    name = str(region.get("group") or fabric or f"region {number}")
    while name in used:
        name = f"{name} {number}"
    return name
