"""A folder with one mesh file per frame and body."""

from __future__ import annotations

from pathlib import Path

from clothsim import _formats
from clothsim._export.names import frame_name, unique_stems
from clothsim._files import whole_folder
from clothsim._formats import RawMesh
from clothsim.recording import Recording

__all__ = ["write"]


def write(recording: Recording, folder: Path, suffix: str, *, overwrite: bool = False) -> None:
    """Write ``<body>_0000.<suffix>`` … into ``folder``, which appears when all of them are there.

    A static body is written once, as ``<body>.<suffix>``.
    """
    count = len(recording)
    with whole_folder(folder, overwrite=overwrite) as part:
        for body, stem in zip(recording.bodies, unique_stems(b.name for b in recording.bodies), strict=True):
            for frame in range(1 if body.static else count):
                path = part / f"{stem if body.static else frame_name(stem, frame, count)}.{suffix}"
                mesh = RawMesh(recording.positions(body, frame), body.triangles, body.uv, body.regions)
                path.write_bytes(_formats.write(path, mesh))
