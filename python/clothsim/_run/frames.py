"""The frames of a run on the disk, as they come."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import IO, Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._files import output_error
from clothsim.errors import InvalidInput

__all__ = ["FrameWriter"]


class FrameWriter:
    """An append-only file of frames: rows of float64, one per frame, and one JSON line per frame beside it.

    Rows that a crash left behind a checkpoint are cut off by ``keep``.
    """

    def __init__(self, folder: Path, vertex_count: int, *, keep: int = 0) -> None:
        self._rows_path = folder / "frames.bin"
        self._lines_path = folder / "frames.jsonl"
        self._stride = vertex_count * 24
        self._count = vertex_count
        self.frames = keep
        self._rows = self._rows_path.open("r+b" if self._rows_path.exists() else "w+b")
        self._lines = self._lines_path.open("r+b" if self._lines_path.exists() else "w+b")
        self._cut(keep)

    def _cut(self, keep: int) -> None:
        lines = self._lines.read().split(b"\n")[:keep]
        size = os.fstat(self._rows.fileno()).st_size
        if len(lines) < keep or size < keep * self._stride:
            raise InvalidInput(
                f"{self._rows_path.parent}: expected {keep} frames as the checkpoint says, got fewer", name="OUT"
            )
        self._rows.truncate(keep * self._stride)
        self._rows.seek(keep * self._stride)
        text = b"".join(line + b"\n" for line in lines)
        self._lines.truncate(len(text))
        self._lines.seek(len(text))

    def append(self, positions: Floats, facts: dict[str, Any]) -> None:
        """Add a frame: rows (n, 3), positions of what moves [m] and what may follow them, and facts about it."""
        try:
            self._rows.write(np.ascontiguousarray(positions, dtype="<f8").tobytes())
            self._lines.write(json.dumps(facts).encode() + b"\n")
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
            return [json.loads(line) for line in file.read().splitlines()[: self.frames]]

    def rows(self) -> Floats:
        """All frames (frames, n, 3), mapped from the file, read-only."""
        if self.frames == 0 or self._count == 0:
            return np.zeros((self.frames, self._count, 3))
        return np.memmap(self._rows_path, dtype="<f8", mode="r", shape=(self.frames, self._count, 3))


def _close(file: IO[bytes]) -> None:
    try:
        file.close()
    except OSError:
        # The disk is full and the buffer cannot be written: the frames since the last checkpoint are lost anyway.
        return
