"""How a glTF file moves: channels sampled in time, and the transforms of its nodes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._formats.gltf_document import MOST_POINTS, Document

__all__ = ["Nodes", "sampled"]

_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}


class Nodes:
    """The nodes of a file at given times.

    Parameters
    ----------
    document : Document
        The file.
    channels : dict
        Sampled values (times, width) by (node, path), as `sampled` gives them.
    frames : int
        Number of times.
    """

    def __init__(self, document: Document, channels: dict[tuple[int, str], Floats], frames: int) -> None:
        self._document = document
        self._channels = channels
        self._frames = frames
        self.entries = [document.item("nodes", i) for i in range(len(document.get(document.json, "nodes", list, [])))]
        self.parent = self._parents()
        self._world: dict[int, Floats] = {}

    def _parents(self) -> dict[int, int]:
        parent: dict[int, int] = {}
        for index, node in enumerate(self.entries):
            for child in self._document.get(node, "children", list, []):
                self._document.item("nodes", child)
                if child in parent:
                    raise self._document.error(
                        f"nodes[{child}]: expected one parent, got nodes {parent[child]} and {index}"
                    )
                parent[child] = index
        # With one parent each, what no root reaches is in a ring.
        reached = self._reached([i for i in range(len(self.entries)) if i not in parent])
        if len(reached) < len(self.entries):
            index = min(set(range(len(self.entries))) - reached)
            raise self._document.error(f"nodes[{index}]: expected a tree, got a node that is its own ancestor")
        return parent

    def _reached(self, roots: Iterable[int]) -> set[int]:
        """The nodes at and below these."""
        reached: set[int] = set()
        todo = list(roots)
        while todo:
            node = todo.pop()
            if node not in reached:
                reached.add(node)
                todo += self._document.get(self.entries[node], "children", list, [])
        return reached

    def with_meshes(self, part: int | None = None) -> list[int]:
        """Nodes with a mesh, of the file's scene, in their order; only those at and below ``part`` if it is given."""
        document = self._document
        number = document.get(document.json, "scene", int, 0)
        scene = document.item("scenes", number) if document.json.get("scenes") else {}
        roots = document.get(scene, "nodes", list, [i for i in range(len(self.entries)) if i not in self.parent])
        for root in roots:
            document.item("nodes", root)
        inside = self._reached(roots if part is None else [part])
        return [i for i in sorted(inside) if self.entries[i].get("mesh") is not None]

    def world(self, index: int) -> Floats:
        """Transform of a node to the scene's coordinates at each time, shape (times, 4, 4), for column vectors."""
        line = [index]
        while line[-1] not in self._world and line[-1] in self.parent:
            line.append(self.parent[line[-1]])
        for node in reversed(line):
            if node not in self._world:
                local = self._local(node)
                above = self.parent.get(node)
                self._world[node] = local if above is None else self._world[above] @ local
        return self._world[index]

    def weights(self, index: int, count: int) -> Floats:
        """Weights of the ``count`` morph targets of the mesh at a node, shape (times, count)."""
        moving = self._channels.get((index, "weights"))
        if moving is not None:
            if moving.shape[1] != count:
                raise self._document.error(
                    f"nodes[{index}].weights: expected {count} per key, one per morph target, got {moving.shape[1]}"
                )
            return moving
        node = self.entries[index]
        mesh = self._document.item("meshes", node.get("mesh"))
        given = self._document.get(node, "weights", list) or self._document.get(mesh, "weights", list) or [0.0] * count
        return np.broadcast_to(_vector(self._document, given, count, f"nodes[{index}].weights"), (self._frames, count))

    def _local(self, index: int) -> Floats:
        node = self.entries[index]
        moving = [path for path in _WIDTHS if (index, path) in self._channels]
        if "matrix" in node:
            if moving:
                raise self._document.error(f"nodes[{index}]: expected no matrix where its {moving[0]} is animated")
            matrix = _vector(self._document, node["matrix"], 16, f"nodes[{index}].matrix").reshape(4, 4).T
            return np.broadcast_to(matrix, (self._frames, 4, 4))
        parts = {}
        for path, rest in (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1])):
            still = _vector(self._document, node.get(path, rest), len(rest), f"nodes[{index}].{path}")
            parts[path] = self._channels.get((index, path), np.broadcast_to(still, (self._frames, len(rest))))
        out = np.zeros((self._frames, 4, 4))
        out[:, :3, :3] = _rotation(parts["rotation"]) * parts["scale"][:, None, :]
        out[:, :3, 3] = parts["translation"]
        out[:, 3, 3] = 1.0
        return out


