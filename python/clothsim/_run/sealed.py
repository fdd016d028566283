"""Files of a run whose damage is known: one line with size and CRC-32 of the rest, one line of JSON, then bytes."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from clothsim.errors import CheckpointError

__all__ = ["read_header", "read_sealed", "write_sealed"]

# Longest first line and longest JSON that are read [B].
_FIRST, _HEADER = 64, 1 << 16


def write_sealed(file: BinaryIO, header: dict[str, Any], body: bytes) -> None:
    """Write header and body, and wait until they are on the disk."""
    line = json.dumps(header).encode() + b"\n"
    file.write(b"%d %08x\n" % (len(line) + len(body), zlib.crc32(body, zlib.crc32(line))))
    file.write(line)
    file.write(body)
    file.flush()
    os.fsync(file.fileno())


def read_sealed(path: Path, what: str = "a checkpoint") -> tuple[dict[str, Any], bytes]:
    """Header and body of a whole file; ``what`` it should be, with its article. Memory: twice the file at most.

    Raises
    ------
    CheckpointError
        It cannot be read, is something else, was cut off or damaged.
    """
    try:
        with path.open("rb") as file:
            size, checksum = _first(file, path, what)
            rest = os.fstat(file.fileno()).st_size - file.tell()
            if size != rest:
                raise CheckpointError(f"{path}: expected {size} bytes, got {rest}: cut off, or with a tail")
            content = file.read(size)
    except OSError as error:
        raise CheckpointError(f"{path}: cannot read: {error.strerror}") from error
    if b"%08x" % zlib.crc32(content) != checksum:
        raise CheckpointError(f"{path}: its bytes do not have its checksum: damaged")
    line, _, body = content.partition(b"\n")
    return _json(line, path, what), body


def read_header(path: Path, what: str) -> dict[str, Any]:
    """Header alone; whether the rest is sound is not looked at.

    Raises
    ------
    CheckpointError
        It cannot be read, or is something else.
    """
    try:
        with path.open("rb") as file:
            _first(file, path, what)
            return _json(file.readline(_HEADER), path, what)
    except OSError as error:
        raise CheckpointError(f"{path}: cannot read: {error.strerror}") from error


def _first(file: BinaryIO, path: Path, what: str) -> tuple[int, bytes]:
    size, _, checksum = file.readline(_FIRST).rstrip(b"\n").partition(b" ")
    if not (size.isdigit() and len(checksum) == 8):
        raise CheckpointError(f"{path}: expected {what}, got other bytes")
    return int(size), checksum


def _json(line: bytes, path: Path, what: str) -> dict[str, Any]:
    try:
        header = json.loads(line)
    except ValueError:
        header = None
    if not isinstance(header, dict):
        raise CheckpointError(f"{path}: expected {what}, got other bytes")
    return header
