"""The colour maps of views: what they show, in which unit, with which colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clothsim._nearest import hint
from clothsim.errors import InvalidInput

__all__ = ["CONTACT_COLOURS", "MAPS", "ColourMap", "colour_map", "nice_ceiling", "rgb", "table"]

# On no other surface, on cloth, on a collider.
CONTACT_COLOURS = ("#dcd7cc", "#c8442f", "#2f6fa8")


@dataclass(frozen=True)
class ColourMap:
    """What is shown.

    Attributes
    ----------
    name : str
        As on the command line.
    label, unit : str
        For the colour bar.
    scale : float
        Values in the unit per value in SI.
    anchors : tuple of str
        Colours at equal distances from the lowest to the highest value; empty where the values are classes.
    """

    name: str
    label: str
    unit: str
    scale: float
    anchors: tuple[str, ...]


MAPS = {
    "none": ColourMap("none", "cloth", "", 1.0, ()),
    "strain": ColourMap(
        "strain", "largest principal strain", "%", 100.0,
        ("#f6f1e4", "#f7d796", "#f2a65a", "#dd6b4a", "#b53a58", "#752060", "#37114a"),
    ),
    "contact": ColourMap("contact", "contact", "", 1.0, ()),
    "speed": ColourMap(
        "speed", "speed", "m/s", 1.0, ("#eef2ee", "#c3dfd8", "#86c0c6", "#4a97b6", "#2c689c", "#223f78", "#191d4a"),
    ),
    "height": ColourMap(
        "height", "height", "m", 1.0, ("#2d2f63", "#2c5b86", "#2f8a8f", "#6bb087", "#b9cf86", "#efe3a1", "#fdf7e3"),
    ),
}  # fmt: skip


def colour_map(name: str) -> ColourMap:
    """Return the colour map of that name.

    Raises
    ------
    InvalidInput
        There is none; the nearest name is given.
    """
    if name in MAPS:
        return MAPS[name]
    expected = f"one of {', '.join(MAPS)}"
    raise InvalidInput(
        f"--color: expected {expected}, got {name!r}{hint(name, MAPS)}", name="--color", expected=expected, got=name
    )


def rgb(colour: str) -> tuple[int, int, int]:
    """``"#rrggbb"`` as three numbers from 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def table(found: ColourMap, count: int = 256) -> NDArray[np.uint8]:
    """Colours of ``count`` equal steps from the lowest to the highest value, (count, 3)."""
    anchors = np.array([rgb(colour) for colour in found.anchors], dtype=np.float64)
    at = np.linspace(0.0, len(anchors) - 1.0, count)
    channels = [np.interp(at, np.arange(len(anchors)), anchors[:, k]) for k in range(3)]
    return np.rint(np.stack(channels, axis=1)).astype(np.uint8)


def nice_ceiling(value: float) -> float:
    """Return the least of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not below ``value``; 1 for 0."""
    if not value > 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    for step in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0):
        if value <= step * power * (1.0 + 1e-9):
            return float(step * power)
    return float(10.0 * power)
