"""Polygons into triangles, keeping the polygons' order and orientation."""

from __future__ import annotations

import numpy as np

from clothsim._arrays import Floats

__all__ = ["triangulate"]


def triangulate(points: Floats) -> list[tuple[int, int, int]]:
    """Triangles of one simple polygon, as indices into its corners.

    Convex polygons become a fan from their first corner. Others are cut ear by ear in the plane of their mean
    normal (Newell), so that a concave quad is split along the diagonal that lies inside it.

    Parameters
    ----------
    points : (k, 3) float64
        The corners in order.

    Raises
    ------
    ValueError
        More than 10 000 corners that are not convex.
    """
    count = len(points)
    if count < 3:
        return []
    fan = [(0, i, i + 1) for i in range(1, count - 1)]
    if count == 3:
        return fan
    following = np.roll(points, -1, axis=0)
    normal = np.cross(points, following).sum(axis=0)
    if not np.any(normal):
        return fan
    turns = np.cross(following - points, np.roll(points, -2, axis=0) - following) @ normal
    if np.all(turns > 0.0):
        return fan
    drop = int(np.argmax(np.abs(normal)))
    u, w = ((1, 2), (2, 0), (0, 1))[drop]
    flat = points[:, [u, w]] * (1.0 if normal[drop] > 0.0 else -1.0, 1.0)
    if count > _MOST_CORNERS:
        raise ValueError(f"expected polygons that are convex or have at most {_MOST_CORNERS} corners, got {count}")
    return _clip_ears(flat) or fan


# The time to cut up a polygon grows with the square of its corners.
_MOST_CORNERS = 10_000


def _clip_ears(corners: Floats) -> list[tuple[int, int, int]]:
    """Ear clipping of a counter-clockwise polygon (k, 2) in the plane, the ear with the lowest tip first.

    Empty where no ear is left (self-crossing).
    """
    count = len(corners)
    before, after = np.roll(np.arange(count), 1), np.roll(np.arange(count), -1)
    there = np.ones(count, dtype=bool)

    def is_ear(b: int) -> bool:
        a, c = int(before[b]), int(after[b])
        if _turn(corners[a], corners[b], corners[c]) <= 0.0:
            return False
        inside = there.copy()
        inside[[a, b, c]] = False
        others = corners[inside]
        return not np.any(
            (_turn(corners[a], corners[b], others) >= 0.0)
            & (_turn(corners[b], corners[c], others) >= 0.0)
            & (_turn(corners[c], corners[a], others) >= 0.0)
        )

    ears = np.array([is_ear(b) for b in range(count)])
    triangles = []
    for _ in range(count - 3):
        if not ears.any():
            # Where corners coincide, one that is gone can have been all that stood in the way of another.
            ears = np.array([bool(there[b]) and is_ear(b) for b in range(count)])
            if not ears.any():
                return []
        b = int(np.argmax(ears))
        a, c = int(before[b]), int(after[b])
        triangles.append((a, b, c))
        there[b] = ears[b] = False
        after[a], before[c] = c, a
        for neighbour in (a, c):
            ears[neighbour] = is_ear(neighbour)
    left = np.flatnonzero(there).tolist()
    return [*triangles, (left[0], left[1], left[2])]


def _turn(a: Floats, b: Floats, p: Floats) -> Floats:
    """Twice the signed area of (a, b, p), for one point or for many."""
    turn: Floats = (b[0] - a[0]) * (p[..., 1] - b[1]) - (b[1] - a[1]) * (p[..., 0] - b[0])
    return turn
