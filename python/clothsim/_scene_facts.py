"""What a recording keeps of its scene."""

from __future__ import annotations

import json
from typing import Any, Literal

from clothsim import _core
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
    bodies = []
    for name, kind, (first, last), (_, triangles, uv) in core.bodies():
        if kind == "cloth":
            bodies.append(Body(name, "cloth", last - first, triangles, uv, rest=rests[name]))
        else:
            bodies.append(Body(name, "collider", last - first, triangles, uv, name not in moving))
    return bodies
