"""What a recording keeps of its scene."""

from __future__ import annotations

from typing import Any, Literal

__all__ = ["contact_thickness", "rest_source"]


def contact_thickness(scene: dict[str, Any]) -> float | None:
    """Distance up to which surfaces of a scene are in contact [m]; None in a scene without contact."""
    contact = scene.get("contact")
    return None if contact is None else float(contact["thickness"])


def rest_source(scene: dict[str, Any], cloth: dict[str, Any]) -> Literal["uv", "start"] | None:
    """Where a recording of a scene finds the undeformed shape of a cloth; None where nothing in it has that shape."""
    if cloth.get("rest", "mesh") == "uv":
        return "uv"
    return "start" if scene.get("start", "as-given") == "as-given" else None
