"""NumPy archives of an animated mesh: ``positions`` (frames, n, 3) and ``triangles`` (m, 3)."""

from __future__ import annotations

from pathlib import Path

from clothsim._arrays import floats, indices
from clothsim._formats.animation import RawAnimation, Request
from clothsim._formats.numpy_files import Archive
from clothsim.errors import InvalidInput, MeshError

__all__ = ["load"]


def load(path: Path, _request: Request) -> RawAnimation:
    """Read the two arrays; other arrays of the archive are passed over."""
    try:
        with Archive(path) as data:
            names = data.names
            if missing := {"positions", "triangles"} - set(names):
                raise MeshError(
                    f"{path}: expected positions and triangles, got {', '.join(names)[:200] or 'nothing'}: "
                    f"{', '.join(sorted(missing))} missing",
                    kind="file",
                )
            positions, triangles = data["positions"], data["triangles"]
    except MeshError:
        raise
    except (OSError, ValueError) as error:
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
