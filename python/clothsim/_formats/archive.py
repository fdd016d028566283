"""NumPy archives of an animated mesh: ``positions`` (frames, n, 3) and ``triangles`` (m, 3)."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from clothsim._arrays import floats, indices
from clothsim._formats.animation import RawAnimation, Request
from clothsim.errors import InvalidInput, MeshError

__all__ = ["load"]


def load(path: Path, _request: Request) -> RawAnimation:
    """Read the two arrays; other arrays of the archive are passed over."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            names = sorted(data) if isinstance(data, np.lib.npyio.NpzFile) else ["one array without a name"]
            if missing := {"positions", "triangles"} - set(names):
                raise MeshError(
                    f"{path}: expected positions and triangles, got {names}: {', '.join(sorted(missing))} missing",
                    kind="file",
                )
            positions, triangles = data["positions"], data["triangles"]
    except MeshError:
        raise
    except (OSError, EOFError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MeshError(f"{path}: not an archive that can be read: {reason}", kind="file") from error
    try:
        positions = floats(positions, "positions", "shape (frames, n, 3)")
        triangles = indices(triangles, "triangles")
        if positions.ndim != 3 or positions.shape[2] != 3 or not len(positions):
            raise InvalidInput(
                f"positions: expected shape (frames, n, 3), got shape {positions.shape}", name="positions"
            )
    except InvalidInput as error:
        raise MeshError(f"{path}: {error}", kind="file") from error
    return RawAnimation(positions, triangles, None)
