"""A square cloth that lies over a body and hangs down around it in deep pleats, which touch each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce.animations.animation import CLOSE, Animation, grid, join, smooth
from clothsim.reproduce.animations.bodies import Star
from clothsim.reproduce.animations.pleats import WALL, bulge

__all__ = ["Drape"]

HALF = 1.0  # half the side of the cloth [m]
RADIUS = 0.33  # of the body [m]
LEAVES = math.radians(80.0)  # polar angle at which the cloth leaves the body
DEPTH = 0.13  # of the pleats, from their middle [m]
# Distances from the cloth's middle [m]: pleats begin, and have their depth; they overhang, and touch.
PLEATS, OVERHANG = (0.5, 0.95), (0.6, 0.95)
BODY = (0.55, 0.8)  # between these the cloth ceases to follow the body's relief
LOOSE = 0.6  # from here on the cloth may turn and sway against the body
NEAREST = 0.7  # distance of cloth on the body, over the thickness
# Distance of pleats from each other over the thickness: least, and by how much it varies.
NECK = (0.6, 0.6)
FALL = 0.006  # from so high the cloth comes down onto the body [m]
LANDED = 0.07  # after so long [s]

Relief = Callable[[Floats, float], Floats]


@dataclass(frozen=True)
class Drape:
    """What is draped, and how it moves.

    Attributes
    ----------
    name : str
        Of the animation.
    cells : int
        Of the cloth along its side: 2 ``cells``² triangles.
    body : int
        Of the body along an edge of its cube: 12 ``body``² triangles.
    pleats : int
        How many.
    relief : callable, optional
        By how much the body's radius differs from a sphere's, as a share, by direction (n, 3) and time.
    spin : float
        Of the body, and the cloth on it [rad/s].
    slip : float
        Of the cloth against the body [rad/s].
    twist : float
        By how much the hem stays behind, as a share of the spin.
    sway : float
        Of the hem, by the wind [m].
    path : float
        How far the body moves to each side [m].
    frames : int
        How many.
    dt : float
        Between frames [s].
    """

    name: str
    cells: int
    body: int
    pleats: int = 8
    relief: Relief | None = None
    spin: float = 0.0
    slip: float = 0.0
    twist: float = 0.3
    sway: float = 0.03
    path: float = 0.0
    frames: int = 61
    dt: float = 0.0025

    @property
    def thickness(self) -> float:
        """In proportion to the length of the cloth's edges [m]."""
        return CLOSE * 2.0 * HALF / self.cells

    def animation(self) -> Animation:
        """Make the frames."""
        star = Star.of(self.body)
        triangles, parts = join([
            ("cloth", True, (self.cells + 1) ** 2, grid(self.cells, self.cells)),
            ("body", False, len(star.directions), star.triangles),
        ])  # fmt: skip
        side = np.linspace(-HALF, HALF, self.cells + 1)
        x, z = (a.ravel() for a in np.meshgrid(side, side, indexing="xy"))
        s, angle = np.hypot(x, z), np.arctan2(x, z)

        def at(time: float) -> Floats:
            radii = RADIUS * (1.0 + self._relief(star.directions, time))
            body = _turned(star.directions * radii[:, None], self.spin * time)
            body += self._place(np.zeros(len(body)), time)
            return np.concatenate([self._cloth(star, radii, s, angle, time), body])

        flat = np.column_stack([x, np.full(len(x), 2.0), z])
        rest = np.concatenate([flat, RADIUS * star.directions])
        return Animation(self.name, triangles, parts, self.thickness, self.dt, self.frames, at, rest)

    def _relief(self, directions: Floats, time: float) -> Floats:
        return np.zeros(len(directions)) if self.relief is None else self.relief(directions, time)

    def _place(self, s: Floats, time: float) -> Floats:
        """Where the middle is; what hangs far from the body follows it later."""
        late = time - 0.35 * np.maximum(0.0, s - LOOSE)
        sway = self.sway * smooth((s - 0.8) / 0.6)
        return np.column_stack([
            self.path * np.sin(2.0 * late) + sway * np.sin(3.0 * time - 2.0 * s), np.zeros(len(s)),
            0.5 * self.path * np.sin(3.0 * late + 0.5) + 0.6 * sway * np.sin(2.3 * time - 1.5 * s + 1.0),
        ])  # fmt: skip

    def _cloth(self, star: Star, radii: Floats, s: Floats, angle: Floats, time: float) -> Floats:
        # A meridian: along the sphere, then straight on.
        leaves = RADIUS * LEAVES
        polar, on = np.minimum(s, leaves) / RADIUS, np.maximum(s - leaves, 0.0)
        r = RADIUS * np.sin(polar) + on * math.cos(LEAVES)
        y = RADIUS * np.cos(polar) - on * math.sin(LEAVES)
        # Out to the body's relief.
        away = np.hypot(r, y)
        follows = 1.0 - smooth((s - BODY[0]) / (BODY[1] - BODY[0]))
        turn = self.slip * time
        near = follows > 0.0
        directions = np.column_stack([
            r * np.sin(angle + turn), y, r * np.cos(angle + turn),
        ])[near] / away[near, None]  # fmt: skip
        out = np.full(len(s), NEAREST * self.thickness)
        out[near] += follows[near] * (star.reach(radii, directions) - RADIUS)
        r, y = r * (1.0 + out / away), y * (1.0 + out / away)
        # Pleats.
        depth = DEPTH * smooth((s - PLEATS[0]) / (PLEATS[1] - PLEATS[0]))
        varied = np.sin(angle + 2.5 * s - 1.5 * time) * np.sin(2.0 * angle - 3.0 * s + time)
        neck = self.thickness * (NECK[0] + NECK[1] * varied**2)
        inner = r - depth * WALL
        much = bulge(0.5 * self.pleats * neck / np.maximum(inner, 1e-3))
        much *= smooth((s - OVERHANG[0]) / (OVERHANG[1] - OVERHANG[0]))
        phase = self.pleats * angle
        around = angle + much / self.pleats * np.sin(2.0 * phase)
        r = r + depth * np.cos(phase)
        behind = self.twist * self.spin * time * (np.maximum(0.0, s - LOOSE) / HALF) ** 2
        around += self.spin * time + turn - behind
        fall = FALL * (1.0 - float(smooth(np.array(time / LANDED))))
        return np.column_stack([r * np.sin(around), y + fall, r * np.cos(around)]) + self._place(s, time)


def _turned(points: Floats, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.column_stack([c * points[:, 0] + s * points[:, 2], points[:, 1], c * points[:, 2] - s * points[:, 0]])
