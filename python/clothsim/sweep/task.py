"""One run of a sweep, on whichever worker it comes to.

Where the worker sees the sweep's folder, the run lives in it: its frames and checkpoints, and at the end its result. A
run that is lost with its worker goes on there from its last checkpoint, and one that has a result is not run again.
Elsewhere it lives in a temporary folder and starts anew.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim._files import write_whole
from clothsim._run.job import Finished, Job, Stopped
from clothsim.errors import CheckpointError, ClothSimError, ClusterError, InvalidInput, OutputError, OutputExists
from clothsim.scene import Scene
from clothsim.study.disturb import disturbed
from clothsim.study.worker import unpack_scene
from clothsim.sweep.observe import observe

__all__ = ["STOP", "Spec", "Work", "active", "read_result", "run"]

# Set when this worker is to end: runs write a checkpoint after the frame that they are in.
STOP = threading.Event()
_WAIT = 0.25  # s between looks at a run that another worker still holds
_HARD = 2.0  # a frame may exceed the limit by as much again before the worker goes with it
_under_way = 0
_lock = threading.Lock()


@dataclass(frozen=True)
class Work:
    """Where a sweep lives, and how a worker knows that it sees the same folder.

    Attributes
    ----------
    folder : str
        The work folder.
    token : str
        What its file ``token`` holds.
    """

    folder: str
    token: str

    @property
    def shared(self) -> bool:
        """Whether this machine sees it."""
        try:
            return (Path(self.folder) / "token").read_text() == self.token
        except OSError:
            return False

    def result(self, name: str) -> Path:
        """Where the result of a run is."""
        return Path(self.folder) / "results" / f"{name}.json"

    def run_folder(self, name: str) -> Path:
        """Where a run lives."""
        return Path(self.folder) / "runs" / name.partition("-")[0]


@dataclass(frozen=True)
class Spec:
    """What a worker is told of a run."""

    name: str
    data: dict[str, Any]
    seed: int | None
    disturbance: float
    threads: int
    device: str
    metrics: tuple[str, ...]
    series: tuple[str, ...]
    keep: tuple[str, ...]
    timeout: float | None
    version: str


def active() -> int:
    """Runs under way in this process."""
    return _under_way


def read_result(path: Path) -> dict[str, Any] | None:
    """The result of a run, or None if there is none that can be read."""
    try:
        facts = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return facts if isinstance(facts, dict) else None


def run(spec: Spec, work: Work, packed: bytes) -> dict[str, Any]:
    """Run, or go on with, or only look up; returns facts for JSON.

    Raises
    ------
    ClusterError
        This worker has another version of clothsim, or does not see the folder in which outputs are to be kept.
    OutputError
        The disk is full, or the folder cannot be written.
    Stopped
        The worker is ending; the run has a checkpoint.
    """
    global _under_way  # noqa: PLW0603
    if spec.version != _core.__version__:
        raise ClusterError(
            f"worker on {socket.gethostname()}: expected clothsim {spec.version}, got {_core.__version__}"
        )
    with _lock:
        _under_way += 1
    try:
        if work.shared:
            return _run_shared(spec, work, packed)
        if spec.keep:
            raise ClusterError(
                f"worker on {socket.gethostname()} does not see {work.folder}: outputs of runs can be kept only in a "
                "folder that all workers see"
            )
        with tempfile.TemporaryDirectory(prefix="clothsim-sweep-") as name:
            return _run_in(spec, Path(name) / "run", packed, lambda facts: facts)
    finally:
        with _lock:
            _under_way -= 1


def _run_shared(spec: Spec, work: Work, packed: bytes) -> dict[str, Any]:
    result, folder = work.result(spec.name), work.run_folder(spec.name)
    starts = _count_start(folder)

    def keep(facts: dict[str, Any]) -> dict[str, Any]:
        facts["starts"] = starts
        write_whole(result, json.dumps(facts).encode())
        return facts

    while (found := read_result(result)) is None:
        try:
            found = _run_in(spec, folder, packed, keep)
        except OutputExists:  # a worker that was given up is still at it
            time.sleep(_WAIT)
    _tidy(folder, kept=bool(spec.keep))
    return found


def _count_start(folder: Path) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "starts").open("ab") as file:
            file.write(b".")
        return (folder / "starts").stat().st_size
    except OSError:
        return 1


def _tidy(folder: Path, *, kept: bool) -> None:
    shutil.rmtree(folder / ".clothsim" if kept else folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        (folder / "starts").unlink()


def _run_in(
    spec: Spec, folder: Path, packed: bytes, keep: Callable[[dict[str, Any]], dict[str, Any]]
) -> dict[str, Any]:
    """Run in a folder; ``keep`` is told of the facts before the run's work folder goes."""
    began = time.monotonic()
    facts: dict[str, Any] = {"worker": f"{socket.gethostname()}:{os.getpid()}", "pid": os.getpid()}

    def finished(done: Finished) -> None:
        error = done.error
        facts.update(observe(done, scene, spec.metrics, spec.series))
        facts.update(seconds=done.wall_seconds, resumed_at=done.resumed_at)
        if error is not None:
            facts.update(error=str(error), error_type=type(error).__name__)
        keep(facts)

    try:
        scene = _scene(spec, packed)
        late = functools.partial(_late, began, spec.timeout)
        job = Job(
            scene, folder, threads=spec.threads, device=spec.device, resume=True, progress=False, should_stop=late,
            finished=finished,
        )  # fmt: skip
        with _hard_limit(spec.timeout, facts, keep):
            try:
                job.run()
            except CheckpointError:  # damaged beyond the last two: nothing is lost but time
                job.resume, job.overwrite = False, True
                job.run()
    except (OutputError, OutputExists):
        raise
    except Stopped as stop:
        if STOP.is_set():
            raise
        keep(_failed(facts, str(stop), "TimeLimit", began))
    except (ClothSimError, MemoryError) as error:
        if "error" not in facts:
            keep(_failed(facts, str(error) or type(error).__name__, type(error).__name__, began))
    return facts


def _failed(facts: dict[str, Any], error: str, kind: str, began: float) -> dict[str, Any]:
    facts.update(error=error, error_type=kind, seconds=time.monotonic() - began)
    return facts


def _scene(spec: Spec, packed: bytes) -> Scene:
    scene = unpack_scene(packed, json.loads(json.dumps(spec.data)))
    try:
        return scene if spec.seed is None or not spec.disturbance else disturbed(scene, spec.seed, spec.disturbance)
    except InvalidInput:
        raise
    except ClothSimError as error:
        raise type(error)(str(error)) from error


def _late(began: float, timeout: float | None) -> str | None:
    if STOP.is_set():
        return "the worker is ending"
    if timeout is not None and time.monotonic() - began > timeout:
        return f"stopped after {timeout:g} s"
    return None


@contextlib.contextmanager
def _hard_limit(
    timeout: float | None, facts: dict[str, Any], keep: Callable[[dict[str, Any]], dict[str, Any]]
) -> Iterator[None]:
    """End this worker, if it is one of our own, with a run whose frame takes far longer than the limit."""
    if timeout is None or not os.environ.get("CLOTHSIM_SWEEP_WORKER"):
        yield
        return
    began = time.monotonic()

    def end() -> None:
        try:
            keep(_failed(dict(facts), f"stopped after {timeout:g} s, within a frame", "TimeLimit", began))
        finally:
            os._exit(5)

    timer = threading.Timer(_HARD * timeout + 1.0, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
