"""Points on triangle meshes: nearest points, and the same material point on two meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats, Ints

__all__ = ["Places", "hull_area", "locate", "nearest", "sample", "shadow_area"]

_CHUNK = 2_000_000  # pairs of points and triangles looked at in one go

# For each point: its triangle (n,), and the weights of that triangle's corners (n, 3).
Places = tuple[Ints, Floats]


def nearest(points: Floats, vertices: Floats, triangles: Ints) -> tuple[Floats, Places]:
    """Distance [m] of each point (n, 3) from a mesh, exactly, and where its nearest point lies.

    A triangle counts if the ball around it may hold a nearer point than the nearest middle of all triangles is.
    """
    corners = vertices[triangles]
    middles = corners.mean(axis=1)
    radii = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    count = max(1, _CHUNK // max(1, len(triangles)))
    distances, found, weights = np.empty(len(points)), np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
    for first in range(0, len(points), count):
        own = points[first : first + count]
        away = np.sqrt(np.maximum(((own[:, None] - middles) ** 2).sum(axis=2), 0.0))
        bound = (away.min(axis=1))[:, None]
        row, triangle = np.nonzero(away - radii <= bound * (1.0 + 1e-12))
        w = _nearest_on(own[row], corners[triangle])
        d = np.linalg.norm(np.einsum("kc,kcx->kx", w, corners[triangle]) - own[row], axis=1)
        order = np.lexsort((triangle, d, row))
        best = order[np.unique(row[order], return_index=True)[1]]
        part = slice(first, first + len(own))
        distances[part], found[part], weights[part] = d[best], triangle[best], w[best]
    return distances, (found, weights)


def _nearest_on(p: Floats, corners: Floats) -> Floats:
    """Barycentric weights (k, 3) of the point of each triangle that is nearest to each point. Source: Ericson 2005."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, bc = b - a, c - a, c - b
    aa, bb, cross = _dot(ab, ab), _dot(ac, ac), _dot(ab, ac)
    pa, pc = _dot(p - a, ab), _dot(p - a, ac)
    det = np.maximum(aa * bb - cross**2, 1e-300)
    v, w = (bb * pa - cross * pc) / det, (aa * pc - cross * pa) / det
    inside: Floats = np.column_stack([1.0 - v - w, v, w])
    within = np.asarray((inside >= 0.0).all(axis=1))
    # Else the nearest point lies on one of the three edges.
    t_ab = np.clip(pa / np.maximum(aa, 1e-300), 0.0, 1.0)
    t_ac = np.clip(pc / np.maximum(bb, 1e-300), 0.0, 1.0)
    t_bc = np.clip(_dot(p - b, bc) / np.maximum(_dot(bc, bc), 1e-300), 0.0, 1.0)
    zero = np.zeros_like(t_ab)
    options = np.stack(
        [
            np.column_stack([1 - t_ab, t_ab, zero]),
            np.column_stack([1 - t_ac, zero, t_ac]),
            np.column_stack([zero, 1 - t_bc, t_bc]),
        ]
    )
    away = np.linalg.norm(np.einsum("okc,kcx->okx", options, corners) - p, axis=2)
    edge = options[away.argmin(axis=0), np.arange(len(p))]
    return np.asarray(np.where(within[:, None], inside, edge))


def _dot(u: Floats, v: Floats) -> Floats:
    return np.asarray(np.einsum("kx,kx->k", u, v))


def locate(points: Floats, vertices: Floats, triangles: Ints) -> Places:
    """Where points lie on a mesh, as triangles and weights."""
    return nearest(points, vertices, triangles)[1]


def sample(places: Places, values: Floats, triangles: Ints) -> Floats:
    """Values (n, k) at places, from values at the vertices."""
    triangle, weights = places
    return np.asarray(np.einsum("nc,ncx->nx", weights, values[triangles[triangle]]))


def hull_area(points: Floats) -> float:
    """Area of the convex hull of points (n, 2) in the plane."""
    unique = sorted(map(tuple, points.tolist()))
    if len(unique) < 3:
        return 0.0
    hull: list[tuple[float, ...]] = []
    for run in (unique, unique[::-1]):
        part: list[tuple[float, ...]] = []
        for q in run:
            while len(part) > 1 and _turn(part[-2], part[-1], q) <= 0.0:
                part.pop()
            part.append(q)
        hull += part[:-1]
    x, y = np.array(hull).T
    return float(0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def shadow_area(points: Floats, triangles: Ints, pixels: int = 1000) -> float:
    """Area that triangles with corners at points (n, 2) cover together, counted in pixels (1000 across)."""
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    if size == 0.0:
        return 0.0
    scaled = (points - low) * (pixels / size)
    covered: NDArray[np.bool_] = np.zeros((pixels, pixels), dtype=bool)
    for corners in scaled[triangles]:
        first = np.maximum(np.ceil(corners.min(axis=0) - 0.5).astype(int), 0)
        last = np.minimum(np.floor(corners.max(axis=0) - 0.5).astype(int), pixels - 1)
        if (last < first).any():
            continue
        px = (np.arange(first[0], last[0] + 1) + 0.5)[:, None]
        py = (np.arange(first[1], last[1] + 1) + 0.5)[None, :]
        (ax, ay), (bx, by), (cx, cy) = corners
        u = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        v = (cx - bx) * (py - by) - (cy - by) * (px - bx)
        w = (ax - cx) * (py - cy) - (ay - cy) * (px - cx)
        inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
        covered[first[0] : last[0] + 1, first[1] : last[1] + 1] |= inside
    return float(covered.sum()) * (size / pixels) ** 2
