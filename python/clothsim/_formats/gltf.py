"""Animated meshes of glTF 2.0: skins, morph targets and moving nodes, sampled in time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats.animation import DEFAULT_FPS, MOST_POINTS, RawAnimation, Request, allocate
from clothsim._formats.gltf_document import Document
from clothsim._formats.gltf_motion import Nodes, sampled
from clothsim.errors import MeshError

__all__ = ["load"]

# An animation as long as an hour is a mistake of units, and a million frames are no film.
_MOST_FRAMES = 1_000_000


def load(path: Path, request: Request) -> RawAnimation:
    """All triangles of the scene (or those at the node ``request.part`` and below) as one body, in glTF's axes.

    Sampled ``request.fps`` times a second (60 by default) from time 0 to the last key of the animation. Vertices that a
    file repeats along seams of UV or normals, with the same position, skin and morphs, become one vertex.
    """
    document = Document(path)
    animation = _animation(document, request.animation)
    fps = request.fps or DEFAULT_FPS
    times = _times(document, animation, fps)
    channels = {} if animation is None else sampled(document, animation, times)
    nodes = Nodes(document, channels, len(times))
    top = None if request.part is None else _named(document, nodes, request.part)
    parts = [_Part(document, nodes, index) for index in nodes.with_meshes(top)]
    # A transform is as large as six positions.
    turning = len(nodes.entries) + sum(part.joints for part in parts)
    if 6 * len(times) * turning > MOST_POINTS:
        raise MeshError(f"{path}: expected fewer frames or nodes, got {len(times)} frames of {turning}", kind="file")
    if not sum(len(part.triangles) for part in parts):
        raise MeshError(f"{path}: expected at least one triangle, got none", kind="empty")
    firsts = np.cumsum([0, *(part.count for part in parts)]).tolist()
    positions = allocate(path, len(times), firsts[-1])
    for part, first in zip(parts, firsts, strict=False):
        part.write(nodes, positions[:, first : first + part.count])
    triangles = np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=False)])
    return RawAnimation(positions, triangles, fps, "y")


def _animation(document: Document, name: str | None) -> dict[str, Any] | None:
    listed = document.get(document.json, "animations", list, [])
    animations = [document.item("animations", i) for i in range(len(listed))]
    names = [str(a.get("name", i)) for i, a in enumerate(animations)]
    if name is not None:
        if name not in names:
            raise MeshError(f"{document.path}: animation: expected one of {names}, got {name!r}", kind="file")
        return animations[names.index(name)]
    if len(animations) > 1:
        raise MeshError(
            f"{document.path}: expected the name of one of its animations (animation = …), one of {names}", kind="file"
        )
    return animations[0] if animations else None


def _times(document: Document, animation: dict[str, Any] | None, fps: float) -> Floats:
    last = 0.0
    for sampler in document.get(animation, "samplers", list, []):
        keys = document.numbers(document.get(sampler, "input", int), "SCALAR", "samplers.input")
        last = max(last, float(keys.max(initial=0.0)))
    count = math.ceil(last * fps - 1e-6) + 1
    if count > _MOST_FRAMES:
        raise MeshError(
            f"{document.path}: expected at most {_MOST_FRAMES} frames, got {last:g} s at {fps:g} per second",
            kind="file",
        )
    return np.arange(count) / fps


def _named(document: Document, nodes: Nodes, part: str) -> int:
    """The one node of that name."""
    named = [i for i, node in enumerate(nodes.entries) if node.get("name") == part]
    if len(named) != 1:
        known = sorted({str(n["name"]) for n in nodes.entries if "name" in n})
        raise MeshError(
            f"{document.path}: part: expected the name of one node, of {known}, got {part!r} ({len(named)} nodes)",
            kind="file",
        )
    return named[0]


class _Part:
    """The mesh of one node."""

    def __init__(self, document: Document, nodes: Nodes, index: int) -> None:
        self._document, self._index = document, index
        node = nodes.entries[index]
        mesh = document.item("meshes", node.get("mesh"))
        self._skin = document.get(node, "skin", int)
        joints = document.get(document.item("skins", self._skin), "joints", list, []) if self._skin is not None else []
        for joint in joints:
            document.item("nodes", joint)
        self._joints = joints
        self.joints = len(joints)
        pieces = []
        for number, primitive in enumerate(document.get(mesh, "primitives", list, [])):
            if document.get(primitive, "mode", int, 4) != 4:
                continue  # points and lines are no surface
            pieces.append(self._primitive(primitive, f"meshes[{node['mesh']}].primitives[{number}]"))
        targets = {piece[2].shape[0] for piece in pieces}
        if len(targets) > 1:
            raise document.error(
                f"meshes[{node['mesh']}]: expected as many morph targets in each primitive, got {targets}"
            )
        self.count, self.triangles = 0, np.zeros((0, 3), dtype=np.int64)
        if pieces:
            self._weld(pieces)

    def _primitive(self, primitive: dict[str, Any], where: str) -> tuple[Ints, Floats, Floats, Ints, Floats]:
        """Triangles, base (n, 3), targets (k, n, 3), joints (n, s), weights (n, s)."""
        document = self._document
        attributes = document.get(primitive, "attributes", dict, {})
        base = document.numbers(attributes.get("POSITION"), "VEC3", f"{where}.POSITION")
        count = len(base)
        if primitive.get("indices") is None:
            corners = np.arange(count)
        else:
            corners = document.integers(primitive["indices"], "SCALAR", f"{where}.indices")[:, 0]
        if len(corners) % 3 or (corners >= count).any():
            got = f"{len(corners)} indices up to {int(corners.max(initial=-1))} for {count} vertices"
            raise document.error(
                f"{where}: expected three indices per triangle, each below the number of vertices, got {got}"
            )
        targets = []
        for number, target in enumerate(document.get(primitive, "targets", list, [])):
            moved = document.get(target, "POSITION", int)
            what = f"{where}.targets[{number}].POSITION"
            delta = np.zeros((count, 3)) if moved is None else document.numbers(moved, "VEC3", what)
            if len(delta) != count:
                raise document.error(f"{what}: expected {count} vertices, got {len(delta)}")
            targets.append(delta)
        joints, weights = self._skinning(attributes, count, where)
        morphs = np.stack(targets) if targets else np.zeros((0, count, 3))
        return corners.reshape(-1, 3), base, morphs, joints, weights

    def _skinning(self, attributes: dict[str, Any], count: int, where: str) -> tuple[Ints, Floats]:
        if self._skin is None:
            return np.zeros((count, 0), dtype=np.int64), np.zeros((count, 0))
        document = self._document
        joints, weights = [], []
        for number in range(len(attributes)):
            if f"JOINTS_{number}" not in attributes:
                break
            joints.append(document.integers(attributes[f"JOINTS_{number}"], "VEC4", f"{where}.JOINTS_{number}"))
            weights.append(document.numbers(attributes.get(f"WEIGHTS_{number}"), "VEC4", f"{where}.WEIGHTS_{number}"))
        if not joints:
            raise document.error(f"{where}: expected JOINTS_0 and WEIGHTS_0 for its skin, got none")
        if any(len(values) != count for values in (*joints, *weights)):
            raise document.error(f"{where}: expected joints and weights of {count} vertices")
        index, share = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
        used = share > 0.0
        if (share < 0.0).any() or not used.any(axis=1).all():
            vertex = int(np.argmax((share < 0.0).any(axis=1) | ~used.any(axis=1)))
            raise document.error(
                f"{where}: expected weights ≥ 0 with a sum above 0, got {share[vertex].tolist()} at {vertex}"
            )
        if (index[used] >= len(self._joints)).any():
            raise document.error(
                f"{where}: expected joints 0 to {len(self._joints) - 1} of skins[{self._skin}], got {index[used].max()}"
            )
        return np.where(used, index, 0), share / share.sum(axis=1, keepdims=True)

    def _weld(self, pieces: list[tuple[Ints, Floats, Floats, Ints, Floats]]) -> None:
        """One vertex for all that move alike."""
        width = max(piece[3].shape[1] for piece in pieces)
        rows, triangles, first = [], [], 0
        for corners, base, morphs, joints, weights in pieces:
            pad = ((0, 0), (0, width - joints.shape[1]))
            flat = morphs.transpose(1, 0, 2).reshape(len(base), -1)
            rows.append(np.concatenate([base, flat, np.pad(joints, pad), np.pad(weights, pad)], axis=1) + 0.0)
            triangles.append(corners + first)
            first += len(base)
        table = np.concatenate(rows)
        corners = np.concatenate(triangles)
        used = np.unique(corners)
        _, lead, inverse = np.unique(table[used], axis=0, return_index=True, return_inverse=True)
        order = np.argsort(lead, kind="stable")  # the file's order
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        number = np.full(len(table), -1)
        number[used] = rank[inverse.reshape(-1)]
        kept = table[used[lead[order]]]
        self.count, self.triangles = len(kept), number[corners]
        end = kept.shape[1] - 2 * width
        self._base = kept[:, :3]
        self._morphs = kept[:, 3:end].reshape(self.count, -1, 3).transpose(1, 0, 2)
        self._vertex_joints = kept[:, end : end + width].astype(np.int64)
        self._vertex_weights = kept[:, end + width :]

    def write(self, nodes: Nodes, out: Floats) -> None:
        """Positions at every time, shape (times, n, 3)."""
        if not self.count:
            return
        weights = nodes.weights(self._index, len(self._morphs)) if len(self._morphs) else None
        world = nodes.world(self._index) if self._skin is None else None
        bones = [] if self._skin is None else self._bones(nodes)
        for frame in range(len(out)):
            x = self._base if weights is None else self._base + np.tensordot(weights[frame], self._morphs, axes=1)
            if world is not None:
                out[frame] = x @ world[frame, :3, :3].T + world[frame, :3, 3]
                continue
            moved = np.zeros_like(x)
            matrices = np.stack([bone[frame] for bone in bones])
            for k in range(self._vertex_joints.shape[1]):
                matrix = matrices[self._vertex_joints[:, k]]
                moved += self._vertex_weights[:, k, None] * (
                    np.einsum("nij,nj->ni", matrix[:, :3, :3], x) + matrix[:, :3, 3]
                )
            out[frame] = moved

    def _bones(self, nodes: Nodes) -> list[Floats]:
        """Transform of each joint from the mesh as bound, at every time."""
        skin = self._document.item("skins", self._skin)
        given = self._document.get(skin, "inverseBindMatrices", int)
        inverse = np.broadcast_to(np.eye(4), (len(self._joints), 4, 4))
        if given is not None:
            flat = self._document.numbers(given, "MAT4", f"skins[{self._skin}].inverseBindMatrices")
            if len(flat) < len(self._joints):
                raise self._document.error(
                    f"skins[{self._skin}].inverseBindMatrices: expected {len(self._joints)}, got {len(flat)}"
                )
            inverse = flat.reshape(-1, 4, 4).transpose(0, 2, 1)
        return [nodes.world(joint) @ inverse[k] for k, joint in enumerate(self._joints)]
