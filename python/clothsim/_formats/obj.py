"""Wavefront OBJ.

Read here rather than through trimesh, which splits vertices at UV seams, so that cloth comes apart along each seam,
or keeps the vertices and drops the UV of one side.
Vertices keep the file's order, polygons are triangulated in place, and UV is kept per corner.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats import RawMesh
from clothsim._formats.polygons import triangulate
from clothsim.errors import MeshError

__all__ = ["dump", "parse"]

# What the format calls the group of faces in none; a "g" without names is not understood everywhere.
_NO_GROUP = "default"
# Lines that name many groups before many faces ask for room of the product: ten groups of a million faces each.
_MOST_MEMBERS = 10_000_000


def parse(content: bytes, name: str) -> RawMesh:
    """Parse the text of an OBJ file; ``name`` is for messages. Normals and lines are passed over.

    UV is given only if every corner of every face names one. Groups are what ``g`` (several names at once), ``o`` and
    ``usemtl`` say of the faces after them; the group ``default`` is that of faces in none.
    """
    vertices: list[tuple[float, float, float]] = []
    coordinates: list[tuple[float, float]] = []
    faces: list[tuple[list[int], list[int]]] = []
    current: dict[str, list[str]] = {"g": [], "o": [], "usemtl": []}
    members: dict[str, list[int]] = {}
    room = _MOST_MEMBERS
    text = content.decode("utf-8-sig", errors="replace").replace("\\\n", " ").replace("\\\r\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            if words[0] == "v":
                vertices.append((float(words[1]), float(words[2]), float(words[3])))
            elif words[0] == "vt":
                coordinates.append((float(words[1]), float(words[2]) if len(words) > 2 else 0.0))
            elif words[0] == "f":
                named = dict.fromkeys(name for names in current.values() for name in names)
                room -= len(named)
                if room < 0:
                    raise ValueError(f"expected at most {_MOST_MEMBERS} faces in all groups together")
                for group in named:
                    members.setdefault(group, []).append(len(faces))
                faces.append(_face(words[1:], len(vertices), len(coordinates)))
            elif words[0] == "g":
                current["g"] = [word for word in words[1:] if word != _NO_GROUP]
            elif words[0] in ("o", "usemtl"):
                current[words[0]] = [line.split(maxsplit=1)[1].strip()] if len(words) > 1 else []
        except (ValueError, IndexError) as error:
            text = line.strip()
            raise MeshError(f"{name}, line {number}: cannot understand {text!r} ({error})", kind="file") from error
    if not faces:
        raise MeshError(f"{name}: expected at least one face, got none", kind="empty")
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    try:
        corners, uv_corners, face_list = _triangles(faces, points)
    except ValueError as error:
        raise MeshError(f"{name}: {error}", kind="file") from error
    face_of = np.array(face_list)
    uv = None
    if coordinates and min(map(min, uv_corners)) >= 0:
        uv = np.array(coordinates, dtype=np.float64)[np.array(uv_corners)]
    groups = {name: _triangles_of(np.array(faces_of), face_of) for name, faces_of in members.items()}
    return RawMesh(points, np.array(corners, dtype=np.int64), uv, groups or None)


def _triangles_of(faces: Ints, face_of: Ints) -> Ints:
    """The triangles that ascending faces were cut into; ``face_of`` (m,), ascending, has the face of each triangle."""
    first, last = np.searchsorted(face_of, faces, "left"), np.searchsorted(face_of, faces, "right")
    lengths = last - first
    ends = np.cumsum(lengths)
    # A row of triangles per face, one after the other.
    return np.repeat(first - (ends - lengths), lengths) + np.arange(int(lengths.sum()))


def _face(words: list[str], vertex_count: int, uv_count: int) -> tuple[list[int], list[int]]:
    """Vertex and UV index (from 0; −1 for no UV) of each corner of an ``f`` line."""
    if len(words) < 3:
        raise ValueError(f"expected at least three corners, got {len(words)}")
    corners, uv = [], []
    for word in words:
        parts = word.split("/")
        corners.append(_index(parts[0], vertex_count, "vertex"))
        uv.append(_index(parts[1], uv_count, "vt") if len(parts) > 1 and parts[1] else -1)
    return corners, uv


def _index(word: str, count: int, what: str) -> int:
    """OBJ counts from 1, and backwards from the newest with negative numbers."""
    value = int(word)
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < count:
        raise ValueError(f"{what} {value} does not exist: {count} are defined so far")
    return index


def _triangles(
    faces: list[tuple[list[int], list[int]]], points: Floats
) -> tuple[list[list[int]], list[list[int]], list[int]]:
    """Corners, UV corners and face of each triangle."""
    corners: list[list[int]] = []
    uv_corners: list[list[int]] = []
    face_of: list[int] = []
    for number, (face, uv) in enumerate(faces):
        for local in [(0, 1, 2)] if len(face) == 3 else triangulate(points[face]):
            corners.append([face[k] for k in local])
            uv_corners.append([uv[k] for k in local])
            face_of.append(number)
    return corners, uv_corners, face_of


def dump(mesh: RawMesh) -> bytes:
    """Text of an OBJ file; numbers read back to the same float64. Equal UV of corners are written once.

    Groups become ``g`` lines; blanks in their names, which part names there, become ``_``. Triangles in no group are in
    ``default``.
    """
    out = BytesIO()
    _rows(out, b"v ", mesh.vertices)
    triangles: Ints = mesh.triangles + 1
    if mesh.uv is None:
        lines = [b"f %d %d %d\n" % tuple(face) for face in triangles.tolist()]
    else:
        coordinates, index = np.unique(mesh.uv.reshape(-1, 2), axis=0, return_inverse=True)
        _rows(out, b"vt ", coordinates)
        pairs = np.stack([triangles, index.reshape(-1, 3) + 1], axis=-1)
        lines = [b"f " + b" ".join(b"%d/%d" % (v, t) for v, t in face) + b"\n" for face in pairs.tolist()]
    if mesh.groups:
        names: list[list[str]] = [[] for _ in lines]
        for name, members in mesh.groups.items():
            for triangle in members.tolist():
                word = "_".join(name.split()) or "_"
                names[triangle].append("default_" if word == _NO_GROUP else word)
        for t in range(len(lines)):
            if t == 0 or names[t] != names[t - 1]:
                out.write(("g " + " ".join(names[t] or [_NO_GROUP])).encode() + b"\n")
            out.write(lines[t])
        return out.getvalue()
    out.writelines(lines)
    return out.getvalue()


def _rows(out: BytesIO, prefix: bytes, rows: Floats | Ints) -> None:
    out.writelines(prefix + " ".join(map(repr, row)).encode() + b"\n" for row in rows.tolist())
