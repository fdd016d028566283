"""Runs side by side, each in a process of its own on cores of its own."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from clothsim._files import write_whole
from clothsim.errors import OutputError
from clothsim.study.process import UNWRITTEN

__all__ = ["Job", "cores", "load", "run_jobs"]

_POLL = 0.02  # s
_GRACE = 2.0  # s that a process has to end


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes
    ----------
    path : Path
        Where its results go, without a suffix.
    spec : dict
        What the worker is told; its ``threads`` is how many cores it gets.
    worker : str
        Module that is run; it hands itself to `clothsim.study.process.serve`.
    """

    path: Path
    spec: dict[str, Any] = field(hash=False)
    worker: str = "clothsim.study.worker"

    @property
    def done(self) -> bool:
        """Its result is there."""
        return self.path.with_suffix(".result").exists()


def cores() -> list[int]:
    """One logical CPU of every core that this process may use."""
    allowed = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))
    seen: set[str] = set()
    out = []
    for cpu in allowed:
        try:
            siblings = Path(f"/sys/devices/system/cpu/cpu{cpu}/topology/thread_siblings_list").read_text().strip()
        except OSError:
            siblings = str(cpu)
        if siblings not in seen:
            seen.add(siblings)
            out.append(cpu)
    return out


def load() -> float | None:
    """Processes that wanted to run over the last minute, over the cores there are."""
    try:
        return os.getloadavg()[0] / max(1, len(cores()))
    except (OSError, AttributeError):
        return None


def run_jobs(jobs: Sequence[Job], processes: int | None, limit: float | None, progress: Callable[[], None]) -> None:
    """Run what has no result yet; every job has one afterwards, if only that it failed.

    Parameters
    ----------
    jobs : sequence of Job
        Runs.
    processes : int or None
        Most processes side by side; by default as many as cores allow.
    limit : float or None
        Seconds after which a run is stopped.
    progress : callable
        Called after each.

    Raises
    ------
    OutputError
        A result could not be written; the other runs are stopped. Those that have finished are kept.
    """
    free = cores()
    total = len(free)
    waiting = []
    for job in jobs:
        if job.done:
            progress()
        else:
            waiting.append(job)
    running: list[tuple[Job, subprocess.Popen[bytes], list[int], float]] = []
    try:
        while waiting or running:
            while waiting and (processes is None or len(running) < processes):
                threads = min(max(1, waiting[0].spec["threads"]), total)
                if len(free) < threads:
                    break
                own, free = free[:threads], free[threads:]
                job = waiting.pop(0)
                try:
                    running.append((job, _start(job, own), own, time.monotonic()))
                except BaseException:  # interrupted meanwhile: the process, if there is one, ends with its input
                    _remove(job)
                    raise
            time.sleep(_POLL)
            for entry in list(running):
                job, process, own, started = entry
                late = limit is not None and time.monotonic() - started > limit
                if process.poll() is None and not late:
                    continue
                if process.poll() is None:
                    _stop(process)
                    _fail(job, f"stopped after {limit:g} s", "TimeLimit")
                elif process.returncode == UNWRITTEN:
                    raise OutputError(errno.ENOSPC, _last_words(job) or f"cannot write {job.path}")
                elif not job.done:
                    _fail(job, _reason(job, process), "ProcessFailed")
                _tidy(job, process)
                running.remove(entry)
                free = sorted([*free, *own])
                progress()
    finally:
        for job, process, _, _ in running:
            _stop(process)
            _tidy(job, process)


def _start(job: Job, own: list[int]) -> subprocess.Popen[bytes]:
    write_whole(job.path.with_suffix(".job"), json.dumps({**job.spec, "cores": own}).encode())
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with job.path.with_suffix(".stderr").open("wb") as errors:
        return subprocess.Popen(
            [sys.executable, "-m", job.worker, str(job.path.with_suffix(".job"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env={**os.environ, **single},
            start_new_session=True,  # Ctrl-C comes to the parent, which stops its runs
        )


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(_GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _tidy(job: Job, process: subprocess.Popen[bytes]) -> None:
    if process.stdin is not None:
        process.stdin.close()
    _remove(job)


def _remove(job: Job) -> None:
    for suffix in (".job", ".stderr"):
        job.path.with_suffix(suffix).unlink(missing_ok=True)


def _fail(job: Job, message: str, kind: str) -> None:
    write_whole(job.path.with_suffix(".result"), json.dumps({"error": message, "error_type": kind}).encode())


def _reason(job: Job, process: subprocess.Popen[bytes]) -> str:
    code = process.returncode
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    words = _last_words(job)
    return f"the run's process ended with {how}" + (f": {words}" if words else "")


def _last_words(job: Job) -> str:
    lines = job.path.with_suffix(".stderr").read_text(errors="replace").strip().splitlines()
    return lines[-1] if lines else ""
