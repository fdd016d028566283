"""The output folder of a run: what it may hold, and the hidden work folder that makes a run resumable.

``OUT/.clothsim`` holds the frames so far, a checkpoint and a lock, and is removed when all outputs are written. The
checkpoint counts the frames that belong to it, so that a run killed at any moment goes on from there.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._files import output_error, write_whole
from clothsim.errors import CheckpointError, OutputExists
from clothsim.scene import Scene

__all__ = ["OUTPUTS", "RunFolder", "digest"]

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
        self._checkpoint = self.work / "checkpoint"

    def present(self) -> list[str]:
        """Outputs that are there."""
        return [name for name in OUTPUTS if (self.out / name).exists()]

    @property
    def started(self) -> bool:
        """A run was begun here and is not finished."""
        return self.work.exists()

    @property
    def holds_work(self) -> bool:
        """More than the lock of something that was killed is there."""
        return any(path.name != "lock" for path in self.work.glob("*"))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder for this process; the lock goes with it, however it ends."""
        try:
            self.work.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.work / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise output_error(self.work, error) from error
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise OutputExists(f"{self.out}: another run is writing here") from error
            yield
        finally:
            os.close(handle)

    def clear_work(self) -> None:
        """Forget an unfinished run."""
        for name in ("checkpoint", "frames.bin", "frames.jsonl"):
            with contextlib.suppress(FileNotFoundError):
                (self.work / name).unlink()

    def remove_work(self) -> None:
        """Remove the work folder."""
        shutil.rmtree(self.work, ignore_errors=True)

    # Checkpoints: one line of JSON, then the engine's bytes ---------------------------------------------------

    def save_checkpoint(self, header: dict[str, Any], engine: bytes) -> None:
        """Replace the checkpoint."""
        write_whole(self._checkpoint, json.dumps(header).encode() + b"\n" + engine)

    def load_checkpoint(self) -> tuple[dict[str, Any], bytes] | None:
        """Return header and engine bytes, or None where no checkpoint was written yet."""
        try:
            content = self._checkpoint.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise CheckpointError(f"{self._checkpoint}: cannot read: {error.strerror}") from error
        line, _, engine = content.partition(b"\n")
        try:
            header = json.loads(line)
        except ValueError as error:
            raise CheckpointError(f"{self._checkpoint}: expected a checkpoint, got other bytes") from error
        return header, engine
