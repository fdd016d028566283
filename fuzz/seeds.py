"""Small sound files of every format that is read, made here, to be damaged."""

from __future__ import annotations

import base64
import functools
import io
import json
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

import clothsim as cs
from fuzz.target import File

__all__ = ["animated_gltf", "archive", "binary_gltf", "meshes", "recording", "stages", "text_gltf"]

_SHEET = cs.Mesh.grid(1.0, 1.0, 3, 3)

_OBJ = b"""# two panels, a concave polygon, groups
mtllib none.mtl
o coat
v 0 0 0
v 1 0 0
v 1 1 0.25
v 0 1 0
v 2 0.5 0
v 0.5 0.5 1e-3
vt 0 0
vt 1 0
vt 1 1
g front back
f 1/1 2/2 3/3 4/3
usemtl wool
f 2 5 3
f -1 -2 -3
f 1 2 \\
 6 4
"""

_PLY = b"""ply
format ascii 1.0
comment mixed polygons
element vertex 5
property float x
property float y
property float z
property uchar red
element face 2
property uchar flags
property list uchar int vertex_indices
end_header
0 0 0 1
1 0 0 2
1 1 0 3
0 1 0 4
2 2 0.5 5
7 4 0 1 2 3
7 3 1 4 2
"""


def _ply_binary(order: str) -> bytes:
    name = "little" if order == "<" else "big"
    head = (
        f"ply\nformat binary_{name}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property double z\n"
        "property float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\n"
        "property short material\nelement edge 1\nproperty int a\nproperty int b\nend_header\n"
    )
    body = b"".join(
        struct.pack(order + "ffdff", x, y, 0.1, x, y) for x, y in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    )
    body += struct.pack(order + "B4ih", 4, 0, 1, 2, 3, 1) + struct.pack(order + "B3ih", 3, 0, 1, 3, 2)
    return head.encode() + body + struct.pack(order + "ii", 0, 1)


