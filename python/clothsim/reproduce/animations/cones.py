"""A sheet with three bands of deep pleats that comes down on four cones, and drifts over them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce.animations.animation import CLOSE, Animation, grid, join, smooth
from clothsim.reproduce.animations.bodies import cone, cone_height
from clothsim.reproduce.animations.pleats import bulge

__all__ = ["Cones"]

CENTRES = ((0.48, 0.46), (-0.48, 0.46), (-0.48, -0.46), (0.48, -0.46))  # x, z [m]
RADIUS, HEIGHT, TIP, SEGMENTS = 0.28, 0.5, 0.06, 32
WIDTH, LENGTH = 2.4, 2.0  # of the sheet with its pleats laid, along x and z [m]
BANDS, BAND, LAID = (-0.97, 0.0, 0.97), 0.3, 0.08  # middles, width, length of one pleat along x [m]
DEPTH = 0.09  # of the pleats, from their middle [m]
TAKEN = 2.6  # cloth in a band over its width
NEAREST = 0.7  # distance of cloth on cones, over the thickness
NECK = (0.6, 0.6)  # distance of pleats from each other, over the thickness: least, and by how much it varies
BLEND = 0.015  # m: over which the sheet passes from a cone to the sag between them
LEVEL, SINKING = 0.17, 0.06  # height of the sag [m], and how fast it sinks [m/s]
DRIFT = 0.05  # m/s
FALL, LANDED = 0.006, 0.07  # the sheet comes down from so high [m] in so long [s]


@dataclass(frozen=True)
class Cones:
    """Four cones in cloth.

    Attributes
    ----------
    name : str
        Of the animation.
    cells : (int, int)
        Of the sheet across and along the pleats: two triangles each.
    frames : int
        How many.
    dt : float
        Between frames [s].
    """

    name: str
    cells: tuple[int, int]
    frames: int = 61
    dt: float = 0.0025

    @property
    def thickness(self) -> float:
        """In proportion to the length of the sheet's edges [m]."""
        return CLOSE * LENGTH / self.cells[1]

    def animation(self) -> Animation:
        """Make the frames."""
        points, own = cone(SEGMENTS, RADIUS, HEIGHT, TIP)
        standing = np.concatenate([points + np.array([x, 0.0, z]) for x, z in CENTRES])
        triangles, parts = join([
            ("cloth", True, (self.cells[0] + 1) * (self.cells[1] + 1), grid(*self.cells)),
            *((f"cone {k + 1}", False, len(points), own) for k in range(len(CENTRES))),
        ])  # fmt: skip
        across = _laid(np.linspace(0.0, 1.0, self.cells[0] + 1))
        along = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, self.cells[1] + 1)
        x, z = (a.ravel() for a in np.meshgrid(across, along, indexing="xy"))

        def at(time: float) -> Floats:
            return np.concatenate([self._cloth(x, z, time), standing])

        rest = np.concatenate([np.column_stack([1.5 * x, np.full(len(x), 2.0), z]), standing])
        return Animation(self.name, triangles, parts, self.thickness, self.dt, self.frames, at, rest)

    def _cloth(self, x: Floats, z: Floats, time: float) -> Floats:
        band = np.min(np.abs(x[:, None] - np.array(BANDS)), axis=1)
        inside = 0.5 * BAND - band
        varied = np.sin(5.0 * z + 9.0 * x - 2.0 * time)
        left = 0.5 * self.thickness * (NECK[0] + NECK[1] * varied**2) * 2.0 * math.pi / LAID
        much = bulge(left) * smooth(inside / 0.06)
        depth = DEPTH * smooth((inside + 0.02) / 0.05)
        phase = 2.0 * math.pi * x / LAID
        x = x + much * LAID / (2.0 * math.pi) * np.sin(2.0 * phase) + DRIFT * time
        fall = FALL * (1.0 - float(smooth(np.array(time / LANDED))))
        return np.column_stack([x, self._height(x, z, time) + depth * np.cos(phase) + fall, z])

    def _height(self, x: Floats, z: Floats, time: float) -> Floats:
        """Of the sheet without pleats: over cones and sag, whatever is higher."""
        sag = LEVEL - SINKING * time + 0.015 * np.sin(4.0 * x + 3.0 * z - 3.0 * time) * np.sin(2.0 * z + 2.0 * time)
        cell = self.thickness / CLOSE
        heights = [sag]
        for cx, cz in CENTRES:
            distance = _corner_distance(x - cx, z - cz)
            slope = HEIGHT / RADIUS
            # Above the polyhedron by the distance; over its tip, which edges of the sheet cut short, by more.
            over = NEAREST * self.thickness * math.hypot(1.0, slope) + 0.6 * cell * np.exp(
                -((0.5 * distance / cell) ** 2)
            )
            heights.append(_profile(distance) + over)
        stacked = np.array(heights)
        top = stacked.max(axis=0)
        height: Floats = top + BLEND * np.log(np.exp((stacked - top) / BLEND).sum(axis=0))
        return height


def _laid(part: Floats) -> Floats:
    """Place along x of the cloth at a part of its length: the cloth is denser in the bands."""
    x = np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, 4001)
    inside = 0.5 * BAND - np.min(np.abs(x[:, None] - np.array(BANDS)), axis=1)
    density = 1.0 + (TAKEN - 1.0) * smooth((inside + 0.02) / 0.05)
    length = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    laid: Floats = np.interp(part, length / length[-1], x)
    return laid


def _corner_distance(x: Floats, z: Floats) -> Floats:
    """Distance from the axis of the corner of the polygon on which a point lies."""
    sector = 2.0 * math.pi / SEGMENTS
    angle = np.mod(np.arctan2(z, x), sector) - 0.5 * sector
    distance: Floats = np.hypot(x, z) * np.cos(angle) / math.cos(0.5 * sector)
    return distance


def _profile(distance: Floats) -> Floats:
    """Height of the cone's mesh, and of its side beyond the foot."""
    rings = np.array([0.0, 1.5 * TIP, math.sqrt(RADIUS**2 - TIP**2)])
    heights = cone_height(rings, RADIUS, HEIGHT, TIP)
    slope = (heights[2] - heights[1]) / (rings[2] - rings[1])
    profile: Floats = np.interp(distance, rings, heights) + np.maximum(distance - rings[2], 0.0) * slope
    return profile
