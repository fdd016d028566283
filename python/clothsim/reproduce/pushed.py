"""A sheet pushed through a funnel and the layers of a dancing figure's skirt: meshes in motion, made from formulas."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.errors import InvalidInput
from clothsim.reproduce import mannequin
from clothsim.reproduce.moving import Moving, joined, length_of, sheet, whole

__all__ = ["funnel", "skirt"]

# The funnel --------------------------------------------------------------------------------------------------------

_THROAT = 0.145  # radius of the tube over the side of the sheet
_TUBE, _CONE = 0.55, 0.75  # length of the tube, and of the cone along its wall, over the side
_GAP = 0.006  # between sheet and wall, over the side
_FOLDS = 20
_DEEP = (0.1, 0.42)  # way of the sheet's middle into the tube at the first and last step, over the side
_FRAME = 0.004  # way in one step, over the side
_PINCH = (0.9, 1.1)  # of the folds at both ends of the last step: from 1 on they turn over
_AROUND, _ALONG = 32, 3  # cells of the tube and of the cone


def funnel(cells: int = 96, *, side: float = 1.0, steps: int = 3) -> Moving:
    """A square sheet pushed through a funnel, middle first; it gathers in folds that keep the length of its rings.

    Parameters
    ----------
    cells : int
        Along each side of the sheet, ≥ 48; 2 triangles each. The funnel has 384 large ones.
    side : float
        Of the sheet [m].
    steps : int
        How many, ≥ 1. In the last the folds are pinched and pushed against the wall, until both are in contact.
    """
    cells, steps = whole(cells, "cells", 48), whole(steps, "steps", 1)
    side = length_of(side, "side")
    wall, wall_triangles = _wall()
    u = np.linspace(-0.5, 0.5, cells + 1)
    z, x = (index.ravel() for index in np.meshgrid(u, u, indexing="ij"))
    triangles = joined([sheet(cells, cells), wall_triangles], [len(x), len(wall)])

    def at(deep: float, gap: float = _GAP, pinch: float = 0.0) -> Floats:
        return side * np.concatenate([_pushed(x, z, deep, gap, pinch), wall])

    frames = [(at(deep), at(deep + _FRAME)) for deep in np.linspace(*_DEEP, steps)[:-1]] if steps > 1 else []
    return Moving(triangles, (*frames, (at(_DEEP[1], _GAP, _PINCH[0]), at(_DEEP[1] + _FRAME, -0.1 * _GAP, _PINCH[1]))))


def _wall() -> tuple[Floats, Ints]:
    profile = [(_THROAT, -_TUBE * (1.0 - k / _ALONG)) for k in range(_ALONG)]
    slope = math.sqrt(0.5) * _CONE
    profile += [(_THROAT + slope * k / _ALONG, slope * k / _ALONG) for k in range(_ALONG + 1)]
    angles = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    # Corners outside, so that the flat sides keep clear of the round sheet.
    out = 1.0 / math.cos(math.pi / _AROUND)
    rings = [np.stack([out * r * np.cos(angles), np.full(_AROUND, y), out * r * np.sin(angles)], 1) for r, y in profile]
    return np.concatenate(rings), sheet(len(profile) - 1, _AROUND, closed=True)


def _pushed(x: Floats, z: Floats, deep: float, gap: float, pinch: float) -> Floats:
    """The sheet with its middle ``deep`` in the tube: rings about the middle become rings along the funnel."""
    rho, phi = np.hypot(x, z), np.arctan2(z, x)
    radius = _THROAT - gap

    # Along the tube, then along the cone; the middle bulges downward.
    def beyond(rho: Floats) -> Floats:
        return np.asarray(np.maximum(rho - radius - deep, 0.0) * math.sqrt(0.5))

    table = np.linspace(0.0, float(rho.max()), 500)
    fold = np.interp(rho, table, _fold_depth(table, np.minimum(table, radius) + beyond(table)))
    outer = np.minimum(rho, radius) + beyond(rho)
    height = np.minimum(np.maximum(rho - radius, 0.0), deep) - deep + beyond(rho)
    height -= 0.5 * np.sqrt(np.maximum(radius**2 - rho**2, 0.0))
    turned = phi + pinch / _FOLDS * np.sin(_FOLDS * phi)
    r = outer - 0.5 * fold * (1.0 - np.cos(_FOLDS * phi))
    return np.stack([r * np.cos(turned), height, r * np.sin(turned)], axis=1)


def _fold_depth(rho: Floats, outer: Floats) -> Floats:
    """How deep the folds of a ring have to be for its length 2πρ, when it is as wide as ``outer``."""
    low, high = np.zeros_like(rho), outer.copy()
    t = (np.arange(64) + 0.5) * np.pi / 64.0  # half a fold
    for _ in range(30):
        depth = 0.5 * (low + high)
        r = outer[:, None] - 0.5 * depth[:, None] * (1.0 - np.cos(t))
        slope = 0.5 * _FOLDS * depth[:, None] * np.sin(t)
        short = np.sqrt(r * r + slope * slope).mean(axis=1) < rho
        low, high = np.where(short, depth, low), np.where(short, high, depth)
    return np.asarray(low)


# The skirt ---------------------------------------------------------------------------------------------------------

_LENGTH, _FLARE = 0.5, 0.26  # of a layer [m]
_EASE, _APART = 0.012, 0.011  # from the figure, and between layers [m]
_RUFFLES, _RUFFLE = 9, 0.045  # number, and depth at the hem [m]
_TURN, _SWAY = 0.9, 0.05  # of the hem behind the waist [rad], and to the side [m]
_START, _PERIOD = 2.0, 1.05  # of the steps drawn [s]
_FRAME_TIME = 1.0 / 120.0  # of one step [s]
_SHORTENED = 1.35  # radii of a limb, cut off both of its ends
_SLENDER = 0.6  # of the trunk's radii
_TRUNK, _LEFT_OUT = ("pelvis", "belly", "chest"), ("shoulders", "neck")
_CAPSULE = (24, 6)  # triangles around, and from its end to its equator
_BUMP = 0.75  # of the distance between layers, by which each meets the next in the last step


def skirt(around: int = 160, rows: int = 32, layers: int = 4, *, steps: int = 3) -> Moving:
    """A figure of capsules that dances in a skirt of several layers.

    The capsules are those of `mannequin`, shortened and slimmed so that they do not overlap; the layers turn and sway
    behind the hips.

    Parameters
    ----------
    around : int
        Vertices in each ring, ≥ 48, even.
    rows : int
        Cells from waist to hem, ≥ 4.
    layers : int
        How many, ≥ 2.
    steps : int
        How many, ≥ 1, over one period of the dance. In the last, waves run into neighbouring layers.
    """
    around, rows = whole(around, "around", 48), whole(rows, "rows", 4)
    if around % 2:
        expected = "an even number ≥ 48"
        raise InvalidInput(
            f"around: expected {expected}, got {around}", name="around", expected=expected, got=str(around)
        )
    layers, steps = whole(layers, "layers", 2), whole(steps, "steps", 1)
    body, body_triangles = _figure(_START)
    one = sheet(rows, around, closed=True)
    count = (rows + 1) * around
    triangles = joined([*[one] * layers, body_triangles], [*[count] * layers, len(body)])

    def at(time: float, bump: float = 0.0) -> Floats:
        cloth = [_layer(time, around, rows, k, bump * (-1.0) ** k) for k in range(layers)]
        return np.concatenate([*cloth, _figure(time)[0]])

    times = [_START + _PERIOD * k / steps for k in range(steps)]
    frames = [(at(t), at(t + _FRAME_TIME, _BUMP if t == times[-1] else 0.0)) for t in times]
    return Moving(triangles, tuple(frames))


def _layer(time: float, around: int, rows: int, number: int, bump: float) -> Floats:
    """A layer of the skirt; layers share their ruffles, so that they lie in each other."""
    place, turn = mannequin.frame(_dance(time))
    part = np.repeat(np.arange(rows + 1) / rows, around)
    ring = mannequin.stadium(mannequin.PELVIS[0] + _EASE, mannequin.PELVIS[1], around)
    x, z = np.tile(ring[:, 0], rows + 1), np.tile(ring[:, 1], rows + 1)
    length = np.hypot(x, z)
    phi = np.arctan2(x, z)
    phase = 2.0 * math.pi * time / _PERIOD
    lag = _TURN * math.sin(phase) * part**1.5
    ruffle = _RUFFLE * part * np.sin(_RUFFLES * phi + 2.0 * phase + 3.0 * part)
    waves = bump * _APART * np.sin(math.pi * part) * np.sin(23.0 * phi)
    r = length + _FLARE * part + ruffle + _APART * number + waves
    sway = _SWAY * part**2 * math.cos(phase)
    local = np.stack([r * np.sin(phi + lag) + sway, mannequin.WAIST - _LENGTH * part, r * np.cos(phi + lag)], axis=1)
    return np.asarray(place + local @ turn.T)


_WALK = mannequin.Walk(period=_PERIOD, start=0.0, stride=0.22)


def _dance(time: float) -> mannequin.Pose:
    """Small steps, the arms raised."""
    phase = 2.0 * math.pi * time / _PERIOD
    arms = (2.3 + 0.2 * math.sin(phase), 2.3 - 0.2 * math.sin(phase))
    return replace(_WALK(time), shoulder=arms, elbow=(0.5, 0.5))


def _figure(time: float) -> tuple[Floats, Ints]:
    around, ends = _CAPSULE
    points, triangles = [], []
    latitude = np.concatenate([-np.arange(ends, -1, -1), np.arange(ends + 1)]) * (0.5 * math.pi / ends)
    for name, (middle, rotation, wide, half) in mannequin.capsules(_dance(time)).items():
        if name in _LEFT_OUT:
            continue
        radius = wide * _SLENDER if name in _TRUNK else wide
        straight = half if name in (*_TRUNK, "head") else half - _SHORTENED * radius
        angle = 2.0 * np.pi * np.arange(around) / around
        # The poles are small rings: a capsule is a tube whose ends are almost closed.
        shrink = np.maximum(np.cos(latitude), 0.15) * radius
        rise = np.sin(latitude) * radius + np.where(np.arange(len(latitude)) <= ends, -straight, straight)
        rings = [
            np.stack([a * np.cos(angle), np.full(around, y), a * np.sin(angle)], axis=1)
            for a, y in zip(shrink, rise, strict=True)
        ]
        points.append(middle + np.concatenate(rings) @ rotation.T)
        triangles.append(sheet(len(rings) - 1, around, closed=True))
    return np.concatenate(points), joined(triangles, [len(p) for p in points])
