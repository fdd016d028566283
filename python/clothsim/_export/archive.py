"""All frames in one ``.npz``; `clothsim._formats.recorded` reads it back."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats, Ints
from clothsim._files import whole
from clothsim._formats.recorded import FORMAT
from clothsim.recording import Body, Recording

__all__ = ["write"]


def write(recording: Recording, path: Path) -> None:
    """Write the arrays that `Recording.save` lists, whole or not at all."""
    with whole(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, shape, rows in _members(recording):
            _write_member(archive, name, shape, rows)


def _members(recording: Recording) -> Iterator[tuple[str, NDArray[Any] | tuple[int, ...], Iterable[Floats]]]:
    cloth, frames = recording.cloth, range(len(recording))
    count = sum(b.vertex_count for b in cloth)
    yield "times", recording.times, ()
    yield "positions", (len(frames), count, 3), (_joined([recording.positions(b, f) for b in cloth]) for f in frames)
    if recording.has_velocities:
        rows = (_joined([v for b in cloth if (v := recording.velocities(b, f)) is not None]) for f in frames)
        yield "velocities", (len(frames), count, 3), rows
    firsts = np.cumsum([0, *(b.vertex_count for b in cloth)]).tolist()
    triangles = [b.triangles + first for b, first in zip(cloth, firsts, strict=False)]
    yield "triangles", np.concatenate([np.zeros((0, 3), np.int64), *triangles]), ()
    if any(b.uv is not None for b in cloth):
        uv = [np.full((len(b.triangles), 3, 2), np.nan) if b.uv is None else b.uv for b in cloth]
        yield "uv", np.concatenate(uv), ()
    for index, body in enumerate(cloth):
        if isinstance(body.rest, np.ndarray):
            yield f"rest_{index}", body.rest, ()
        if body.regions:
            yield f"regions_{index}", _region_of(body), ()
    for index, body in enumerate(b for b in recording.bodies if b.kind == "collider"):
        if body.static:
            yield f"collider_{index}_positions", recording.positions(body, 0)[None], ()
        else:
            of_frames = (recording.positions(body, f) for f in frames)
            yield f"collider_{index}_positions", (len(frames), body.vertex_count, 3), of_frames
        yield f"collider_{index}_triangles", body.triangles, ()
    meta = {
        "format": FORMAT, "name": recording.name, "fps": recording.fps, "up": recording.up, "units": "m, s",
        "thickness": recording.thickness,
        "bodies": [
            {"name": b.name, "kind": b.kind, "vertex_count": b.vertex_count, "static": b.static,
             "triangle_count": len(b.triangles), "uv": b.uv is not None,
             "rest": "array" if isinstance(b.rest, np.ndarray) else b.rest,
             **({"regions": list(b.regions)} if b.regions else {})}
            for b in recording.bodies
        ],
    }  # fmt: skip
    yield "meta", np.array(json.dumps(meta)), ()


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate([np.zeros((0, 3)), *parts])


def _region_of(body: Body) -> Ints:
    """Number of the region of each triangle (m,), −1 for none."""
    region_of = np.full(len(body.triangles), -1, np.int64)
    for number, triangles in enumerate(body.regions.values()):
        region_of[triangles] = number
    return region_of


def _write_member(
    archive: zipfile.ZipFile, name: str, array: NDArray[Any] | tuple[int, ...], rows: Iterable[Floats]
) -> None:
    """One array of an ``.npz``, as numpy writes it; where a shape is given, its rows are streamed."""
    info = zipfile.ZipInfo(f"{name}.npy")  # dated 1980: the same bytes at any time
    with archive.open(info, "w", force_zip64=True) as member:
        if isinstance(array, np.ndarray):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(array, order="C"), allow_pickle=False)
            member.write(buffer.getvalue())
            return
        header = {"descr": "<f8", "fortran_order": False, "shape": array}
        np.lib.format.write_array_header_1_0(member, header)
        for row in rows:
            member.write(np.ascontiguousarray(row, dtype="<f8").tobytes())
