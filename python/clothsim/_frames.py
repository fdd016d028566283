"""Frames of a run: how long each of them lasts, and which positions it keeps."""

from __future__ import annotations

import math

import numpy as np

from clothsim._arrays import Floats
from clothsim.errors import InvalidInput
from clothsim.recording import Body

__all__ = ["frame_lengths", "moving_positions", "standing_positions"]


def frame_lengths(seconds: float, fps: float) -> list[float]:
    """Time from each frame to the next [s]: 1/fps, the last one shorter where ``seconds`` ends within a frame."""
    rounding = 1e-9  # a whole number of frames but for rounding makes no extra frame
    for name, value in (("seconds", seconds), ("fps", fps)):
        if not (math.isfinite(value) and (value > 0.0 if name == "fps" else value >= 0.0)):
            expected = "a finite number > 0 [1/s]" if name == "fps" else "a finite number ≥ 0 [s]"
            raise InvalidInput(
                f"{name}: expected {expected}, got {value}", name=name, expected=expected, got=str(value)
            )
    count = math.ceil(seconds * fps - rounding)
    lengths = [1.0 / fps] * count
    whole = math.floor(seconds * fps + rounding)
    if count > whole:
        lengths[-1] = seconds - whole / fps
    return lengths


def moving_positions(bodies: list[Body], cloth: Floats, colliders: Floats) -> Floats:
    """Positions of what is not static: all cloth, then the colliders that move."""
    return np.concatenate([cloth, *_collider_parts(bodies, colliders, static=False)])


def standing_positions(bodies: list[Body], colliders: Floats) -> Floats:
    """Positions of the colliders that stand still."""
    return np.concatenate([np.zeros((0, 3)), *_collider_parts(bodies, colliders, static=True)])


def _collider_parts(bodies: list[Body], positions: Floats, *, static: bool) -> list[Floats]:
    parts, first = [], 0
    for body in bodies:
        if body.kind == "collider":
            if body.static == static:
                parts.append(positions[first : first + body.vertex_count])
            first += body.vertex_count
    return parts