def _vector(document: Document, value: Any, width: int, what: str) -> Floats:
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        vector = np.zeros(0)
    if vector.shape != (width,) or not np.isfinite(vector).all():
        raise document.error(f"{what}: expected {width} finite numbers, got {value!r:.60}")
    return vector


def _rotation(q: Floats) -> Floats:
    """Matrices (times, 3, 3) of quaternions (x, y, z, w); of any length but zero."""
    length = np.linalg.norm(q, axis=1, keepdims=True)
    x, y, z, w = (q / np.where(length > 0.0, length, 1.0)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def sampled(document: Document, animation: dict[str, Any], times: Floats) -> dict[tuple[int, str], Floats]:
    """Values of an animation's channels at ``times`` [s], (times, width), by (node, path); held outside the keys."""
    out: dict[tuple[int, str], Floats] = {}
    room = 0
    samplers = document.get(animation, "samplers", list, [])
    for number, channel in enumerate(document.get(animation, "channels", list, [])):
        target = document.get(channel, "target", dict, {})
        node, path = target.get("node"), target.get("path")
        if node is None or path not in (*_WIDTHS, "weights"):
            continue  # of an extension: no business of ours
        document.item("nodes", node)
        where = f"channels[{number}]"
        at = document.get(channel, "sampler", int, -1)
        if not 0 <= at < len(samplers):
            raise document.error(f"{where}.sampler: expected one of {len(samplers)} samplers, got {at}")
        sampler = samplers[at]
        keys = document.numbers(document.get(sampler, "input", int), "SCALAR", f"{where}.input")[:, 0]
        if not len(keys) or (np.diff(keys) <= 0.0).any():
            raise document.error(f"{where}.input: expected times that increase")
        kind = "SCALAR" if path == "weights" else f"VEC{_WIDTHS[path]}"
        values = document.numbers(document.get(sampler, "output", int), kind, f"{where}.output")
        mode = document.get(sampler, "interpolation", str, "LINEAR")
        if mode not in ("LINEAR", "STEP", "CUBICSPLINE"):
            raise document.error(f"{where}: expected interpolation LINEAR, STEP or CUBICSPLINE, got {mode!r}")
        sets = 3 * len(keys) if mode == "CUBICSPLINE" else len(keys)
        if not len(values) or len(values) % sets or (path != "weights" and len(values) != sets):
            raise document.error(f"{where}.output: expected values for {len(keys)} keys ({mode}), got {len(values)}")
        table = values.reshape(len(keys), 3 if mode == "CUBICSPLINE" else 1, -1)
        room += len(times) * table.shape[2]
        if room > 3 * MOST_POINTS:
            raise document.error(f"{where}: expected at most {3 * MOST_POINTS} values of all channels at all times")
        out[node, path] = _interpolate(keys, table, times, mode, turning=path == "rotation")
    return out


def _interpolate(keys: Floats, table: Floats, times: Floats, mode: str, *, turning: bool) -> Floats:
    """``table``: (keys, 3, width) in-tangent, value, out-tangent of a cubic spline, else (keys, 1, width)."""
    if len(keys) == 1:
        return np.repeat(table[:, -2 if mode == "CUBICSPLINE" else 0], len(times), axis=0)
    left: Ints = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
    span = keys[left + 1] - keys[left]
    s = np.clip((times - keys[left]) / span, 0.0, 1.0)[:, None]
    if mode == "CUBICSPLINE":
        h = span[:, None]
        p0, m0, p1, m1 = table[left, 1], table[left, 2] * h, table[left + 1, 1], table[left + 1, 0] * h
        s2, s3 = s * s, s * s * s
        spline: Floats = (2 * s3 - 3 * s2 + 1) * p0 + (s3 - 2 * s2 + s) * m0 + (3 * s2 - 2 * s3) * p1 + (s3 - s2) * m1
        return spline
    a, b = table[left, 0], table[left + 1, 0]
    if mode == "STEP":
        step: Floats = np.where(s < 1.0, a, b)
        return step
    line: Floats = _slerp(a, b, s) if turning else a + (b - a) * s
    return line


def _slerp(a: Floats, b: Floats, s: Floats) -> Floats:
    """Along the shorter arc between unit quaternions; along the chord where they are nearly one."""
    cosine = np.einsum("ij,ij->i", a, b)[:, None]
    b, cosine = np.where(cosine < 0.0, -b, b), np.abs(cosine)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6  # the chord is off by less than 1e-13 there
    safe = np.where(near, 1.0, sine)
    fa, fb = np.sin((1.0 - s) * angle) / safe, np.sin(s * angle) / safe
    return np.where(near, 1.0 - s, fa) * a + np.where(near, s, fb) * b
