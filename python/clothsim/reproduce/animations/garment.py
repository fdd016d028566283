"""A skirt of two layers on the walking figure of capsules."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce import mannequin
from clothsim.reproduce.animations.animation import CLOSE, Animation, grid, join, smooth
from clothsim.reproduce.animations.bodies import capsule

__all__ = ["Garment"]

TOP, HEM, OUTER = 0.02, 0.42, 0.244  # waist above, hems of the two layers below the middle of the pelvis [m]
WAIST, FLARE = -0.03, 0.13  # room about the hull of the figure at the waist, and how much more at the hem [m]
WAVES, WAVE = 12, 0.016  # of the hem [m]
NEAREST = 0.8  # least distance of the inner layer from the figure's hull, over the thickness
BETWEEN = (0.85, 1.0)  # distance of the layers, over the thickness: least, and by how much it varies
AROUND = 0.9  # length of a ring that sets the thickness [m]
SMOOTH = 0.008  # m: over which the skirt passes from hanging to being pushed
STEEP = 0.25
ROUNDS = 4
SLOPE = 0.02  # step of the differences that give the layers' slant [rad, m]
WORN_ON = ("pelvis", "belly", "left thigh", "right thigh", "left shank", "right shank")
ANGLES, LEVELS, SPHERES = 120, 72, 25  # of the hull: directions, heights, spheres in place of a capsule
SHOULDERS, ELBOWS = (0.35, 0.35), (1.3, 1.3)  # held before the body, away from the skirt
CAPSULE = (32, 10, 14)  # triangles around, in caps, along: 2,112 a capsule


@dataclass(frozen=True)
class Garment:
    """A garment on a moving figure.

    Attributes
    ----------
    name : str
        Of the animation.
    around : int
        Vertices around each layer.
    rows : (int, int)
        Of cells in the inner and the outer layer.
    capsules : (int, int, int)
        Triangles around a capsule, rings in a cap, rows between the caps.
    walk : Walk
        How the figure moves.
    start : float
        Of the frames, in the figure's time [s].
    frames : int
        How many.
    dt : float
        Between frames [s].
    """

    name: str
    around: int
    rows: tuple[int, int]
    capsules: tuple[int, int, int] = CAPSULE
    walk: mannequin.Walk = field(default_factory=lambda: mannequin.Walk(period=2.1))
    start: float = 1.6
    frames: int = 61
    dt: float = 0.0025

    @property
    def thickness(self) -> float:
        """In proportion to the length of the garment's edges [m]."""
        return CLOSE * AROUND / self.around

    def animation(self) -> Animation:
        """Make the frames."""
        meshes = {
            name: capsule(radius, half, *self.capsules)
            for name, (_, _, radius, half) in mannequin.capsules(mannequin.Pose()).items()
        }
        layers = [(name, rows) for name, rows in zip(("inner layer", "outer layer"), self.rows, strict=True)]
        triangles, parts = join([
            *((name, True, self.around * (rows + 1), grid(self.around, rows, closed=True)) for name, rows in layers),
            *((name, False, len(points), own) for name, (points, own) in meshes.items()),
        ])  # fmt: skip
        places = []
        for (_, rows), hem, shift in zip(layers, (HEM, OUTER), (0.0, 0.25), strict=True):
            angle, y = np.meshgrid(
                2.0 * math.pi * (np.arange(self.around) + shift) / self.around, np.linspace(TOP, -hem, rows + 1)
            )
            places.append((angle.ravel(), y.ravel()))

        def at(time: float) -> Floats:
            pose = replace(self.walk(self.start + time), shoulder=SHOULDERS, elbow=ELBOWS)
            bones = mannequin.capsules(pose)
            middle, turn = mannequin.frame(pose)
            hull = _hull(bones, middle, turn)
            cloth = [
                middle + self._layer(hull, angle, y, time, outer=number == 1) @ turn.T
                for number, (angle, y) in enumerate(places)
            ]
            figure = [bones[name][0] + points @ bones[name][1].T for name, (points, _) in meshes.items()]
            return np.concatenate([*cloth, *figure])

        radius = AROUND / (2.0 * math.pi)
        tubes = [
            np.column_stack([radius * np.sin(angle), y + 3.0 + number, radius * np.cos(angle)])
            for number, (angle, y) in enumerate(places)
        ]
        rest = np.concatenate([*tubes, at(0.0)[sum(map(len, tubes)) :]])
        return Animation(self.name, triangles, parts, self.thickness, self.dt, self.frames, at, rest)

    def _layer(self, hull: Floats, angle: Floats, y: Floats, time: float, *, outer: bool) -> Floats:
        """Places of a layer, from the middle of the pelvis in its axes."""
        r = self._radius(hull, angle, y, time)
        if outer:
            aside = (self._radius(hull, angle + SLOPE, y, time) - self._radius(hull, angle - SLOPE, y, time)) / SLOPE
            under = (self._radius(hull, angle, y + SLOPE, time) - self._radius(hull, angle, y - SLOPE, time)) / SLOPE
            slant = np.sqrt(1.0 + (0.5 * aside / r) ** 2 + (0.5 * under) ** 2)
            between = BETWEEN[0] + BETWEEN[1] * np.sin(4.0 * angle + 10.0 * y + 2.0 * time) ** 2
            r = r + between * self.thickness * slant
        return np.column_stack([r * np.sin(angle), y, r * np.cos(angle)])

    def _radius(self, hull: Floats, angle: Floats, y: Floats, time: float) -> Floats:
        """Of the inner layer."""
        down = np.clip((TOP - y) / (TOP + HEM), 0.0, 1.0)
        pushed = _look_up(hull, angle, y) + NEAREST * self.thickness
        hanging = _look_up(hull[:1], angle, np.full(len(y), TOP)) + WAIST + FLARE * down
        hanging += WAVE * smooth(1.4 * down) * np.cos(WAVES * angle + 0.8 * np.sin(3.0 * time + 2.0 * angle))
        hanging += 0.012 * down**2 * np.sin(6.0 * time - 3.0 * down + angle)
        r: Floats = np.maximum(pushed, hanging)
        r += SMOOTH * np.log1p(np.exp(-np.abs(pushed - hanging) / SMOOTH))
        return r


