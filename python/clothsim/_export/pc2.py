r"""Point caches (PC2): one file of float32 positions per body, beside the mesh that they belong to.

Read by Blender (Mesh Cache modifier), Maya, 3ds Max and Houdini. Layout, little-endian: ``POINTCACHE2\0``, version 1
(int32), number of points (int32), start frame (float32), frames per sample (float32), number of samples (int32), then
the samples, each points × 3 float32 [m]. One sample a frame: of a run that ends between two frames the last comes late.
"""

from __future__ import annotations

import struct
from pathlib import Path

from clothsim import _formats
from clothsim._export.limits import check_float32
from clothsim._export.names import unique_stems
from clothsim._export.usd import time_codes
from clothsim._files import whole_folder
from clothsim._formats import RawMesh
from clothsim.recording import Recording

__all__ = ["write"]

_HEADER = struct.Struct("<12siiffi")


def write(recording: Recording, folder: Path, *, overwrite: bool = False) -> None:
    """Write ``<body>.obj`` and ``<body>.pc2`` per body into ``folder``, which appears when all of them are there.

    The mesh has the vertices of the first frame in the order of the cache. A static body has the mesh alone.

    Raises
    ------
    InvalidInput
        A coordinate is above the largest float32.
    """
    check_float32(recording, "PC2")
    start = next(iter(time_codes(recording)), 0.0)
    with whole_folder(folder, overwrite=overwrite) as part:
        for body, stem in zip(recording.bodies, unique_stems(b.name for b in recording.bodies), strict=True):
            if body.static or len(recording):
                path = part / f"{stem}.obj"
                path.write_bytes(
                    _formats.write(path, RawMesh(recording.positions(body, 0), body.triangles, body.uv, body.regions))
                )
            if body.static:
                continue
            with (part / f"{stem}.pc2").open("wb") as file:
                file.write(_HEADER.pack(b"POINTCACHE2\0", 1, body.vertex_count, start, 1.0, len(recording)))
                for frame in range(len(recording)):
                    file.write(recording.positions(body, frame).astype("<f4").tobytes())
