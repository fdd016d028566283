"""``frames.npz`` as a run writes it, read by someone who knows nothing of who wrote it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from clothsim._arrays import Floats, Ints, floats, indices
from clothsim._formats.numpy_files import Archive

__all__ = ["FORMAT", "Recorded", "RecordedBody", "read"]

FORMAT = 1


@dataclass(frozen=True, eq=False)
class RecordedBody:
    """A mesh of the file; what `clothsim.Body` holds."""

    name: str
    kind: str
    vertex_count: int
    triangles: Ints
    uv: Floats | None
    static: bool
    rest: Literal["uv", "start"] | Floats | None = None
    regions: Mapping[str, Ints] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the file holds; what `clothsim.Recording` is made of."""

    bodies: list[RecordedBody]
    times: Floats
    moving: Floats
    standing: Floats
    velocities: Floats | None
    fps: float
    up: str
    name: str
    thickness: float | None


def read(path: Path) -> Recorded:
    """Read and check a recording.

    Raises
    ------
    ValueError
        The file is cut off or damaged, or what it says of itself is not what it holds.
    OSError
        It cannot be read.
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is no file")  # a pipe or device need not end
    with Archive(path) as data:
        meta = _meta(data)
        times = floats(data["times"], "times", "shape (frames,)")
        if times.ndim != 1 or not np.isfinite(times).all():
            raise ValueError(f"times: expected finite numbers of shape (frames,), got shape {times.shape}")
        frames = len(times)
        cloths = [entry for entry in meta["bodies"] if entry["kind"] == "cloth"]
        count = sum(entry["vertex_count"] for entry in cloths)
        moving, standing = [_positions(data, "positions", frames, count)], [np.zeros((0, 3))]
        bodies = _cloths(data, cloths)
        for number, entry in enumerate(entry for entry in meta["bodies"] if entry["kind"] != "cloth"):
            n, static = entry["vertex_count"], bool(entry["static"])
            positions = _positions(data, f"collider_{number}_positions", 1 if static else frames, n)
            triangles = _triangles(data, f"collider_{number}_triangles", n, entry["triangle_count"])
            bodies.append(RecordedBody(entry["name"], "collider", n, triangles, None, static))
            if static:
                standing.append(positions[0])
            else:
                moving.append(positions)
        velocities = _positions(data, "velocities", frames, count) if "velocities" in data else None
    # The cloths come first in the arrays, whatever the order of the list.
    return Recorded(
        bodies, times, np.concatenate(moving, axis=1), np.concatenate(standing), velocities, float(meta["fps"]),
        meta["up"], meta["name"], None if meta.get("thickness") is None else float(meta["thickness"]),
    )  # fmt: skip


def _meta(data: Archive) -> Mapping[str, Any]:
    text = data["meta"]
    if text.dtype.kind != "U" or text.shape != ():
        raise ValueError(f"meta: expected a text, got shape {text.shape} of {text.dtype}")
    try:
        meta = json.loads(str(text))
    except RecursionError as error:
        raise ValueError("meta: expected a table as JSON, got one that is nested without end") from error
    match meta:
        case {"format": int(number)} if number != FORMAT:
            raise ValueError(f"expected format {FORMAT}, got {number}")
        case {"format": int(_), "name": str(_), "fps": float() | int() as fps, "up": "y" | "z", "bodies": list(bodies)}:
            if not (not isinstance(fps, bool) and 0.0 < fps < math.inf):
                raise ValueError(f"meta: fps: expected a finite number > 0, got {fps}")
        case _:
            raise ValueError("meta: expected format, name, fps, up and bodies")
    thickness = meta.get("thickness")
    if thickness is not None and not (type(thickness) in (int, float) and 0.0 <= thickness < math.inf):
        raise ValueError(f"meta: thickness: expected a finite number ≥ 0 or none, got {str(thickness)[:200]}")
    for at, entry in enumerate(bodies):
        match entry:
            case {
                "name": str(_), "kind": "cloth" | "collider", "vertex_count": int(n), "triangle_count": int(m),
                "static": bool(_), "uv": bool(_),
            } if n >= 0 and m >= 0:  # fmt: skip
                if entry.get("rest") not in (None, "uv", "start", "array"):
                    got = str(entry["rest"])[:200]
                    raise ValueError(f"meta: bodies[{at}]: rest: expected uv, start, array or none, got {got}")
                regions = entry.get("regions", [])
                if not isinstance(regions, list) or not all(isinstance(region, str) for region in regions):
                    raise ValueError(f"meta: bodies[{at}]: regions: expected names, got {str(regions)[:200]}")
            case _:
                raise ValueError(
                    f"meta: bodies[{at}]: expected name, kind, vertex_count, triangle_count, static and uv, "
                    f"got {str(entry)[:200]}"
                )
    if len({entry["name"] for entry in bodies}) < len(bodies):
        raise ValueError("meta: bodies: expected names that differ")
    table: Mapping[str, Any] = meta
    return table


def _positions(data: Archive, name: str, frames: int, count: int) -> Floats:
    found = floats(data[name], name, "shape (frames, n, 3)")
    if found.shape != (frames, count, 3):
        raise ValueError(f"{name}: expected shape {(frames, count, 3)}, got shape {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: expected finite numbers")
    return found


def _triangles(data: Archive, name: str, vertices: int, count: int) -> Ints:
    found = indices(data[name], name)
    if found.shape != (count, 3) or (found.size and (found.min() < 0 or found.max() >= vertices)):
        raise ValueError(f"{name}: expected shape {(count, 3)} and vertices in 0..{vertices}, got shape {found.shape}")
    return found


def _cloths(data: Archive, entries: list[Mapping[str, Any]]) -> list[RecordedBody]:
    count, rows = (sum(entry[key] for entry in entries) for key in ("vertex_count", "triangle_count"))
    triangles = _triangles(data, "triangles", count, rows)
    uv = None
    if any(entry["uv"] for entry in entries):
        uv = floats(data["uv"], "uv", "shape (m, 3, 2)")
        if uv.shape != (rows, 3, 2):
            raise ValueError(f"uv: expected shape {(rows, 3, 2)}, got shape {uv.shape}")
    bodies: list[RecordedBody] = []
    vertex = row = 0
    for entry in entries:
        n, m = entry["vertex_count"], entry["triangle_count"]
        own = triangles[row : row + m] - vertex
        if own.size and (own.min() < 0 or own.max() >= n):
            raise ValueError(f"triangles: expected those of {entry['name']!r} to have its own vertices")
        rest = entry.get("rest")
        if rest == "array":
            name = f"rest_{len(bodies)}"
            rest = floats(data[name], name, "shape (m, 3, 2)")
            if rest.shape != (m, 3, 2) or not np.isfinite(rest).all():
                raise ValueError(f"{name}: expected finite numbers of shape {(m, 3, 2)}, got shape {rest.shape}")
        own_uv = uv[row : row + m] if uv is not None and entry["uv"] else None
        regions = _regions(data, f"regions_{len(bodies)}", entry.get("regions", []), m)
        bodies.append(RecordedBody(entry["name"], "cloth", n, own, own_uv, False, rest, regions))
        vertex, row = vertex + n, row + m
    return bodies


def _regions(data: Archive, name: str, names: list[str], triangles: int) -> dict[str, Ints]:
    """Triangles of each region of a cloth, by its name."""
    if not names:
        return {}
    region_of = indices(data[name], name)
    if region_of.shape != (triangles,) or (
        region_of.size and not -1 <= region_of.min() <= region_of.max() < len(names)
    ):
        expected = f"shape {(triangles,)} and regions in −1..{len(names)}"
        raise ValueError(f"{name}: expected {expected}, got shape {region_of.shape}")
    return {region: np.flatnonzero(region_of == number) for number, region in enumerate(names)}
