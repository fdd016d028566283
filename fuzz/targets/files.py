"""What the targets that read files share."""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import clothsim as cs
from clothsim.errors import ClothSimError
from fuzz.target import File, refused

__all__ = ["read", "sound_mesh", "written"]


@functools.cache
def _folder() -> Path:
    # In memory where that is to be had: a file per case.
    shm = Path("/dev/shm")
    folder = tempfile.mkdtemp(prefix="clothsim-fuzz-", dir=shm if shm.is_dir() else None)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def written(case: File) -> Path:
    """The case as a file."""
    path = _folder() / f"case{case.suffix}"
    path.write_bytes(case.content)
    return path


def read(case: File, reader: Callable[[Path], Any], *errors: type[ClothSimError]) -> Any:
    """What the reader says of the file; None where it refuses it by one of ``errors`` that names it."""
    path = written(case)
    try:
        return reader(path)
    except errors as error:
        refused(error, path.name)
        return None


def sound_mesh(mesh: cs.Mesh) -> None:
    """Hold a mesh against what a `Mesh` promises."""
    assert np.isfinite(mesh.vertices).all()
    assert mesh.triangles.size and 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.vertices)
    assert mesh.uv is None or (mesh.uv.shape == (len(mesh.triangles), 3, 2) and np.isfinite(mesh.uv).all())
    for members in mesh.groups.values():
        assert not members.size or (members[0] >= 0 and members[-1] < len(mesh.triangles))
