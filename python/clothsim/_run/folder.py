"""The output folder of a run: what it may hold, and the hidden work folder that makes a run resumable.

``OUT/.clothsim`` holds the frames so far, the last two checkpoints and a lock, and is removed when all outputs are
written. A checkpoint counts its frames, so that a run killed at any moment goes on from there. Its first
line has the number of bytes that follow and their CRC-32: a damaged one is known, and the one before it is used.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from clothsim._files import output_error, remove_parts, whole
from clothsim._run.sealed import write_sealed
from clothsim._run.states import FOLDER as STATES
from clothsim.errors import OutputExists

__all__ = ["OUTPUTS", "RunFolder"]

# What a run may write into its folder.
OUTPUTS = (
    "frames.npz",
    STATES,
    "obj",
    "ply",
    "scene.usdc",
    "scene.glb",
    "pc2",
    "vtk",
    "film_strip.png",
    "plots.png",
    "view.html",
    "report.json",
    "last_good.checkpoint",
)


class RunFolder:
    """``OUT`` and its work folder."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.work = out / ".clothsim"
        self._checkpoints = (self.work / "checkpoint", self.work / "checkpoint.previous")
        # What was the work folder's own word, renamed: all outputs are written, the rest only waits to be removed.
        self._done = self.work / "done"

    def present(self) -> list[str]:
        """Outputs that are there."""
        return [name for name in OUTPUTS if (self.out / name).exists()]

    @property
    def started(self) -> bool:
        """A run was begun here and is not finished."""
        return self.work.exists() and not self._done.exists()

    @property
    def holds_work(self) -> bool:
        """More than the lock of something that was killed is there."""
        return self.started and any(path.name != "lock" for path in self.work.glob("*"))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder for this process; the lock goes with it, however it ends."""
        handle = self._open_lock()
        try:
            for folder in (self.out, self.work):
                remove_parts(folder)
            if self._done.exists():  # killed while it was being removed
                self._remove_finished()
            yield
        finally:
            os.close(handle)

    def _open_lock(self) -> int:
        path = self.work / "lock"
        while True:
            try:
                self.work.mkdir(parents=True, exist_ok=True)
                handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            except OSError as error:
                raise output_error(self.work, error) from error
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                raise OutputExists(f"{self.out}: another run is writing here") from error
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), path.stat()):
                    return handle
            os.close(handle)  # whoever held it has removed it meanwhile

    def clear_work(self) -> None:
        """Forget an unfinished run."""
        for path in (*self._checkpoints, self.work / "frames.bin", self.work / "frames.jsonl"):
            with contextlib.suppress(FileNotFoundError):
                path.unlink()
        shutil.rmtree(self.work / STATES, ignore_errors=True)

    @property
    def word(self) -> Path:
        """The file that makes the work folder an unfinished run."""
        return self._checkpoints[0]

    def remove_work(self) -> None:
        """Remove the work folder of what is finished: killed on the way, it stays finished."""
        with contextlib.suppress(OSError):
            os.replace(self.word, self._done)
        self._remove_finished()
        shutil.rmtree(self.work, ignore_errors=True)

    def _remove_finished(self) -> None:
        for path in sorted(self.work.iterdir(), key=lambda path: path == self._done):
            if path.name == "lock":
                continue
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):
                    path.unlink()

    # Checkpoints: a line with the size and checksum of the rest, one line of JSON, then the engine's bytes -------

    @property
    def has_checkpoint(self) -> bool:
        """A checkpoint was written here, whole or damaged since."""
        return bool(self.checkpoints())

    def checkpoints(self) -> list[Path]:
        """Those that are there, the last one first."""
        return [path for path in self._checkpoints if path.exists()]

    def save_checkpoint(self, header: dict[str, Any], engine: bytes) -> None:
        """Write a checkpoint; the last one becomes the one before."""
        last, before = self._checkpoints
        with whole(last) as file:
            write_sealed(file, header, engine)  # on the disk before the one before goes
            if last.exists():
                _keep(last, before)


def _keep(path: Path, copy: Path) -> None:
    """Give a file a second name, in place of what had that name, without a moment in which it has none."""
    part = copy.with_name(f".{copy.name}.part")
    part.unlink(missing_ok=True)
    try:
        os.link(path, part)
    except OSError:  # a file system without links
        os.replace(path, copy)
        return
    os.replace(part, copy)
