"""PLY, ASCII and binary of both byte orders.

Read here rather than through trimesh, which reorders faces, drops unreferenced vertices and refuses binary files
that mix triangles with other polygons.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats import RawMesh
from clothsim._formats.polygons import triangulate
from clothsim.errors import MeshError

__all__ = ["dump", "parse"]

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))


@dataclass
class _Property:
    name: str
    type: str
    count_type: str | None = None  # of a list


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def parse(content: bytes, name: str) -> RawMesh:
    """Parse a PLY file; ``name`` is for messages. UV is read from vertex properties (s, t), (u, v) or texture_u/v."""
    try:
        return _parse(content)
    except (ValueError, IndexError, KeyError, OverflowError, UnicodeDecodeError) as error:
        raise MeshError(f"{name}: not a PLY file that can be read: {error}", kind="file") from error


def _parse(content: bytes) -> RawMesh:
    order, elements, at = _header(content)
    body = _Ascii(content[at:]) if order == "=" else _Binary(content[at:], order)
    vertices: Floats | None = None
    uv: Floats | None = None
    polygons: list[Ints] = []
    for element in elements:
        columns = body.read(element)
        if element.name == "vertex":
            if missing := [axis for axis in "xyz" if axis not in columns]:
                raise ValueError(f"element vertex has no property {', '.join(missing)}")
            vertices = np.stack([np.asarray(columns[axis], dtype=np.float64) for axis in "xyz"], axis=1)
            for pair in _UV_NAMES:
                if all(key in columns for key in pair):
                    uv = np.stack([np.asarray(columns[key], dtype=np.float64) for key in pair], axis=1)
                    break
        elif element.name == "face":
            lists = columns.get("vertex_indices", columns.get("vertex_index"))
            if lists is None:
                raise ValueError("element face has neither vertex_indices nor vertex_index")
            polygons = [_whole(polygon) for polygon in lists]
    if vertices is None:
        raise ValueError("expected an element vertex, got none")
    triangles = _triangles(polygons, vertices)
    return RawMesh(vertices, triangles, None if uv is None else uv[triangles])


def _whole(polygon: Any) -> Ints:
    values = np.asarray(polygon)
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    indices: Ints = values.astype(np.int64)
    if not np.array_equal(indices, values):
        raise ValueError(f"expected whole numbers as face indices, got {values.tolist()}")
    return indices


def _triangles(polygons: list[Ints], vertices: Floats) -> Ints:
    if polygons and all(len(polygon) == 3 for polygon in polygons):
        triangles = np.stack(polygons)
        _check_range(triangles, len(vertices))
        return triangles
    rows: list[Ints] = []
    for polygon in polygons:
        _check_range(polygon, len(vertices))
        rows.extend(polygon[list(local)] for local in triangulate(vertices[polygon]))
    if not rows:
        raise ValueError("expected at least one face, got none")
    return np.stack(rows)


def _check_range(indices: Ints, count: int) -> None:
    bad = (indices < 0) | (indices >= count)
    if bad.any():
        raise ValueError(f"face index {int(indices[bad][0])} does not exist: there are {count} vertices")


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """Byte order, elements, and where the body starts."""
    if content[:3] != b"ply":
        raise ValueError("the first line is not 'ply'")
    end = content.find(b"end_header")
    newline = content.find(b"\n", end)
    if end < 0 or newline < 0:
        raise ValueError("the header has no end_header line")
    order = ""
    elements: list[_Element] = []
    for line in content[:end].decode("ascii").splitlines()[1:]:
        match line.split():
            case ["format", kind, _]:
                if kind not in _ORDERS:
                    raise ValueError(f"header line {line!r}")
                order = _ORDERS[kind]
            case ["element", element, count]:
                elements.append(_Element(element, int(count)))
                if elements[-1].count < 0:
                    raise ValueError(f"header line {line!r}")
            case ["property", "list", count_type, item, key]:
                elements[-1].properties.append(_Property(key, _TYPES[item], _TYPES[count_type]))
            case ["property", item, key]:
                elements[-1].properties.append(_Property(key, _TYPES[item]))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"header line {line!r}")
    if not order:
        raise ValueError("the header has no format line")
    return order, elements, newline + 1


class _Ascii:
    """Values as words, in order."""

    def __init__(self, body: bytes) -> None:
        self.words = body.split()
        self.at = 0

    def read(self, element: _Element) -> dict[str, list[object]]:
        columns: dict[str, list[object]] = {p.name: [] for p in element.properties}
        # An element without properties takes no bytes, however many the header counts.
        for _ in range(element.count if element.properties else 0):
            for p in element.properties:
                if p.count_type is None:
                    columns[p.name].append(self._take(1, p.type)[0])
                else:
                    columns[p.name].append(self._take(int(self._take(1, "i8")[0]), p.type))
        return columns

    def _take(self, count: int, kind: str) -> list[float] | list[int]:
        if count < 0:
            raise ValueError(f"expected the length of a list, got {count}")
        words = self.words[self.at : self.at + count]
        if len(words) != count:
            raise ValueError("the file ends before its last element")
        self.at += count
        return [float(w) for w in words] if kind[0] == "f" else [int(w) for w in words]


class _Binary:
    """Records; those with lists are read in one piece when all lists have the length of the first."""

    def __init__(self, body: bytes, order: str) -> None:
        self.body = body
        self.order = order
        self.at = 0

    def read(self, element: _Element) -> dict[str, Any]:
        if element.count == 0 or not element.properties:
            return {p.name: [] for p in element.properties}
        lengths = self._first_lengths(element)
        fields: list[tuple[str, str] | tuple[str, str, int]] = []
        for index, p in enumerate(element.properties):
            if p.count_type is None:
                fields.append((p.name, self.order + p.type))
            else:
                fields.append((f"{p.name} length", self.order + p.count_type))
                fields.append((p.name, self.order + p.type, lengths[index]))
        record = np.dtype(fields)
        if self.at + record.itemsize * element.count <= len(self.body):
            table = np.frombuffer(self.body, dtype=record, count=element.count, offset=self.at)
            uniform = all(
                np.all(table[f"{p.name} length"] == lengths[index])
                for index, p in enumerate(element.properties)
                if p.count_type is not None
            )
            if uniform:
                self.at += record.itemsize * element.count
                return {p.name: table[p.name].reshape(element.count, -1).squeeze(1)
                        if p.count_type is None else table[p.name].reshape(element.count, -1)
                        for p in element.properties}  # fmt: skip
        return self._read_slowly(element)

    def _first_lengths(self, element: _Element) -> list[int]:
        start, lengths = self.at, []
        for p in element.properties:
            if p.count_type is None:
                self._take(1, p.type)
                lengths.append(1)
            else:
                lengths.append(int(self._take(1, p.count_type)[0]))
                self._take(lengths[-1], p.type)
        self.at = start
        return lengths

    def _read_slowly(self, element: _Element) -> dict[str, list[object]]:
        columns: dict[str, list[object]] = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                if p.count_type is None:
                    columns[p.name].append(self._take(1, p.type)[0])
                else:
                    columns[p.name].append(self._take(int(self._take(1, p.count_type)[0]), p.type))
        return columns

    def _take(self, count: int, kind: str) -> Floats:
        item = np.dtype(self.order + kind)
        if count < 0 or self.at + count * item.itemsize > len(self.body):
            raise ValueError("the file ends before its last element")
        values: Floats = np.frombuffer(self.body, dtype=item, count=count, offset=self.at)
        self.at += count * item.itemsize
        return values


def dump(mesh: RawMesh) -> bytes:
    """Bytes of a binary little-endian PLY file, positions in double.

    UV goes to the vertices (s, t) where every vertex has one; on a seam, where a vertex has several, PLY cannot hold
    it and the file has none: write OBJ for those.
    """
    uv = _vertex_uv(mesh)
    header = [
        "ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}",
        "property double x", "property double y", "property double z",
    ]  # fmt: skip
    columns = mesh.vertices
    if uv is not None:
        header += ["property double s", "property double t"]
        columns = np.concatenate([columns, uv], axis=1)
    header += [
        f"element face {len(mesh.triangles)}", "property list uchar int vertex_indices", "end_header", "",
    ]  # fmt: skip
    faces = np.empty(len(mesh.triangles), dtype=[("length", "u1"), ("corners", "<i4", 3)])
    faces["length"] = 3
    faces["corners"] = mesh.triangles
    return "\n".join(header).encode() + np.ascontiguousarray(columns, dtype="<f8").tobytes() + faces.tobytes()


def _vertex_uv(mesh: RawMesh) -> Floats | None:
    if mesh.uv is None:
        return None
    uv = np.zeros((len(mesh.vertices), 2))
    uv[mesh.triangles] = mesh.uv
    return uv if np.array_equal(uv[mesh.triangles], mesh.uv) else None
