"""Polygons into triangles, keeping the polygons' order and orientation."""

from __future__ import annotations

from collections.abc import Sequence

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
    return _clip_ears(flat.tolist()) or fan


def _clip_ears(corners: Sequence[Sequence[float]]) -> list[tuple[int, int, int]]:
    """Ear clipping of a counter-clockwise polygon in the plane; empty where no ear is left (self-crossing)."""
    remaining = list(range(len(corners)))
    triangles = []
    while len(remaining) > 3:
        for at in range(len(remaining)):
            a, b, c = (remaining[(at + k) % len(remaining)] for k in (-1, 0, 1))
            if _turn(corners[a], corners[b], corners[c]) <= 0.0:
                continue
            others = (p for p in remaining if p not in (a, b, c))
            if any(_inside(corners[p], corners[a], corners[b], corners[c]) for p in others):
                continue
            triangles.append((a, b, c))
            del remaining[at]
            break
        else:
            return []
    return [*triangles, (remaining[0], remaining[1], remaining[2])]


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _inside(p: Sequence[float], a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> bool:
    return _turn(a, b, p) >= 0.0 and _turn(b, c, p) >= 0.0 and _turn(c, a, p) >= 0.0
