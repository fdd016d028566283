"""Pleats so deep that they bulge over each other.

A cloth folded along p ↦ p lies at p + b sin 2p, with a height of cos p: for b > 1/2 it turns back on its way between
crest (p = 0) and trough (p = π). The wall of a crest reaches farthest at p* = arccos(−1/(2b))/2, where it comes nearest
to the wall of the next; at b ≈ 2.3 they touch.
"""

from __future__ import annotations

import math

import numpy as np

from clothsim._arrays import Floats

__all__ = ["WALL", "bulge"]

WALL = 0.62  # cos p* where walls touch
_BULGES = np.linspace(1.0, 2.4, 400)
_PHASES = 0.5 * np.arccos(-0.5 / _BULGES)
_LEFT = math.pi - (_PHASES + _BULGES * np.sin(2.0 * _PHASES))


def bulge(left: Floats) -> Floats:
    """The b that leaves so much phase [rad] between a wall and the middle between two pleats."""
    found: Floats = np.interp(-left, -_LEFT, _BULGES)
    return found
