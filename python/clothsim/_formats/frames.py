"""A mesh file per frame: ``walk/*.obj``, or a folder of OBJ, PLY or STL files, in order of their numbers."""

from __future__ import annotations

import glob
import re
from pathlib import Path

import numpy as np

from clothsim import _formats
from clothsim._formats.animation import RawAnimation, Request, allocate, check_frame
from clothsim.errors import MeshError

__all__ = ["load"]

_SUFFIXES = (".obj", ".ply", ".stl")


def load(path: Path, _request: Request) -> RawAnimation:
    """Read all frames; each must have the vertices and triangles of the first."""
    files = _files(path)
    first = _formats.read(files[0])
    positions = allocate(path, len(files), len(first.vertices))
    for frame, file in enumerate(files):
        mesh = first if frame == 0 else _formats.read(file)
        if len(mesh.vertices) != len(first.vertices) or len(mesh.triangles) != len(first.triangles):
            raise MeshError(
                f"{file}: expected the topology of {files[0].name} ({len(first.vertices)} vertices, "
                f"{len(first.triangles)} triangles), got {len(mesh.vertices)} vertices and {len(mesh.triangles)} "
                "triangles",
                kind="topology",
            )
        if not np.array_equal(mesh.triangles, first.triangles):
            at = int(np.argmax((mesh.triangles != first.triangles).any(axis=1)))
            raise MeshError(
                f"{file}: expected the topology of {files[0].name}, got triangle {at} with vertices "
                f"{mesh.triangles[at].tolist()} instead of {first.triangles[at].tolist()}",
                kind="topology",
            )
        check_frame(file, frame, mesh.vertices)
        positions[frame] = mesh.vertices
    return RawAnimation(positions, first.triangles, None)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found = [p for p in path.iterdir() if p.suffix.lower() in _SUFFIXES and p.is_file()]
        if len(kinds := sorted({p.suffix.lower() for p in found})) > 1:
            raise MeshError(
                f"{path}: expected frames of one kind, got {', '.join(kinds)}: name them, as {path.name}/*{kinds[0]}",
                kind="file",
            )
    else:
        found = [Path(name) for name in glob.glob(str(path)) if Path(name).is_file()]
    if not found:
        what = "a folder with" if path.is_dir() else "a pattern of"
        raise MeshError(
            f"{path}: expected frames ({what} {', '.join(_SUFFIXES)} files, a .npz, glTF or USD file), got none",
            kind="file",
        )
    return sorted(found, key=_number_key)


def _number_key(path: Path) -> list[tuple[int, int, str]]:
    """Names in order of their numbers: ``walk_9`` before ``walk_10``."""
    parts = re.split(r"(\d+)", path.stem)
    return [(1, int(part), part) if part.isdigit() and part.isascii() else (0, 0, part) for part in parts]
