"""Frames of a run as few bytes, for the page in the browser."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats
from clothsim._view.colours import CONTACT_COLOURS, MAPS, table
from clothsim._view.fields import Fields
from clothsim.recording import Body, Recording

__all__ = ["Packed", "pack", "residuals", "restored", "rigid_motion"]

# A vertex may be off by so much of the body's typical edge: below what shading shows.
_STEP_PER_EDGE = 1.0 / 400.0

# So many frames are worked on at once, so that memory stays bounded.
_CHUNK = 16

_MAPS = ("strain", "contact", "speed")


@dataclass
class Packed:
    """Sections of bytes, compressed as one DEFLATE stream, and the header that says what they are."""

    header: dict[str, Any]
    data: bytes
    raw_bytes: int
    precision: float


def residuals(rows: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Whole numbers (frames, n, k) as what differs from smooth motion, in planes of bytes (frames, k, 2, n).

    r_f = q_f − 2 q_{f−1} + q_{f−2} (q_f − q_{f−1} in the second frame, q_f in the first), less the same of the vertex
    before, mod 2¹⁶, signs folded: small numbers, which compress well. `restored` is the inverse.
    """
    q = rows.astype(np.int32)
    r = q.copy()
    r[1:] -= q[:-1]
    r[2:] -= q[1:-1] - q[:-2]
    d = r.copy()
    d[:, 1:] -= r[:, :-1]
    signed = d.astype(np.uint16).astype(np.int16).astype(np.int32)
    folded = ((signed << 1) ^ (signed >> 31)).astype(np.uint16).transpose(0, 2, 1)
    return np.stack([folded & 255, folded >> 8], axis=2).astype(np.uint8)


