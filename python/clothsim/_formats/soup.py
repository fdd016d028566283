"""STL and glTF through trimesh.

Both store a vertex once per facet or per UV value; corners at bitwise equal positions become one vertex again, in
the order of first appearance, and UV is kept per corner.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from clothsim._arrays import optional
from clothsim._formats import RawMesh
from clothsim.errors import MeshError

__all__ = ["load"]


def load(path: Path) -> RawMesh:
    """Read an STL, glTF or GLB file; a glTF scene's parts are joined, in metres, in the scene's own axes."""
    trimesh = optional("trimesh", extra="mesh", purpose=f"reading {path.suffix} files")
    if path.suffix.lower() == ".gltf":
        try:
            json.loads(path.read_bytes())
        except ValueError as error:
            raise MeshError(
                f"{path}: not a mesh file that can be read: expected JSON ({error})", kind="file"
            ) from error
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = scene.dump()
    except Exception as error:  # the reader raises whatever a damaged file makes it stumble over
        raise MeshError(f"{path}: not a mesh file that can be read: {_reason(error)}", kind="file") from error
    vertices, triangles, uv = [], [], []
    first = 0
    for part in parts:
        if not hasattr(part, "faces"):
            continue
        faces = np.asarray(part.faces, dtype=np.int64)
        vertices.append(np.asarray(part.vertices, dtype=np.float64))
        triangles.append(faces + first)
        part_uv = getattr(part.visual, "uv", None)
        uv.append(None if part_uv is None else np.asarray(part_uv, dtype=np.float64)[faces])
        first += len(vertices[-1])
    if not triangles:
        raise MeshError(f"{path}: expected at least one triangle, got none (or the file is damaged)", kind="empty")
    corner_uv = [part for part in uv if part is not None]
    joined = np.concatenate(corner_uv) if len(corner_uv) == len(uv) else None
    return weld(RawMesh(np.concatenate(vertices), np.concatenate(triangles), joined))


def _reason(error: Exception) -> str:
    """What went wrong, in words where the reader's error is only a name."""
    if isinstance(error, (FileNotFoundError, KeyError)):
        return f"{str(error.args[0]) if error.args else error} is missing"
    return str(error) or type(error).__name__


def weld(mesh: RawMesh) -> RawMesh:
    """Join the corners at bitwise equal positions; vertices in the order in which triangles first name them."""
    corners = mesh.vertices[mesh.triangles.reshape(-1)] + 0.0  # −0.0 becomes 0.0
    _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return RawMesh(corners[first[order]], rank[inverse.reshape(-1)].reshape(-1, 3), mesh.uv)
