"""The output folder of a run: what it may hold, and the hidden work folder that makes a run resumable.

``OUT/.clothsim`` holds the frames so far, the last two checkpoints and a lock, and is removed when all outputs are
written. A checkpoint counts its frames, so that a run killed at any moment goes on from there. Its first
line has the number of bytes that follow and their CRC-32: a damaged one is known, and the one before it is used.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._files import output_error, remove_parts, whole
from clothsim.errors import CheckpointError, OutputExists
from clothsim.scene import Scene

__all__ = ["OUTPUTS", "RunFolder", "digest", "read_checkpoint"]

# What a run may write into its folder.
OUTPUTS = (
    "frames.npz",
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


def digest(scene: Scene) -> str:
    """Fingerprint of a scene and all its arrays."""
    sha = hashlib.sha256(scene.check().to_json().encode())
    for group in scene.assets():
        for name, arrays in sorted(group.items()):
            sha.update(name.encode())
            for array in arrays if isinstance(arrays, tuple) else (arrays,):
                if isinstance(array, np.ndarray):
                    sha.update(str(array.shape).encode() + array.tobytes())
                elif array:  # groups, a rate
                    sha.update(json.dumps(array, sort_keys=True).encode())
    return sha.hexdigest()


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
        content = json.dumps(header).encode() + b"\n" + engine
        last, before = self._checkpoints
        with whole(last) as file:
            file.write(b"%d %08x\n" % (len(content), zlib.crc32(content)))
            file.write(content)
            file.flush()
            os.fsync(file.fileno())  # before the one before goes
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


def read_checkpoint(path: Path) -> tuple[dict[str, Any], bytes]:
    """Header and engine bytes of a checkpoint.

    Raises
    ------
    CheckpointError
        It cannot be read, was cut off or damaged.
    """
    try:
        first, _, content = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise CheckpointError(f"{path}: cannot read: {error.strerror}") from error
    size, _, checksum = first.partition(b" ")
    if not (size.isdigit() and len(checksum) == 8):
        raise CheckpointError(f"{path}: expected a checkpoint, got other bytes")
    if int(size) != len(content):
        raise CheckpointError(f"{path}: expected {int(size)} bytes, got {len(content)}: cut off, or with a tail")
    if b"%08x" % zlib.crc32(content) != checksum:
        raise CheckpointError(f"{path}: its bytes do not have its checksum: damaged")
    line, _, engine = content.partition(b"\n")
    header: dict[str, Any] = json.loads(line)
    return header, engine
