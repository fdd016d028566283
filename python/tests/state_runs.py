"""A small run that keeps states, for the tests of states."""

from __future__ import annotations

from typing import Any

import clothsim as cs

__all__ = ["BALL", "HYSTERESIS", "OUTPUT", "falling"]

HYSTERESIS = {"fabric": "cotton", "bending": "hysteresis", "plasticity": 0.1, "fatigue": 0.02}
OUTPUT = {
    "fps": 40, "states": 3, "obj": True, "velocities": True, "usd": False, "film_strip": False, "plots": False,
    "checkpoint_interval": 0.05,
}  # fmt: skip
BALL: dict[str, Any] = {
    "name": "ball",
    "shape": {"type": "sphere", "radius": 0.2, "tolerance": 0.01},
    "keyframes": [
        {"time": 0.0, "rotation": {"axis": [0, 1, 0], "angle": 0.0}},
        {"time": 0.5, "rotation": {"axis": [0, 1, 0], "angle": 2.0}},
    ],
}


def falling(
    *, cloth: dict[str, Any] | None = None, ball: dict[str, Any] | None = None, post: bool = False, **keys: Any
) -> cs.Scene:
    """Cloth that falls on a ball that turns: 10 frames and a last one that is shorter."""
    keys = {"duration": 0.26, "time": {"dt": 0.005}, "contact": {"thickness": 0.006, "friction": 0.3}, **keys}
    scene = cs.Scene(name="falling", output={**OUTPUT, **keys.pop("output", {})}, **keys)
    mesh = {"generator": "grid", "width": 0.6, "height": 0.6, "nx": 11, "ny": 11}
    table = {"mesh": mesh, "material": HYSTERESIS, "name": "cloth", "position": (0.02, 0.215, 0.01), **(cloth or {})}
    scene.add_cloth(**table)
    if post:  # far from the cloth, and first
        shape = {"type": "sphere", "radius": 0.02, "tolerance": 0.005}
        scene.add_collider("post", shape=shape, position=(0.0, 2.0, 0.0))
    scene.add_collider(**{**BALL, **(ball or {})})
    return scene
