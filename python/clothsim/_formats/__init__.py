"""Mesh files: one module per format, each giving plain arrays (vertices, triangles, UV per triangle corner)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from clothsim._arrays import Floats, Ints
from clothsim.errors import MeshError

__all__ = ["READABLE", "WRITABLE", "RawMesh", "parse", "read", "write"]

_USD = (".usd", ".usda", ".usdc", ".usdz")
READABLE = (".obj", ".ply", ".stl", ".gltf", ".glb", *_USD)
WRITABLE = (".obj", ".ply")


class RawMesh(NamedTuple):
    """What a file holds.

    Positions (n, 3), triangles (m, 3), UV per corner (m, 3, 2) if every corner has one, and the triangles of each named
    group, ascending, if the format has groups.
    """

    vertices: Floats
    triangles: Ints
    uv: Floats | None
    groups: Mapping[str, Ints] | None = None


def read(path: Path) -> RawMesh:
    """Read ``path`` by its suffix; a file that cannot be read or understood is a `MeshError` naming it."""
    suffix = path.suffix.lower()
    if suffix not in READABLE:
        known = ", ".join(READABLE)
        raise MeshError(f"{path}: expected a mesh file ({known}), got suffix {suffix!r}", kind="file")
    if path.exists() and not path.is_file():
        raise MeshError(f"{path}: cannot read the mesh: it is no file", kind="file")  # a pipe or device need not end
    try:
        content = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise MeshError(f"{path}: cannot read the mesh: {reason}", kind="file") from error
    return parse(content, path)


def parse(content: bytes, path: Path) -> RawMesh:
    """Parse the bytes of a file with the suffix of ``path``."""
    suffix = path.suffix.lower()
    if suffix == ".obj":
        from clothsim._formats import obj

        return obj.parse(content, str(path))
    if suffix == ".ply":
        from clothsim._formats import ply

        return ply.parse(content, str(path))
    if suffix in _USD:
        from clothsim._formats import usd

        return usd.load_still(path)
    if suffix in (".gltf", ".glb"):
        from clothsim._formats import gltf_still

        return gltf_still.load(path)
    from clothsim._formats import stl

    return stl.parse(content, str(path))


def write(path: Path, mesh: RawMesh) -> bytes:
    """Return the bytes of a file with the suffix of ``path``."""
    suffix = path.suffix.lower()
    if suffix == ".obj":
        from clothsim._formats import obj

        return obj.dump(mesh)
    if suffix == ".ply":
        from clothsim._formats import ply

        return ply.dump(mesh)
    known = ", ".join(WRITABLE)
    raise MeshError(f"{path}: expected a suffix that can be written ({known}), got {suffix!r}", kind="file")
