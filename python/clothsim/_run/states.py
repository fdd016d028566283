"""Full states beside the frames of a run: ``OUT/states/000012.state`` is that of frame 12.

``[output] states = N`` keeps those of the frames 0, N, 2N, … and of the last one. Until the run is finished they are
in its work folder. A state has no meshes: it goes on with the scene, or an edited one. One is in memory at a time.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import zlib
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim._files import output_error, whole
from clothsim._run.sealed import read_sealed, write_sealed
from clothsim.errors import CheckpointError

__all__ = ["FOLDER", "StateWriter", "frame_count", "promised", "read_state", "states_of"]

FOLDER = "states"
_WHAT = "the state of a frame"
# Unpacked, a state is at most so many times its file: what shrinks more is kept as it is.
_MOST = 64
_NUMBER = "[0-9]{6,18}"  # of a frame, in the name of a file


class StateWriter:
    """Keeps the states of a run that goes to frame ``last``; ``every`` 0: none, and nothing is touched."""

    def __init__(self, out: Path, work: Path, every: int, last: int, facts: dict[str, Any]) -> None:
        self._out, self._work = out / FOLDER, work / FOLDER
        self._every, self._last = every, last
        self._facts = facts

    def take_back(self, frames: int) -> None:
        """Before a run of ``frames`` frames goes on: killed between its outputs, its states may be among these."""
        if self._every and frames > 0 and not self._work.exists() and self._out.exists():
            self._move(self._out, self._work)

    def wants(self, frame: int) -> bool:
        """Whether the state of this frame is kept."""
        return self._every > 0 and (frame % self._every == 0 or frame == self._last)

    def keep(self, frame: int, core: _core.Simulation) -> None:
        """Write the state of this frame, whole or not at all.

        Raises
        ------
        OutputError
            The disk is full, or the folder cannot be written.
        """
        path = self._work / _name(frame)
        try:
            self._work.mkdir(exist_ok=True)
        except OSError as error:
            raise output_error(self._work, error) from error
        state, body = _packed(core.frame_state())
        header = {"kind": "state", "frame": frame, "time": core.time, "clothsim": _core.__version__, **self._facts}
        with whole(path) as file:
            write_sealed(file, {**header, **state}, body)

    def finish(self, frames: int) -> list[int]:
        """Put the states of ``frames`` frames in the place of those of an earlier run; return which there are.

        Raises
        ------
        OutputError
            The folder cannot be written.
        """
        if not self._every:
            return []
        kept = []
        try:
            for frame, path in _listed(self._work).items():
                if frame < frames and self.wants(frame):
                    kept.append(frame)
                else:  # of frames behind a checkpoint, or of an end that was another
                    path.unlink()
            if self._out.exists():
                old = self._out.with_name(f".{FOLDER}.part")  # what a kill leaves of it, the next run removes
                shutil.rmtree(old, ignore_errors=True)
                os.replace(self._out, old)
                shutil.rmtree(old, ignore_errors=True)
            if kept:
                os.replace(self._work, self._out)
        except OSError as error:
            raise output_error(self._out, error) from error
        return kept

    @staticmethod
    def _move(source: Path, target: Path) -> None:
        try:
            os.replace(source, target)
        except OSError as error:
            raise output_error(target, error) from error


def states_of(run: Path) -> dict[int, Path]:
    """States of a run by frame, ascending: finished, or on its way."""
    return _listed(run / FOLDER) or _listed(run / ".clothsim" / FOLDER)


def promised(run: Path) -> bool:
    """Whether the report of a run says that it has kept states."""
    return bool(_reported(run, "states"))


def frame_count(run: Path) -> int | None:
    """Frames of a run: finished, or on its way; None where that is not known."""
    count = _reported(run, "frame_count")
    if isinstance(count, int):
        return count
    try:
        return (run / ".clothsim" / "frames.jsonl").read_bytes().count(b"\n")
    except OSError:
        return None


def _reported(run: Path, key: str) -> Any:
    """What a run's report says; None where there is none, or it cannot be read."""
    try:
        return json.loads((run / "report.json").read_bytes())[key]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def read_state(path: Path) -> tuple[dict[str, Any], bytes]:
    """Facts and engine bytes of a state: of a frame, or of a checkpoint that ``Simulation.save_checkpoint`` wrote.

    Raises
    ------
    CheckpointError
        It cannot be read, is something else, was cut off or damaged.
    """
    try:
        with path.open("rb") as file:
            magic = file.read(8)
            if magic == b"CLOTHSIM":
                core = _core.Simulation.resume(magic + file.read(), None, "cpu")
                return {"time": core.time, "scene": json.loads(core.scene())["name"]}, core.frame_state()
    except OSError as error:
        raise CheckpointError(f"{path}: cannot read: {error.strerror}") from error
    header, body = read_sealed(path, _WHAT)
    time = header.get("time")
    if header.get("kind") != "state" or isinstance(time, bool) or not isinstance(time, int | float):
        raise CheckpointError(f"{path}: expected {_WHAT}, got another file of a run")
    return header, _unpacked(path, header, body)


def _packed(state: bytes) -> tuple[dict[str, Any], bytes]:
    """What a header says of the bytes behind it, and these: half of a state, in less time than a step takes."""
    packed = zlib.compress(state, 1)
    if len(state) > _MOST * len(packed):
        return {}, state
    return {"unpacked": len(state)}, packed


def _unpacked(path: Path, header: dict[str, Any], body: bytes) -> bytes:
    size = header.get("unpacked")
    if size is None:
        return body
    unpack = zlib.decompressobj()
    if isinstance(size, int) and 0 <= size <= _MOST * len(body):
        try:
            state = unpack.decompress(body, size + 1)
        except zlib.error:
            state = b""
        if len(state) == size and unpack.eof:
            return state
    raise CheckpointError(f"{path}: expected {size} bytes when unpacked, got others: damaged")


def _name(frame: int) -> str:
    return f"{frame:06d}.state"


def _listed(folder: Path) -> dict[int, Path]:
    found = {int(path.stem): path for path in folder.glob("*.state") if re.fullmatch(_NUMBER, path.stem)}
    return dict(sorted(found.items()))
