"""Strips of cloth in the four ways of cutting them into triangles, and how stiff each is.

All strips lie in the xz-plane, clamped at x = 0, with their free end at x = ``length``. The clamp line lies midway
between two pinned columns of vertices (a half-cell clamp): the hinge on the last pinned column then carries the
curvature of the half cell before and of the half cell after it, and the tip converges with the square of the cell.
With the clamp line on the last pinned column it converges with the first power only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import clothsim as cs

# Patterns of the grid generator, and equilateral triangles with edges across or along the strip.
KINDS = ("union-jack", "equilateral", "equilateral-along", "one-way")
# Free length beyond the last pinned column and in front of it, in cells: a half where columns are straight. Edges along
# the strip stagger the columns; there 3/8 lets the rigidity of a linear strip converge with the square of the cell.
CLAMP = {"union-jack": 0.5, "equilateral": 0.5, "equilateral-along": 0.375, "one-way": 0.5}
# Rigidity over that of the material of an unbounded sheet of independent hinges bent along the strip: free to curve
# across, and held flat across (docs/validation.md derives them). With coupled hinges both are 1 on every mesh.
INDEPENDENT = {
    "union-jack": (4 / 5, 5 / 6),
    "equilateral": (8 / 9, 1.0),
    "equilateral-along": (8 / 9, 1.0),
    "one-way": (14 / 17, 1.0),
}


class Strip(NamedTuple):
    """A strip: its mesh, the pinned vertices, those at the free end, and the cell length [m]."""

    mesh: cs.Mesh
    pinned: np.ndarray
    tip: np.ndarray
    cell: float


def strip(kind: str, length: float, cells: int, across: int) -> Strip:
    """Make a strip of free ``length`` [m] with ``cells`` triangles along and ``across`` rows of cells."""
    cell = length / (cells + CLAMP[kind])
    start = -(1.0 - CLAMP[kind]) * cell
    build = {"equilateral": _edges_across, "equilateral-along": _edges_along}.get(kind)
    points, triangles = build(cells + 1, across) if build else _squares(cells + 1, across, kind == "union-jack")
    points = np.asarray(points, dtype=float) * cell
    x, z = points[:, 0] + start, points[:, 1] - points[:, 1].max() / 2.0
    vertices = np.column_stack([x, np.zeros_like(x), z])
    rounding = 1e-9 * length
    last = start + cell + rounding
    return Strip(cs.Mesh(vertices, triangles), np.flatnonzero(x <= last), np.flatnonzero(x >= length - rounding), cell)


def _squares(nx: int, nz: int, alternate: bool) -> tuple[list[tuple[float, float]], list[list[int]]]:
    points = [(float(i), float(j)) for j in range(nz + 1) for i in range(nx + 1)]
    triangles = []
    for j in range(nz):
        for i in range(nx):
            a = j * (nx + 1) + i
            b, c, d = a + 1, a + nx + 2, a + nx + 1
            triangles += [[a, d, b], [b, d, c]] if alternate and (i + j) % 2 else [[a, c, b], [a, d, c]]
    return points, triangles


def _edges_across(nx: int, nz: int) -> tuple[list[tuple[float, float]], list[list[int]]]:
    """Columns of edges across the strip, one cell apart; half triangles along the long sides."""
    points, triangles = _staggered(nx, nz, 2.0 / np.sqrt(3.0), 1.0)
    return [(y, x) for x, y in points], [[a, c, b] for a, b, c in triangles]


def _edges_along(nx: int, nz: int) -> tuple[list[tuple[float, float]], list[list[int]]]:
    """Rows of edges along the strip, each one cell long; half triangles at both ends."""
    return _staggered(nz, nx, 1.0, np.sqrt(3.0) / 2.0)


def _staggered(rows: int, columns: int, edge: float, apart: float) -> tuple[list[tuple[float, float]], list[list[int]]]:
    """Equilateral triangles over ``rows`` bands of ``columns`` edges along x, with straight ends."""
    points: list[tuple[float, float]] = []
    lines = []
    for j in range(rows + 1):
        xs = np.arange(columns + 1.0) if j % 2 == 0 else np.concatenate([[0.0], np.arange(columns) + 0.5, [columns]])
        lines.append(len(points) + np.arange(len(xs)))
        points += [(float(x) * edge, j * apart) for x in xs]
    triangles = []
    for j in range(rows):
        even, odd = (lines[j], lines[j + 1]) if j % 2 == 0 else (lines[j + 1], lines[j])
        band = [[even[k], even[k + 1], odd[k + 1]] for k in range(columns)]
        band += [[even[k], odd[k + 1], odd[k]] for k in range(columns)]
        band.append([even[columns], odd[columns + 1], odd[columns]])
        triangles += [[int(a), int(c), int(b)] if j % 2 == 0 else [int(a), int(b), int(c)] for a, b, c in band]
    return points, triangles


def linear_rigidity(strip: Strip, length: float, hinges: str = "coupled") -> float:
    """Rigidity of the strip over that of its material, as its own small deflections show it.

    Minimises the hinge energy ½ Σ |e| θ²/h̄ of the flat mesh, with the products of the hinges of each triangle unless
    ``hinges`` is "independent", linear in the displacements normal to it, under its weight, and compares the tip with
    that of a beam, w g L⁴/(8 B). No stretch enters: this is the mesh's bending alone.
    """
    points = strip.mesh.vertices[:, [0, 2]]
    triangles = strip.mesh.triangles
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for t, corners in enumerate(triangles):
        for k in range(3):
            a, b, opposite = (int(corners[(k + m) % 3]) for m in range(3))
            sides.setdefault((min(a, b), max(a, b)), []).append((t, opposite))
    p, q, r = (points[triangles[:, k]] for k in range(3))
    area = 0.5 * np.abs((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0])

    rows, columns, values, weights = [], [], [], []
    inner: dict[int, list[tuple[int, np.ndarray, float]]] = {}
    for (a, b), flaps in sides.items():
        if len(flaps) != 2:
            continue
        edge = points[b] - points[a]
        squared = float(edge @ edge)
        for t, opposite in flaps:
            slope = np.sqrt(squared) / (2.0 * area[t])
            along = float((points[opposite] - points[a]) @ edge) / squared
            rows += [len(weights)] * 3
            columns += [opposite, a, b]
            values += [slope, -slope * (1.0 - along), -slope * along]
        first, second = (area[t] for t, _ in flaps)
        for t, _ in flaps:
            share = 2.0 * np.sqrt(first * second) / (first + second)
            inner.setdefault(t, []).append((len(weights), edge, share))
        weights.append(squared / (first + second))
    angles = sp.csr_matrix((values, (rows, columns)), shape=(len(weights), len(points)))
    energy = sp.diags(weights).tolil()
    for t, hinges_of in inner.items() if hinges == "coupled" else ():
        for i, d, s in hinges_of:
            for j, e, r in hinges_of:
                if i != j:
                    # |d| |e| cos² of the angle between them.
                    energy[i, j] = s * r * float(d @ e) ** 2 / np.sqrt(float(d @ d) * float(e @ e)) / (4.0 * area[t])
    stiffness = (angles.T @ energy.tocsr() @ angles).tocsr()
    load = np.bincount(triangles.ravel(), np.repeat(area / 3.0, 3), len(points))
    free = np.setdiff1d(np.arange(len(points)), strip.pinned)
    droop = np.zeros(len(points))
    droop[free] = spsolve(stiffness[free][:, free].tocsc(), load[free])
    return float(length**4 / 8.0 / droop[strip.tip].mean())
