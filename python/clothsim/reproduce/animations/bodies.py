"""Meshes of what the cloth touches: bodies that are stars about their middle, cones, capsules."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats, Ints

__all__ = ["Star", "capsule", "cone", "cone_height"]


@dataclass(frozen=True, eq=False)
class Star:
    """A sphere of 12 ``cells``² triangles whose vertices move along their rays, made from a cube.

    Attributes
    ----------
    cells : int
        Cells along an edge of the cube.
    directions : (n, 3) float64
        Of the vertices, unit length.
    triangles : (m, 3) int64
        Outward.
    """

    cells: int
    directions: Floats
    triangles: Ints
    _index: Ints

    @classmethod
    def of(cls, cells: int) -> Star:
        """Make one."""
        n = cells
        steps = np.tan((2.0 * np.arange(n + 1) / n - 1.0) * 0.25 * math.pi)
        lattice = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), axis=-1)
        outside = np.any((lattice == 0) | (lattice == n), axis=-1)
        index = np.full((n + 1,) * 3, -1, dtype=np.int64)
        index[outside] = np.arange(int(outside.sum()))
        points = steps[lattice[outside]]
        directions = points / np.linalg.norm(points, axis=1, keepdims=True)
        i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        triangles = []
        for axis in range(3):
            for side in (0, n):
                corners = [_corner(index, axis, side, i + di, j + dj) for di, dj in ((0, 0), (1, 0), (0, 1), (1, 1))]
                a, b, c, d = (corner.ravel() for corner in corners)
                made = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
                triangles.append(made if side == n else made[:, ::-1])
        return cls(n, directions, np.concatenate(triangles), index)

    def reach(self, radii: Floats, directions: Floats) -> Floats:
        """How far the surface of the mesh is in each direction (k, 3), with its vertices at these radii.

        Exact: what bounds a triangle are planes through the middle, whatever the radii.
        """
        n = self.cells
        steps = np.tan((2.0 * np.arange(n + 1) / n - 1.0) * 0.25 * math.pi)
        axis = np.argmax(np.abs(directions), axis=1)
        rows = np.arange(len(directions))
        along = directions[rows, axis]
        side = np.where(along > 0.0, n, 0)
        u = directions[rows, (axis + 1) % 3] / np.abs(along)
        v = directions[rows, (axis + 2) % 3] / np.abs(along)
        i, j = (np.clip(np.searchsorted(steps, x, side="right") - 1, 0, n - 1) for x in (u, v))
        first = (u - steps[i]) / (steps[i + 1] - steps[i]) >= (v - steps[j]) / (steps[j + 1] - steps[j])
        points = self.directions * radii[:, None]
        a = points[_corners(self._index, axis, side, i, j)]
        d = points[_corners(self._index, axis, side, i + 1, j + 1)]
        other = points[_corners(self._index, axis, side, i + first, j + ~first)]
        normal = np.cross(other - a, d - a)
        reach: Floats = np.sum(normal * a, axis=1) / np.sum(normal * directions, axis=1)
        return reach


def _corner(index: Ints, axis: int, side: int, i: Ints, j: Ints) -> Ints:
    return _corners(index, np.full(i.shape, axis), np.full(i.shape, side), i, j)


def _corners(index: Ints, axis: Ints, side: Ints, i: Ints, j: Ints) -> Ints:
    """Vertices at places (i, j) along the next two axes of a face."""
    place = np.stack([side, i, j])
    rolled = [np.choose((k - axis) % 3, place) for k in range(3)]
    found: Ints = index[rolled[0], rolled[1], rolled[2]]
    return found


def cone_height(distance: Floats, radius: float, height: float, tip: float) -> Floats:
    """Height of a cone above its base at a distance from its axis; its tip is rounded over about ``tip``."""
    return height * (1.0 - np.sqrt(distance**2 + tip**2) / radius)


def cone(segments: int, radius: float, height: float, tip: float) -> tuple[Floats, Ints]:
    """A cone on y = 0 with 4 ``segments`` triangles: a cap of its tip, its side, its base."""
    angles = 2.0 * math.pi * np.arange(segments) / segments
    round_ = np.column_stack([np.cos(angles), np.zeros(segments), np.sin(angles)])
    foot = math.sqrt(radius**2 - tip**2)
    points = [np.array([[0.0, float(cone_height(np.array(0.0), radius, height, tip)), 0.0], [0.0, 0.0, 0.0]])]
    for distance in (1.5 * tip, foot):
        ring = distance * round_
        ring[:, 1] = float(cone_height(np.array(distance), radius, height, tip))
        points.append(ring)
    k = np.arange(segments)
    upper, lower = 2 + k, 2 + segments + k
    upper_next, lower_next = 2 + (k + 1) % segments, 2 + segments + (k + 1) % segments
    top, base = np.zeros_like(k), np.ones_like(k)
    triangles = np.concatenate([
        np.column_stack(t) for t in (
            (top, upper_next, upper), (upper, upper_next, lower_next), (upper, lower_next, lower),
            (base, lower, lower_next),
        )
    ])  # fmt: skip
    return np.concatenate(points), triangles


def capsule(radius: float, half: float, around: int, caps: int, along: int) -> tuple[Floats, Ints]:
    """A capsule about the y axis: ``caps`` rings in each half sphere, ``along`` rows between them."""
    up = 0.5 * math.pi * np.arange(1, caps + 1) / caps
    profile = [(radius * math.sin(a), half + radius * math.cos(a)) for a in up]
    straight = [(radius, half - 2.0 * half * k / along) for k in range(1, along)]
    rings = np.array(profile + straight + [(r, -y) for r, y in reversed(profile)])
    angles = 2.0 * math.pi * np.arange(around) / around
    side = np.stack([
        rings[:, :1] * np.sin(angles), np.repeat(rings[:, 1:], around, axis=1), rings[:, :1] * np.cos(angles),
    ], axis=-1).reshape(-1, 3)  # fmt: skip
    points = np.concatenate([side, [[0.0, half + radius, 0.0], [0.0, -half - radius, 0.0]]])
    k, after = np.arange(around), (np.arange(around) + 1) % around
    triangles = []
    for row in range(len(rings) - 1):
        a, b = row * around, (row + 1) * around
        triangles += [np.column_stack([a + k, b + k, b + after]), np.column_stack([a + k, b + after, a + after])]
    last = (len(rings) - 1) * around
    top, bottom = np.full(around, len(side)), np.full(around, len(side) + 1)
    triangles += [np.column_stack([top, k, after]), np.column_stack([bottom, last + after, last + k])]
    return points, np.concatenate(triangles)
