"""A folder with one mesh file per frame and body."""

from __future__ import annotations

import shutil
from pathlib import Path

from clothsim import _formats
from clothsim._export.names import file_stem
from clothsim._files import output_error
from clothsim._formats import RawMesh
from clothsim.errors import OutputExists
from clothsim.recording import Recording

__all__ = ["write"]


def write(recording: Recording, folder: Path, suffix: str, *, overwrite: bool = False) -> None:
    """Write ``<body>_0000.<suffix>`` … into ``folder``, which appears when all of them are there.

    A static body is written once, as ``<body>.<suffix>``.
    """
    if folder.exists() and not overwrite:
        raise OutputExists(f"{folder}: there is something of that name already")
    part = folder.with_name(f".{folder.name}.part")
    digits = max(4, len(str(len(recording) - 1)))
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for body in recording.bodies:
            stem = file_stem(body.name)
            for frame in range(1 if body.static else len(recording)):
                number = "" if body.static else f"_{frame:0{digits}d}"
                path = part / f"{stem}{number}.{suffix}"
                mesh = RawMesh(recording.positions(body, frame), body.triangles, body.uv)
                path.write_bytes(_formats.write(path, mesh))
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)
    except OSError as error:
        raise output_error(folder, error) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
