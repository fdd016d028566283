"""The frames of a run on the disk, as they come."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._files import output_error
from clothsim.errors import CheckpointError

__all__ = ["FrameWriter", "frames_so_far"]


class FrameWriter:
    """An append-only file of frames: rows of float64, one per frame, and one line per frame beside it.

    A line is JSON after the CRC-32 of the frame's row and of the JSON. Rows that a crash left behind a checkpoint are
    cut off by ``keep``.

    Raises
    ------
    CheckpointError
        The first ``keep`` frames are not all there, or damaged.
    OutputError
        The files cannot be written.
    """

    def __init__(self, folder: Path, vertex_count: int, *, keep: int = 0) -> None:
        self._rows_path = folder / "frames.bin"
        self._lines_path = folder / "frames.jsonl"
        self._stride = vertex_count * 24
        self._count = vertex_count
        self.frames = keep
        self._rows, self._lines = _open(self._rows_path), _open(self._lines_path)
        try:
            self._cut(keep)
        except BaseException:
            self.close()
            raise

    def _cut(self, keep: int) -> None:
        lines = self._lines.read().split(b"\n")[:keep]
        for number in range(keep):
            row = self._rows.read(self._stride)
            if number >= len(lines) or len(row) < self._stride or not _belongs(lines[number], row):
                folder = self._rows_path.parent
                raise CheckpointError(f"{folder}: frame {number} of {keep} is missing or damaged")
        self._rows.seek(keep * self._stride)
        self._rows.truncate()
        text = b"".join(line + b"\n" for line in lines)
        self._lines.seek(len(text))
        self._lines.truncate()

    def append(self, positions: Floats, facts: dict[str, Any]) -> None:
        """Add a frame: rows (n, 3), positions of what moves [m] and what may follow them, and facts about it."""
        try:
            row, line = np.ascontiguousarray(positions, dtype="<f8").tobytes(), json.dumps(facts).encode()
            self._rows.write(row)
            self._lines.write(b"%08x %s\n" % (_checksum(row, line), line))
            self._rows.flush()
            self._lines.flush()
        except OSError as error:
            raise output_error(self._rows_path, error) from error
        self.frames += 1

    def sync(self) -> None:
        """Make sure that the frames are on the disk."""
        for file in (self._rows, self._lines):
            try:
                file.flush()
                os.fsync(file.fileno())
            except OSError as error:
                raise output_error(self._rows_path, error) from error

    def close(self) -> None:
        """Close the files, keeping what could be written."""
        for file in (self._rows, self._lines):
            _close(file)

    def facts(self) -> list[dict[str, Any]]:
        """What `append` was told about each frame."""
        with self._lines_path.open("rb") as file:
            return [json.loads(line.partition(b" ")[2]) for line in file.read().splitlines()[: self.frames]]

    def rows(self) -> Floats:
        """All frames (frames, n, 3), mapped from the file, read-only."""
        if self.frames == 0 or self._count == 0:
            return np.zeros((self.frames, self._count, 3))
        return np.memmap(self._rows_path, dtype="<f8", mode="r", shape=(self.frames, self._count, 3))


def frames_so_far(folder: Path, vertex_count: int) -> tuple[Floats, list[dict[str, Any]]]:
    """Frames (frames, n, 3) and facts of a run on its way, up to the first that is not whole; nothing is changed.

    Raises
    ------
    CheckpointError
        The files cannot be read.
    """
    try:
        lines = (folder / "frames.jsonl").read_bytes().split(b"\n")[:-1]
        rows = np.fromfile(folder / "frames.bin", dtype="<f8")
    except OSError as error:
        raise CheckpointError(f"{folder}: cannot read its frames: {error.strerror}") from error
    width = 3 * vertex_count
    count = len(rows) // width if width else 0
    frames = rows[: count * width].reshape(count, vertex_count, 3)
    facts = []
    for line, row in zip(lines, frames, strict=False):
        if not _belongs(line, row.tobytes()):
            break
        facts.append(json.loads(line.partition(b" ")[2]))
    return frames[: len(facts)], facts


def _open(path: Path) -> IO[bytes]:
    try:
        return path.open("r+b" if path.exists() else "w+b")
    except OSError as error:
        raise output_error(path, error) from error


def _checksum(row: bytes, line: bytes) -> int:
    return zlib.crc32(line, zlib.crc32(row))


def _belongs(text: bytes, row: bytes) -> bool:
    """Whether a line and a row are those that were written together."""
    checksum, _, line = text.partition(b" ")
    return checksum == b"%08x" % _checksum(row, line)


def _close(file: IO[bytes]) -> None:
    try:
        file.close()
    except OSError:
        # The disk is full and the buffer cannot be written: the frames since the last checkpoint are lost anyway.
        return
