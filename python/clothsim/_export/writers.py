"""What the frames of a run can be written as: one table for the command line and for ``[output]``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from clothsim.errors import OutputExists
from clothsim.recording import Recording

__all__ = ["FORMATS", "Format", "write"]


class Format(NamedTuple):
    """File or folder in the run's folder, and who writes it whole or not at all, over what is there."""

    file: str
    write: Callable[[Recording, Path], None]


def _usd(recording: Recording, path: Path) -> None:
    recording.save_usd(path)


def _gltf(recording: Recording, path: Path) -> None:
    recording.save_gltf(path)


def _pc2(recording: Recording, path: Path) -> None:
    from clothsim._export import pc2

    pc2.write(recording, path, overwrite=True)


def _vtk(recording: Recording, path: Path) -> None:
    from clothsim._export import vtk

    vtk.write(recording, path, overwrite=True)


def _sequence(suffix: str) -> Callable[[Recording, Path], None]:
    def write(recording: Recording, path: Path) -> None:
        from clothsim._export import sequence

        sequence.write(recording, path, suffix, overwrite=True)

    return write


# By their keys in [output].
FORMATS = {
    "usd": Format("scene.usdc", _usd),
    "gltf": Format("scene.glb", _gltf),
    "pc2": Format("pc2", _pc2),
    "vtk": Format("vtk", _vtk),
    "obj": Format("obj", _sequence("obj")),
    "ply": Format("ply", _sequence("ply")),
}


def write(recording: Recording, folder: Path, name: str, *, overwrite: bool = False) -> Path:
    """Write one format into ``folder``; return the path.

    Raises
    ------
    OutputExists
        There is something of that name, and ``overwrite`` is not set.
    """
    path = folder / FORMATS[name].file
    if path.exists() and not overwrite:
        raise OutputExists(f"{path}: there is something of that name already; --overwrite replaces it")
    FORMATS[name].write(recording, path)
    return path
