"""Meshes of formats that store a vertex once per facet or per UV value: STL and glTF.

Corners at bitwise equal positions become one vertex again, in the order of first appearance, and UV is kept per corner.
"""

from __future__ import annotations

import numpy as np

from clothsim._formats import RawMesh

__all__ = ["weld"]


def weld(mesh: RawMesh) -> RawMesh:
    """Join the corners at bitwise equal positions; vertices in the order in which triangles first name them."""
    corners = mesh.vertices[mesh.triangles.reshape(-1)] + 0.0  # −0.0 becomes 0.0
    _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return RawMesh(corners[first[order]], rank[inverse.reshape(-1)].reshape(-1, 3), mesh.uv)
