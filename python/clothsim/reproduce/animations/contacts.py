"""What touches what in an animation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats, Ints
from clothsim.reproduce.animations.animation import Animation

__all__ = ["Contacts", "contacts", "passing"]


@dataclass(frozen=True)
class Contacts:
    """Vertex-triangle and edge-edge pairs in contact, by what they belong to.

    Attributes
    ----------
    cloth : int
        Cloth with cloth.
    body : int
        Cloth with the rest.
    """

    cloth: int
    body: int


def contacts(animation: Animation, found: collision.Detection) -> Contacts:
    """Count contacts; those among bodies, which may overlap, are left out."""
    vertices, triangles = animation.cloth_vertices(), animation.count(cloth=True)
    of_cloth = np.concatenate([found.vertex_triangle < [vertices, triangles], found.edge_edge[:, [0, 2]] < vertices])
    count = of_cloth.sum(axis=1)
    return Contacts(int((count == 2).sum()), int((count == 1).sum()))


def passing(animation: Animation, x: Floats, *, threads: int | None = None) -> Ints:
    """Pairs of triangles (k, 2) that pass through each other at positions ``x``, one of them cloth at least."""
    pairs = collision.self_intersections(x, animation.triangles, threads=threads)
    return pairs[(pairs < animation.count(cloth=True)).any(axis=1)]