_STL = b"""solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
facet normal 0 0 1
outer loop
vertex 1 0 0
vertex 1 1 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""


def _stl_binary() -> bytes:
    corners = _SHEET.vertices[_SHEET.triangles].astype("<f4")
    facets = b"".join(bytes(12) + c.tobytes() + bytes(2) for c in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + facets


@functools.cache
def meshes() -> list[File]:
    """OBJ, PLY and STL."""
    with tempfile.TemporaryDirectory() as folder:
        ours = []
        for suffix in (".obj", ".ply"):
            path = Path(folder) / f"a{suffix}"
            _SHEET.save(path)
            ours.append(File(suffix, path.read_bytes()))
    return [
        *ours, File(".obj", _OBJ), File(".ply", _PLY), File(".ply", _ply_binary("<")), File(".ply", _ply_binary(">")),
        File(".stl", _STL), File(".stl", _stl_binary()),
    ]  # fmt: skip


class _Arrays:
    """The arrays of a glTF file."""

    def __init__(self) -> None:
        self.blob = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Any, dtype: str, kind: str) -> int:
        content = np.asarray(values, dtype=dtype)
        self.views.append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": content.nbytes})
        self.blob += content.tobytes() + b"\0" * (-content.nbytes % 4)
        codes = {"f4": 5126, "u2": 5123, "u1": 5121}
        self.accessors.append(
            {"bufferView": len(self.views) - 1, "componentType": codes[dtype], "count": len(content), "type": kind}
        )
        return len(self.accessors) - 1


@functools.cache
def animated_gltf() -> tuple[dict[str, Any], bytes]:
    """A skinned strip with a morph target, two nodes that move, a sparse accessor; JSON and buffer."""
    arrays = _Arrays()
    strip = np.array([[x, y, 0.0] for y in (0.0, 0.5, 1.0) for x in (-0.5, 0.5)])
    joints, weights = np.zeros((6, 4)), np.zeros((6, 4))
    joints[:, 1] = 1
    weights[:, 0], weights[:, 1] = 0.5, 0.5
    inverse = np.array([np.eye(4), np.eye(4)]).reshape(2, 16)
    quarter = np.sqrt(0.5)
    attributes = {
        "POSITION": arrays.add(strip, "f4", "VEC3"), "TEXCOORD_0": arrays.add(strip[:, :2], "f4", "VEC2"),
        "JOINTS_0": arrays.add(joints, "u1", "VEC4"), "WEIGHTS_0": arrays.add(weights, "f4", "VEC4"),
    }  # fmt: skip
    corners = arrays.add([0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4], "u2", "SCALAR")
    target = arrays.add(strip * 0.1, "f4", "VEC3")
    times, turns = (
        arrays.add([0.0, 0.05], "f4", "SCALAR"),
        arrays.add([[0, 0, 0, 1], [0, 0, quarter, quarter]], "f4", "VEC4"),
    )
    shares, ways = arrays.add([0.0, 1.0], "f4", "SCALAR"), arrays.add(np.zeros((6, 3)), "f4", "VEC3")
    index, value = arrays.add([1, 4], "u1", "SCALAR"), arrays.add(np.ones((2, 3)), "f4", "VEC3")
    arrays.accessors[target]["sparse"] = {
        "count": 2, "indices": {"bufferView": index, "componentType": 5121}, "values": {"bufferView": value},
    }  # fmt: skip
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "body", "mesh": 0, "skin": 0},
            {"name": "root", "children": [2, 3], "translation": [0.0, 0.1, 0.0]},
            {"name": "elbow", "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
            {"name": "hat", "mesh": 1, "matrix": np.eye(4).reshape(-1).tolist()},
        ],
        "meshes": [
            {"primitives": [{"attributes": attributes, "indices": corners, "targets": [{"POSITION": target}]}],
             "weights": [0.5]},
            {"primitives": [{"attributes": {"POSITION": attributes["POSITION"]}, "mode": 4}]},
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": arrays.add(inverse, "f4", "MAT4")}],
        "animations": [{
            "name": "bend",
            "samplers": [{"input": times, "output": turns}, {"input": times, "output": shares, "interpolation": "STEP"},
                         {"input": times, "output": ways, "interpolation": "CUBICSPLINE"}],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}},
                         {"sampler": 1, "target": {"node": 0, "path": "weights"}},
                         {"sampler": 2, "target": {"node": 1, "path": "translation"}}],
        }],
        "bufferViews": arrays.views, "accessors": arrays.accessors, "buffers": [{"byteLength": len(arrays.blob)}],
    }  # fmt: skip
    return tree, arrays.blob


def binary_gltf(tree: Any, blob: bytes) -> bytes:
    """GLB of a tree of JSON and a buffer."""
    text = json.dumps(tree).encode("utf-8", "surrogatepass")
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def text_gltf(tree: Any, blob: bytes) -> bytes:
    """JSON glTF with its buffer in line, as far as the tree still has the place for it."""
    match tree:
        case {"buffers": [dict(first), *_]}:
            first.setdefault("uri", "data:application/octet-stream;base64," + base64.b64encode(blob).decode())
    return json.dumps(tree).encode("utf-8", "surrogatepass")


@functools.cache
def stages() -> list[File]:
    """USD as text and as crate, with time samples."""
    body = cs.Body("sheet", "cloth", 9, _SHEET.triangles)
    frames = np.repeat(_SHEET.vertices[None], 2, axis=0)
    frames[1, :, 1] += 0.1
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for suffix in (".usda", ".usdc"):
            path = Path(folder) / f"a{suffix}"
            cs.Recording([body], np.arange(2) / 24, frames, fps=24).save_usd(path)
            out.append(File(suffix, path.read_bytes()))
    return out


def npy(array: Any) -> bytes:
    """A NumPy file."""
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()


def archive(members: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    """A zip of named members."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as file:
        for name, content in members.items():
            file.writestr(zipfile.ZipInfo(name), content, method)
    return buffer.getvalue()


@functools.cache
def recording() -> dict[str, bytes]:
    """The members of a recording of two cloths and two colliders."""
    rng = np.random.default_rng(0)
    triangles = np.array([[0, 1, 2]])
    bodies = [
        cs.Body("a", "cloth", 3, triangles, np.zeros((1, 3, 2))), cs.Body("b", "cloth", 3, triangles),
        cs.Body("floor", "collider", 3, triangles, None, True), cs.Body("arm", "collider", 3, triangles),
    ]  # fmt: skip
    frames = cs.Recording(
        bodies, np.arange(2) / 30, rng.normal(size=(2, 9, 3)), np.zeros((3, 3)), velocities=np.zeros((2, 6, 3)), fps=30
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.npz"
        frames.save(path)
        with zipfile.ZipFile(path) as file:
            return {name: file.read(name) for name in file.namelist()}
