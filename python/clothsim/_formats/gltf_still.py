"""A glTF file as one still mesh: its scene at rest, skins and morph targets left out, UV kept per corner."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats import RawMesh
from clothsim._formats.gltf_document import Document
from clothsim._formats.gltf_motion import Nodes
from clothsim._formats.soup import weld
from clothsim.errors import MeshError

__all__ = ["load"]

# Modes of a primitive that are triangles: a list, a strip, a fan.
_LIST, _STRIP, _FAN = 4, 5, 6


def load(path: Path) -> RawMesh:
    """All triangles of the scene, in metres, in its own axes; v of UV counts from below, as OBJ has it.

    UV is given only if every primitive has TEXCOORD_0.
    """
    document = Document(path)
    nodes = Nodes(document, {}, 1)
    vertices: list[Floats] = []
    triangles: list[Ints] = []
    uv: list[Floats | None] = []
    first = 0
    for index in nodes.with_meshes():
        mesh = document.item("meshes", nodes.entries[index].get("mesh"))
        world = nodes.world(index)[0]
        for number, primitive in enumerate(document.get(mesh, "primitives", list, [])):
            where = f"meshes[{nodes.entries[index]['mesh']}].primitives[{number}]"
            if document.get(primitive, "mode", int, _LIST) not in (_LIST, _STRIP, _FAN):
                continue  # points and lines are no surface
            attributes = document.get(primitive, "attributes", dict, {})
            base = document.numbers(attributes.get("POSITION"), "VEC3", f"{where}.POSITION")
            corners = _corners(document, primitive, len(base), where)
            given = attributes.get("TEXCOORD_0")
            uv.append(None if given is None else _uv(document, given, len(base), where)[corners])
            vertices.append(base @ world[:3, :3].T + world[:3, 3])
            triangles.append(corners + first)
            first += len(base)
    if not sum(map(len, triangles)):
        raise MeshError(f"{path}: expected at least one triangle, got none", kind="empty")
    known = [part for part in uv if part is not None]
    joined = np.concatenate(known) if len(known) == len(uv) else None
    return weld(RawMesh(np.concatenate(vertices), np.concatenate(triangles), joined))


def _corners(document: Document, primitive: Any, count: int, where: str) -> Ints:
    """Triangles of a primitive, (m, 3)."""
    mode = document.get(primitive, "mode", int, _LIST)
    if primitive.get("indices") is None:
        row = np.arange(count)
    else:
        row = document.integers(primitive["indices"], "SCALAR", f"{where}.indices")[:, 0]
    if (row >= count).any() or (mode == _LIST and len(row) % 3) or 0 < len(row) < 3:
        got = f"{len(row)} indices up to {int(row.max(initial=-1))} for {count} vertices"
        raise document.error(f"{where}: expected indices of triangles, each below the number of vertices, got {got}")
    if mode == _LIST or not len(row):
        return row.reshape(-1, 3)
    if mode == _FAN:
        return np.stack([np.full(len(row) - 2, row[0]), row[1:-1], row[2:]], axis=1)
    strip = np.stack([row[:-2], row[1:-1], row[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    # Strips are joined by triangles without area.
    a, b, c = strip.T
    whole: Ints = strip[(a != b) & (b != c) & (c != a)]
    return whole


def _uv(document: Document, index: Any, count: int, where: str) -> Floats:
    found = document.numbers(index, "VEC2", f"{where}.TEXCOORD_0")
    if len(found) != count:
        raise document.error(f"{where}.TEXCOORD_0: expected {count} vertices, got {len(found)}")
    return np.stack([found[:, 0], 1.0 - found[:, 1]], axis=1)
