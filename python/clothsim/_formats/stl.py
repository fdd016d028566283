"""STL, binary and ASCII; corners at bitwise equal positions become one vertex again."""

from __future__ import annotations

import numpy as np

from clothsim._formats import RawMesh
from clothsim._formats.soup import weld
from clothsim.errors import MeshError

__all__ = ["parse"]

# A header of 80 bytes and a count; then 50 bytes a facet: normal, three corners, two bytes for whatever.
_HEADER, _FACET = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def parse(content: bytes, name: str) -> RawMesh:
    """Parse an STL file; ``name`` is for messages. Normals and colours are passed over.

    Binary files may begin with ``solid`` too: a file whose length is what its count of facets says is binary.
    """
    count = int.from_bytes(content[80:_HEADER], "little")
    if len(content) >= _HEADER and len(content) == _HEADER + count * _FACET.itemsize:
        corners = np.frombuffer(content, _FACET, count, _HEADER)["corners"].astype(np.float64).reshape(-1, 3)
    elif content.lstrip()[:5].lower() == b"solid":
        corners = np.array(_words(content, name), dtype=np.float64).reshape(-1, 3)
    else:
        got = f"{len(content)} bytes"
        expected = (
            f"{_HEADER + count * _FACET.itemsize} bytes for {count} facets" if len(content) >= _HEADER else "more"
        )
        raise MeshError(f"{name}: not an STL file that can be read: expected {expected}, got {got}", kind="file")
    if not len(corners):
        raise MeshError(f"{name}: expected at least one triangle, got none", kind="empty")
    return weld(RawMesh(corners, np.arange(len(corners)).reshape(-1, 3), None))


def _words(content: bytes, name: str) -> list[tuple[float, ...]]:
    """Corners of an ASCII file, three per facet."""
    corners: list[tuple[float, ...]] = []
    inside = 0
    for number, line in enumerate(content.decode("ascii", errors="replace").splitlines(), start=1):
        words = line.split()
        match [word.lower() for word in words[:2]]:
            case ["outer", "loop"]:
                inside = len(corners)
            case ["vertex", *_]:
                try:
                    corners.append((float(words[1]), float(words[2]), float(words[3])))
                except (ValueError, IndexError) as error:
                    text = line.strip()
                    raise MeshError(
                        f"{name}, line {number}: cannot understand {text!r} ({error})", kind="file"
                    ) from error
            case ["endloop", *_] if len(corners) - inside != 3:
                got = len(corners) - inside
                raise MeshError(f"{name}, line {number}: expected three corners in a facet, got {got}", kind="file")
    if len(corners) % 3:
        raise MeshError(f"{name}: not an STL file that can be read: it is cut off within a facet", kind="file")
    return corners
