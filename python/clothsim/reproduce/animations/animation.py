"""A sequence of frames of cloth and of what it touches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats, Ints

__all__ = ["CLOSE", "Animation", "Part", "grid", "join", "smooth"]

CLOSE = 0.35  # thickness over the edges of a sheet at rest


@dataclass(frozen=True)
class Part:
    """A body: consecutive vertices and triangles.

    Attributes
    ----------
    name : str
        What it is.
    cloth : bool
        Cloth, or what moves by itself.
    vertices, triangles : slice
        Where they lie in the animation's arrays.
    """

    name: str
    cloth: bool
    vertices: slice
    triangles: slice

    @property
    def triangle_count(self) -> int:
        """How many triangles it has."""
        return int(self.triangles.stop - self.triangles.start)


@dataclass(frozen=True, eq=False)
class Animation:
    """Frames in closed form: each can be had by itself, and the same call gives the same bits.

    Attributes
    ----------
    name : str
        What is seen.
    triangles : (m, 3) int64
        Vertex indices; the same in all frames.
    parts : tuple of Part
        Cloth first.
    thickness : float
        Distance up to which features are in contact [m].
    dt : float
        Time between frames [s].
    frames : int
        How many there are.
    at : callable
        Positions (n, 3) [m] at a time [s].
    rest : (n, 3) float64
        Positions [m] with the cloth spread out, away from the bodies: what lies together there belongs together.
    """

    name: str
    triangles: Ints
    parts: tuple[Part, ...]
    thickness: float
    dt: float
    frames: int
    at: Callable[[float], Floats]
    rest: Floats

    def frame(self, index: int) -> Floats:
        """Positions (n, 3) [m] of the frame of that index, from 0."""
        return self.at(index * self.dt)

    def steps(self) -> Iterator[tuple[Floats, Floats]]:
        """Every two consecutive frames."""
        start = self.frame(0)
        for index in range(1, self.frames):
            end = self.frame(index)
            yield start, end
            start = end

    def count(self, *, cloth: bool) -> int:
        """Triangles of the cloth, or of the rest."""
        return sum(part.triangle_count for part in self.parts if part.cloth == cloth)

    def cloth_vertices(self) -> int:
        """How many vertices the cloth has; they come first."""
        return max(int(part.vertices.stop) for part in self.parts if part.cloth)


def join(bodies: Sequence[tuple[str, bool, int, Ints]]) -> tuple[Ints, tuple[Part, ...]]:
    """Number the vertices of bodies (name, cloth, vertex count, triangles) through."""
    parts, triangles, vertex, triangle = [], [], 0, 0
    for name, cloth, count, own in bodies:
        parts.append(Part(name, cloth, slice(vertex, vertex + count), slice(triangle, triangle + len(own))))
        triangles.append(np.asarray(own, dtype=np.int64) + vertex)
        vertex, triangle = vertex + count, triangle + len(own)
    return np.concatenate(triangles), tuple(parts)


def grid(columns: int, rows: int, *, closed: bool = False) -> Ints:
    """Triangles of a sheet of cells, two each, diagonals in turn; vertices row by row.

    ``closed``: the last column's cells end at the first vertices, as around a tube.
    """
    across = columns if closed else columns + 1
    j, i = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    right = (i + 1) % across
    a, b, c, d = j * across + i, j * across + right, (j + 1) * across + i, (j + 1) * across + right
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.column_stack([a, c, d]), np.column_stack([a, c, b]))
    second = np.where(even, np.column_stack([a, d, b]), np.column_stack([b, c, d]))
    return np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int64)


def smooth(x: Floats) -> Floats:
    """From 0 at x ≤ 0 to 1 at x ≥ 1, with two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
