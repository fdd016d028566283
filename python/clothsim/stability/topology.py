"""Labels that a motion without a passage cannot change."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.stability.case import Sides

__all__ = ["above", "beyond", "drumhead", "inside", "linking_number", "order_of_sheets", "together"]


def above(normal: Sequence[float], height: float = 0.0) -> Sides:
    """Label vertices by their side of a fixed plane, n·x against ``height`` [m]."""
    direction = np.asarray(normal, dtype=float)
    return lambda x, _: np.sign(x @ direction - height).astype(np.int64)


def beyond(collider: slice, normal: Sequence[float]) -> Sides:
    """Label vertices by their side of a moving plane: that through the mean of some collider vertices."""
    direction = np.asarray(normal, dtype=float)
    return lambda x, c: np.sign((x - c[collider].mean(axis=0)) @ direction).astype(np.int64)


def drumhead(border: Ints, triangles: Ints) -> Callable[[Floats, Floats], Ints]:
    """Label whether a point (3,) is still on its side of a sheet in y = 0 whose border is held.

    Sheet and a flat cap over its border are a closed surface: the point is in it if it is below the cap, and above the
    sheet. Both have to change together.
    """
    cap = np.column_stack([np.full(len(border) - 2, border[0]), border[1:-1], border[2:]])
    closed = np.concatenate([triangles, cap])

    def label(x: Floats, point: Floats) -> Ints:
        return np.abs(inside(point[None], x, closed)) - int(point[1] < 0.0)

    return label


def inside(points: Floats, vertices: Floats, triangles: Ints) -> Ints:
    """Winding number of a closed mesh about points, rounded: sum of the solid angles of its triangles over 4π.

    Source: Van Oosterom and Strackee 1983, for the solid angle of a triangle.
    """
    numbers = np.empty(len(points), dtype=np.int64)
    for k, point in enumerate(points):
        a, b, c = (vertices[triangles[:, i]] - point for i in range(3))
        la, lb, lc = (np.linalg.norm(e, axis=1) for e in (a, b, c))
        upper = np.einsum("ij,ij->i", a, np.cross(b, c))
        lower = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        numbers[k] = round(float(np.arctan2(upper, lower).sum()) / (2.0 * math.pi))
    return numbers


def order_of_sheets(count: int, vertices: int, up: int = 1) -> Sides:
    """Label neighbours in a stack of equal sheets by which of the two is higher, by their middles."""

    def sides(x: Floats, _: Floats) -> Ints:
        middles = x.reshape(count, vertices, 3)[:, :, up].mean(axis=1)
        labels: Ints = np.sign(np.diff(middles)).astype(np.int64)
        return labels

    return sides


def linking_number(first: Floats, second: Floats) -> int:
    """Gauss's linking number of two closed polygons (n, 3) and (m, 3), rounded.

    Each pair of segments contributes the signed area of the quadrilateral of directions between them over 4π.

    Source: Klenin and Langowski 2000, method 1a.
    """
    total = 0.0
    ends = np.roll(second, -1, axis=0)
    for a, b in zip(first, np.roll(first, -1, axis=0), strict=True):
        r13, r14, r23, r24 = second - a, ends - a, second - b, ends - b
        normals = [np.cross(p, q) for p, q in ((r13, r14), (r14, r24), (r24, r23), (r23, r13))]
        units = [n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None] for n in normals]
        area = sum(np.arcsin(np.clip((units[i] * units[(i + 1) % 4]).sum(1), -1.0, 1.0)) for i in range(4))
        sign = np.sign((np.cross(ends - second, b - a) * r13).sum(1))
        total += float((area * sign).sum())
    return round(total / (4.0 * math.pi))


def together(*parts: Sides) -> Sides:
    """All labels of several."""
    return lambda x, c: np.concatenate([part(x, c) for part in parts])
