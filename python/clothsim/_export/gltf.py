"""Animated meshes as binary glTF 2.0: frames are morph targets, and an animation fades from each to the next.

Linear between frames, as a recording is. float32 positions in metres, y up (a scene with z up is turned by the root
node). Written without a library: a JSON text and one block of arrays.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Ints
from clothsim._export.limits import check_float32
from clothsim._export.usd import body_colour, region_colour, triangles_in_no_region, vertex_normals
from clothsim._files import write_whole
from clothsim.errors import InvalidInput
from clothsim.recording import Body, Recording

__all__ = ["write"]

_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_LARGEST = 2**32 - 1  # bytes: lengths in a GLB are 32-bit


def write(recording: Recording, path: Path) -> None:
    """Write the file, whole or not at all.

    Vertices keep the body's order; those with several UV values (a seam) are repeated after the last one. v is flipped,
    as glTF counts it from the top of the picture. Regions are primitives of a mesh that share its vertices, each with a
    material of its own.

    Raises
    ------
    InvalidInput
        The recording has no frames, no bodies or coordinates beyond float32, or needs more than the 4 GiB of a GLB.
    """
    for what, count in (("frame", len(recording)), ("body", len(recording.bodies))):
        if not count:
            raise InvalidInput(f"recording: expected at least one {what} to write glTF, got none", name="recording")
    check_float32(recording, "glTF")
    vertices = sum(_split(body)[1].size * (1 if body.static else len(recording)) for body in recording.bodies)
    if 24 * vertices > _LARGEST:
        raise InvalidInput(
            f"recording: expected at most 4 GiB of frames, which is what a GLB can hold, got "
            f"{24 * vertices / 2**30:.1f} GiB: write USD or PC2",
            name="recording",
        )
    write_whole(path, _Document(recording).bytes())


def _split(body: Body) -> tuple[Ints, Ints, NDArray[np.float32] | None]:
    """Triangles (m, 3) over the split vertices, the body's vertex of each of these (k,), and their UV (k, 2)."""
    own = np.arange(body.vertex_count)
    if body.uv is None:
        return body.triangles, own, None
    # Each vertex's first value stays with it; every other value makes a vertex of its own.
    corners = np.concatenate([body.triangles.reshape(-1, 1).astype(np.float64), body.uv.reshape(-1, 2)], axis=1)
    pairs, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    vertex = pairs[:, 0].astype(np.int64)
    order = np.lexsort((first, vertex))
    lead = np.ones(len(order), dtype=bool)
    lead[1:] = vertex[order][1:] != vertex[order][:-1]
    index = np.empty(len(order), dtype=np.int64)
    index[order[lead]] = vertex[order[lead]]
    index[order[~lead]] = body.vertex_count + np.arange(np.count_nonzero(~lead))
    origin = np.concatenate([own, vertex[order[~lead]]])
    uv = np.zeros((len(origin), 2), dtype=np.float32)
    uv[index] = pairs[:, 1:]
    uv[:, 1] = 1.0 - uv[:, 1]
    return index[inverse.reshape(-1)].reshape(-1, 3), origin, uv