def _hull(bones: dict[str, tuple[Floats, Floats, float, float]], middle: Floats, turn: Floats) -> Floats:
    """Radius of the convex hull of the figure's sections, by height (rows, from the top) and direction."""
    centres, radii = [], []
    for name in WORN_ON:
        place, rotation, radius, half = bones[name]
        axis = np.linspace(-half, half, SPHERES)[:, None] * rotation[:, 1]
        centres.append((place + axis - middle) @ turn)
        radii.append(np.full(SPHERES, radius))
    centre, reach = np.concatenate(centres), np.concatenate(radii)
    heights = np.linspace(TOP, -HEM, LEVELS)
    angles = 2.0 * math.pi * np.arange(ANGLES) / ANGLES
    across = reach**2 - (heights[:, None] - centre[:, 1]) ** 2
    flat = centre[:, 0, None] * np.sin(angles) + centre[:, 2, None] * np.cos(angles)
    section = np.where(across > 0.0, np.sqrt(np.maximum(across, 0.0)), -np.inf)
    support = np.max(section[:, :, None] + flat[None], axis=1)
    # A ray leaves the hull where it leaves the first of the half-planes.
    apart = angles[:, None] - angles
    ahead = np.cos(apart)
    with np.errstate(divide="ignore", invalid="ignore"):
        leaves = np.where(ahead > 0.05, support[:, None, :] / ahead, np.inf)
    hull: Floats = leaves.min(axis=2)
    # Cloth is stretched from what pushes it: its radius changes with height by no more than STEEP.
    step = STEEP * (heights[0] - heights[1])
    for row in range(1, LEVELS):
        hull[row] = np.maximum(hull[row], hull[row - 1] - step)
    for row in reversed(range(LEVELS - 1)):
        hull[row] = np.maximum(hull[row], hull[row + 1] - step)
    even = hull
    for _ in range(ROUNDS):
        even = _even(even)
    # Not below the hull: what is missing there, around it too, is put on.
    missing = np.maximum(hull - even, 0.0)
    for way, border in _AXES:
        before, after = _beside(missing, way, border)
        missing = np.maximum(np.maximum(before, after), missing)
    return even + missing


_AXES: tuple[tuple[int, Literal["edge", "wrap"]], ...] = ((0, "edge"), (1, "wrap"))


def _beside(values: Floats, axis: int, mode: Literal["edge", "wrap"]) -> tuple[Floats, Floats]:
    wide = np.pad(values, [(1, 1) if a == axis else (0, 0) for a in (0, 1)], mode=mode)
    return np.delete(wide, [-1, -2], axis), np.delete(wide, [0, 1], axis)


def _even(values: Floats) -> Floats:
    for axis, mode in _AXES:
        before, after = _beside(values, axis, mode)
        values = 0.25 * (before + after) + 0.5 * values
    return values


def _look_up(hull: Floats, angle: Floats, y: Floats) -> Floats:
    """Between the rows and columns of the hull, linearly."""
    rows = len(hull)
    row = np.clip((TOP - y) / (TOP + HEM) * (LEVELS - 1), 0.0, rows - 1.0)
    i = np.minimum(row.astype(np.int64), max(rows - 2, 0))
    below = np.minimum(i + 1, rows - 1)
    column = np.mod(angle, 2.0 * math.pi) / (2.0 * math.pi) * ANGLES
    j = column.astype(np.int64) % ANGLES
    u, v = row - i, column - np.floor(column)
    after = (j + 1) % ANGLES
    found: Floats = (1.0 - u) * ((1.0 - v) * hull[i, j] + v * hull[i, after]) + u * (
        (1.0 - v) * hull[below, j] + v * hull[below, after]
    )
    return found