def restored(planes: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the numbers that `residuals` was given: what the page does, for tests."""
    folded = planes[:, :, 0].astype(np.int64) | planes[:, :, 1].astype(np.int64) << 8
    r = np.cumsum((folded >> 1) ^ -(folded & 1), axis=2).transpose(0, 2, 1)
    q = r.copy()
    for frame in range(1, len(q)):
        q[frame] += q[frame - 1] if frame == 1 else 2 * q[frame - 1] - q[frame - 2]
    return (q & 0xFFFF).astype(np.uint16)


def rigid_motion(first: Floats, x: Floats) -> tuple[Floats, Floats, float]:
    """Rotation R (3, 3), shift t (3,) [m] that take ``first`` to ``x`` (n, 3) [m] best, and the largest error [m].

    The orthogonal Procrustes problem (Kabsch 1976): R = V diag(1, 1, ±1) Uᵀ of the covariance's singular vectors.
    """
    a, b = first.mean(axis=0), x.mean(axis=0)
    u, _, vt = np.linalg.svd((first - a).T @ (x - b))
    flip = np.diag([1.0, 1.0, 1.0 if np.linalg.det(vt.T @ u.T) > 0.0 else -1.0])
    rotation = vt.T @ flip @ u.T
    shift = b - rotation @ a
    error = float(np.abs(first @ rotation.T + shift - x).max(initial=0.0))
    return rotation, shift, error


class _Stream:
    """Sections one after the other, compressed as they come."""

    def __init__(self) -> None:
        self._compressor = zlib.compressobj(9)
        self._parts: list[bytes] = []
        self.size = 0

    def add(self, array: NDArray[Any]) -> dict[str, int]:
        """Append an array's bytes; return where they lie."""
        at = self.size
        for piece in array if array.ndim > 1 else [array]:
            content = np.ascontiguousarray(piece).tobytes()
            self._parts.append(self._compressor.compress(content))
            self.size += len(content)
        return {"at": at, "bytes": self.size - at}

    def finish(self) -> bytes:
        return b"".join([*self._parts, self._compressor.flush()])


def pack(recording: Recording, frames: list[int], fields: Fields, *, bar: Any) -> Packed:
    """Pack the named frames of all bodies with what their colour maps show.

    Positions become whole numbers of 16 bits per axis, in steps of the body's span over 65535 or, where that is more,
    of a small share of its typical edge; rigid colliders become one matrix per frame; colours one byte per value.

    Parameters
    ----------
    recording : Recording
        The run.
    frames : list of int
        Which of its frames, ascending.
    fields : Fields
        Its colour maps.
    bar
        ``bar.update()`` is called after each frame of work.
    """
    stream = _Stream()
    bodies, precision = [], 0.0
    for body in recording.bodies:
        entry: dict[str, Any] = {"name": body.name, "kind": body.kind, "vertices": body.vertex_count}
        entry["triangles"] = stream.add(body.triangles.astype("<u4").reshape(-1))
        precision = max(precision, _positions(recording, body, frames, entry, stream))
        bodies.append(entry)
    maps = _colours(recording, frames, fields, bodies, stream, bar)
    data = stream.finish()
    header = {"bodies": bodies, "maps": maps, "raw": stream.size, "frames": len(frames)}
    return Packed(header, data, stream.size, precision)


def _positions(recording: Recording, body: Body, frames: list[int], entry: dict[str, Any], stream: _Stream) -> float:
    """Add a body's positions; return half of its step, the largest rounding error [m]."""
    shown = frames[:1] if body.static else frames
    first = recording.positions(body, frames[0])
    if body.kind == "collider" and not body.static:
        span = float(np.ptp(first, axis=0).max())
        motions = [rigid_motion(first, recording.positions(body, frame)) for frame in frames]
        if max(error for *_, error in motions) <= span / 65535.0:
            columns = [np.concatenate([r.T, t[None]]).reshape(-1) for r, t, _ in motions]
            entry["motion"] = stream.add(np.array(columns, dtype="<f4").reshape(-1))
            shown = frames[:1]
    low, high = first.min(axis=0), first.max(axis=0)
    for frame in shown:
        x = recording.positions(body, frame)
        low, high = np.minimum(low, x.min(axis=0)), np.maximum(high, x.max(axis=0))
    edges = first[body.triangles[:, 1]] - first[body.triangles[:, 0]]
    typical = float(np.median(np.linalg.norm(edges, axis=1)))
    step = max(float((high - low).max()) / 65535.0, typical * _STEP_PER_EDGE) or 1.0
    rows = np.stack([np.rint((recording.positions(body, f) - low) / step).astype(np.uint16) for f in shown])
    places = [
        stream.add(residuals(rows[max(at - 2, 0) : at + _CHUNK])[min(at, 2) :]) for at in range(0, len(rows), _CHUNK)
    ]
    entry["positions"] = {"at": places[0]["at"], "bytes": sum(place["bytes"] for place in places)}
    entry["count"], entry["low"], entry["step"] = len(shown), low.tolist(), step
    return 0.5 * step


def _colours(
    recording: Recording, frames: list[int], fields: Fields, bodies: list[dict[str, Any]], stream: _Stream, bar: Any
) -> list[dict[str, Any]]:
    maps: list[dict[str, Any]] = []
    names = [name for name in _MAPS if name != "contact" or fields.has_contact] if recording.cloth else []
    for entry in bodies:
        entry["values"] = {}
    for name in names:
        low, high = (0.0, 2.0) if name == "contact" else fields.span(name)
        rows: dict[str, list[NDArray[np.uint8]]] = {body.name: [] for body in recording.cloth}
        for frame in frames:
            touches = fields.contact(frame) if name == "contact" else {}
            for body in recording.cloth:
                if name == "contact":
                    rows[body.name].append(touches[body.name])
                    continue
                rows[body.name].append(_bytes(fields.values(name, body, frame), low, high))
            bar.update()
        for body, entry in zip(recording.cloth, bodies, strict=False):  # cloth comes first
            array = np.stack(rows[body.name])
            array[1:] -= array[:-1].copy()  # mod 256
            entry["values"][name] = stream.add(array)
        maps.append(_map(name, low, high, fields))
    if recording.cloth:
        maps.append(_map("height", *fields.span("height"), fields))
    return maps


def _bytes(values: Floats, low: float, high: float) -> NDArray[np.uint8]:
    return np.rint(np.clip((values - low) / (high - low), 0.0, 1.0) * 255.0).astype(np.uint8)


def _map(name: str, low: float, high: float, fields: Fields) -> dict[str, Any]:
    found = MAPS[name]
    entry: dict[str, Any] = {"name": name, "label": found.label, "unit": found.unit}
    if name == "contact":
        note = f"within {1e3 * fields.reach:.3g} mm of another surface"
        return {**entry, "classes": ["none", "on cloth", "on a collider"], "colours": CONTACT_COLOURS, "note": note}
    note = f"against {fields.strain_since}; mean of each vertex's triangles" if name == "strain" else ""
    return {
        **entry, "low": low, "high": high, "scale": found.scale, "note": note,
        "colours": ["#{:02x}{:02x}{:02x}".format(*row) for row in table(found, 33).tolist()],
    }  # fmt: skip