class _Document:
    """JSON and arrays of one file."""

    def __init__(self, recording: Recording) -> None:
        self._blocks: list[bytes] = []
        self._size = 0
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []
        self._animation: dict[str, list[dict[str, Any]]] = {"samplers": [], "channels": []}
        count = len(recording.bodies)
        root: dict[str, Any] = {"name": recording.name or "World", "children": list(range(1, count + 1))}
        if recording.up == "z":  # a quarter turn about x takes +z to +y
            root["rotation"] = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "clothsim"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [root, *({"name": b.name, "mesh": i} for i, b in enumerate(recording.bodies))],
            "meshes": [],
            "materials": [],
        }
        times: int | None = None
        for number, body in enumerate(recording.bodies):
            targets = 0 if body.static else len(recording) - 1
            self.json["meshes"].append(self._mesh(recording, body, number, targets))
            if targets:
                if times is None:
                    times = self._array(recording.times.astype(np.float32), "SCALAR", bounds=True)
                self._animate(node=number + 1, targets=targets, times=times)
        if self._animation["channels"]:
            self.json["animations"] = [{"name": recording.name or "frames", **self._animation}]
        self.json["bufferViews"], self.json["accessors"] = self._views, self._accessors
        self.json["buffers"] = [{"byteLength": self._size}]

    def bytes(self) -> bytes:
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        if total > _LARGEST:
            raise InvalidInput("recording: expected at most 4 GiB, which is what a GLB can hold", name="recording")
        head = b"glTF" + struct.pack("<II", 2, total) + struct.pack("<I", len(text)) + b"JSON"
        return b"".join([head, text, struct.pack("<I", self._size), b"BIN\0", *self._blocks])

    def _mesh(self, recording: Recording, body: Body, number: int, targets: int) -> dict[str, Any]:
        triangles, origin, uv = _split(body)
        base, normals = self._state(recording, body, 0, origin)
        attributes = {
            "POSITION": self._array(base, "VEC3", target=_VERTICES, bounds=True),
            "NORMAL": self._array(normals, "VEC3", target=_VERTICES),
        }
        if uv is not None:
            attributes["TEXCOORD_0"] = self._array(uv, "VEC2", target=_VERTICES)
        morphs: dict[str, Any] = {}
        if targets:
            morphs["targets"] = []
            for frame in range(1, targets + 1):
                x, n = self._state(recording, body, frame, origin)
                morphs["targets"].append(
                    {
                        "POSITION": self._array(x - base, "VEC3", target=_VERTICES, bounds=True),
                        "NORMAL": self._array(n - normals, "VEC3", target=_VERTICES),
                    }
                )
        mesh: dict[str, Any] = {"name": body.name, "primitives": []}
        for name, colour, own in _parts(body, number):
            primitive = {
                "attributes": attributes,
                "indices": self._array(triangles[own].astype(np.uint32).reshape(-1), "SCALAR", target=_INDICES),
                "material": len(self.json["materials"]),
            }
            self.json["materials"].append(_material(name, colour, two_sided=body.kind == "cloth"))
            mesh["primitives"].append({**primitive, **morphs})
        if targets:
            mesh["weights"] = [0.0] * targets
        return mesh

    def _state(
        self, recording: Recording, body: Body, frame: int, origin: Ints
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Positions and unit normals of the split vertices."""
        x = recording.positions(body, frame)
        normals = vertex_normals(x, body.triangles)
        return x[origin].astype(np.float32), normals[origin].astype(np.float32)

    def _animate(self, *, node: int, targets: int, times: int) -> None:
        """Weight f is 1 at frame f + 1 and 0 at all others; the first frame is the mesh itself."""
        weights = np.zeros((targets + 1, targets), dtype=np.float32)
        weights[np.arange(1, targets + 1), np.arange(targets)] = 1.0
        output = self._array(weights.reshape(-1), "SCALAR")
        self._animation["channels"].append(
            {"sampler": len(self._animation["samplers"]), "target": {"node": node, "path": "weights"}}
        )
        self._animation["samplers"].append({"input": times, "output": output, "interpolation": "LINEAR"})

    def _array(self, values: NDArray[Any], kind: str, *, target: int | None = None, bounds: bool = False) -> int:
        """Store an array; return the number of its accessor."""
        content = np.ascontiguousarray(values).tobytes()
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        self._views.append(view)
        padding = -len(content) % 4
        self._blocks.append(content + b"\0" * padding)
        self._size += len(content) + padding
        rows = values.reshape(len(values), -1)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": _UINT if values.dtype.kind == "u" else _FLOAT,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            accessor["min"] = [float(v) for v in rows.min(axis=0)]
            accessor["max"] = [float(v) for v in rows.max(axis=0)]
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _parts(body: Body, number: int) -> Iterator[tuple[str, tuple[float, float, float], Ints]]:
    """Name, colour and triangles of what is of the body's own material, if anything is, and of each region."""
    own = triangles_in_no_region(body)
    if own.size or not body.regions:
        yield body.name, body_colour(body, number), own
    for region, (name, triangles) in enumerate(body.regions.items(), start=1):
        yield f"{body.name} {name}", region_colour(body, number, region), triangles


def _material(name: str, colour: tuple[float, float, float], *, two_sided: bool) -> dict[str, Any]:
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8,
        },
        "doubleSided": two_sided,
    }  # fmt: skip
