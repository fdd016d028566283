"""The paper's experiment sets: what each animation is, in full and as a coarse variant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce.animations.animation import Animation
from clothsim.reproduce.animations.cones import Cones
from clothsim.reproduce.animations.drape import Drape
from clothsim.reproduce.animations.garment import Garment

__all__ = ["SETS", "Listed"]


@dataclass(frozen=True)
class Listed:
    """An animation of the paper.

    Attributes
    ----------
    number : str
        As the paper counts.
    title : str
        What it shows.
    rigid, cloth : float
        Triangles in the paper's Table 1.
    full, coarse : callable
        Make it, and a variant for seconds of work.
    """

    number: str
    title: str
    rigid: float
    cloth: float
    full: Callable[[], Animation]
    coarse: Callable[[], Animation]

    def make(self, *, quick: bool) -> Animation:
        """The one or the other."""
        return self.coarse() if quick else self.full()


def _bumps(directions: Floats, _time: float) -> Floats:
    bumps: Floats = 0.03 * np.prod(np.cos(9.0 * directions), axis=1)
    return bumps


def _ridges(directions: Floats, count: float, height: float) -> Floats:
    x, y, z = directions.T
    # Ridges run from near the top down; at the top itself they would meet in a point.
    ridges: Floats = height * np.cos(count * np.arctan2(x, z)) * (1.0 - y**2) ** 2
    return ridges


def _ridged(directions: Floats, _time: float) -> Floats:
    return _ridges(directions, 9.0, 0.04)


def _breathing(directions: Floats, time: float) -> Floats:
    swell = 0.03 * np.sin(2.5 * time + 3.0 * directions[:, 1]) * np.cos(2.0 * directions[:, 0])
    breathing: Floats = _ridges(directions, 7.0, 0.04 + 0.01 * np.sin(2.0 * time)) + swell
    return breathing


def _faceted(directions: Floats, _time: float) -> Floats:
    return _ridges(directions, 4.0, 0.03)


def _fine(directions: Floats, _time: float) -> Floats:
    return _ridges(directions, 16.0, 0.02) + 0.012 * np.cos(22.0 * directions[:, 1])


def _drape(number: str, title: str, rigid: float, cloth: float, drape: Drape, coarse: Drape) -> Listed:
    return Listed(number, title, rigid, cloth, drape.animation, coarse.animation)


def _coarse(drape: Drape, cells: int = 48, body: int = 10) -> Drape:
    return replace(drape, cells=cells, body=body, pleats=4)


_BALL = Drape("spinning bumpy ball", 220, 21, pleats=12, relief=_bumps, spin=0.3)
_CARRIED = Drape("ball and cloth", 150, 29, pleats=10, slip=0.1, path=0.08)
_CONES = Cones("four cones", (260, 186))
_GARMENT = Garment("garment", 125, (50, 30))
_RIDGED = Drape("ridged ball", 400, 30, pleats=16, relief=_ridged, spin=0.2)
_SWELLING = Drape("deformable ball", 500, 24, pleats=16, relief=_breathing)
_FACETED = Drape("faceted ball", 501, 9, pleats=16, relief=_faceted, slip=0.1)
_FINE = Drape("finely ridged ball", 500, 58, pleats=16, relief=_fine, spin=0.1, path=0.04)

SETS = {
    "one": (
        _drape("one", "spinning bumpy ball", 5.2e3, 97e3, _BALL, _coarse(_BALL)),
        _drape("two", "ball and cloth", 10e3, 45e3, _CARRIED, _coarse(_CARRIED)),
        Listed("three", "four cones", 0.5e3, 97e3, _CONES.animation, replace(_CONES, cells=(80, 60)).animation),
        Listed("four", "garment on a walking figure", 34e3, 20e3, _GARMENT.animation,
               replace(_GARMENT, around=80, rows=(20, 12), capsules=(12, 4, 6)).animation),
    ),
    "two": (
        _drape("one", "ridged ball", 11e3, 320e3, _RIDGED, _coarse(_RIDGED)),
        _drape("two", "deformable body", 7e3, 500e3, _SWELLING, _coarse(_SWELLING)),
        _drape("three", "faceted body", 1e3, 502e3, _FACETED, _coarse(_FACETED, body=6)),
        _drape("four", "finely ridged body", 40e3, 500e3, _FINE, _coarse(_FINE, body=16)),
    ),
}  # fmt: skip
