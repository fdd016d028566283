"""Where runs are run: processes of this machine, or any Dask cluster."""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from clothsim._arrays import optional
from clothsim.errors import ClusterError
from clothsim.study.pool import cores

__all__ = ["Cluster", "LocalCluster", "RemoteCluster", "check_packages", "connected"]

_GRACE = 6.0  # s that workers have to write a checkpoint
_STARTS = 5  # workers that may end one after another before one of them has reached the scheduler
_ANSWER = 10.0  # s that a scheduler has to answer
_CHATTER = ("distributed.client", "distributed.core", "distributed.comm", "distributed.utils", "tornado.application")
_FIRST = 60.0  # s until it has a worker


def check_packages() -> None:
    """Say what is missing before anything runs."""
    optional("distributed", extra="sweep", purpose="running a sweep")
    optional("pyarrow.parquet", extra="sweep", purpose="writing a sweep's tables")


class Cluster:
    """A client of a scheduler, and how many runs its workers take at once."""

    def __init__(self, client: Any) -> None:
        self.client = client

    @property
    def slots(self) -> int:
        """Threads of all workers there are."""
        return sum(self.client.nthreads().values())

    def look_after(self) -> None:
        """Do what there is to do now and then."""

    def close(self) -> None:
        """Let go."""
        with contextlib.suppress(Exception):  # a scheduler that is gone has nothing to be told
            self.client.close(timeout=2)


def _client(address: str) -> Any:
    """Connect, or let go of what was begun before the error goes on.

    Left to the collector, it would be closed in any thread: in that of the next client's loop too, which would wait for
    itself.
    """
    from distributed import Client

    class Closing(Client):  # type: ignore[misc]  # of a package without types
        def start(self, **options: Any) -> None:
            try:
                super().start(**options)
            except BaseException:
                with contextlib.suppress(Exception):
                    self.close(timeout=2)
                raise

    return Closing(address, timeout=_ANSWER, set_as_default=False)


class RemoteCluster(Cluster):
    """Somebody's cluster, by the address of its scheduler.

    Raises
    ------
    ClusterError
        It does not answer, or has no workers.
    """

    def __init__(self, address: str) -> None:
        # A scheduler that goes is told of once, by an error of ours, not by tracebacks of each attempt to reach it.
        self._loggers = [(logger, logger.level) for logger in map(logging.getLogger, _CHATTER)]
        for logger, _ in self._loggers:
            logger.setLevel(logging.CRITICAL)
        try:
            client = _client(address)
        except (OSError, ValueError, TypeError) as error:
            self._restore_logging()
            raise ClusterError(
                f"scheduler {address}: no answer within {_ANSWER:g} s ({type(error).__name__}: {error}); expected the "
                "address of a Dask scheduler such as tcp://host:8786"
            ) from error
        super().__init__(client)
        try:
            client.wait_for_workers(1, timeout=_FIRST)
        except Exception as error:
            self.close()
            raise ClusterError(f"scheduler {address}: it has no workers after {_FIRST:g} s") from error

    def close(self) -> None:
        """Let go, and leave the logging of Dask as it was."""
        super().close()
        self._restore_logging()

    def _restore_logging(self) -> None:
        for logger, level in self._loggers:
            logger.setLevel(level)


class LocalCluster(Cluster):
    """A scheduler in this process and workers in processes of their own, each on cores of its own.

    A worker that ends, however it ends, is replaced.

    Parameters
    ----------
    processes : int or None
        How many; by default as many as cores allow.
    threads : int
        Of each run.
    """

    def __init__(self, processes: int | None, threads: int) -> None:
        import dask
        from distributed import Client
        from distributed import LocalCluster as Scheduler

        free = cores()
        each = min(threads, len(free))
        count = processes or max(1, len(free) // each)
        self._cores = [free[k * each : (k + 1) * each] if (k + 1) * each <= len(free) else free for k in range(count)]
        self._scratch = Path(tempfile.mkdtemp(prefix="clothsim-sweep-"))
        # A run whose worker was lost comes back to us at once: we count, and start it again. A worker holds one.
        with dask.config.set(
            {"distributed.scheduler.allowed-failures": 0, "distributed.scheduler.worker-saturation": 1.0}
        ):
            self._scheduler = Scheduler(
                n_workers=0, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", silence_logs=50,
                host="127.0.0.1",
            )  # fmt: skip
        super().__init__(Client(self._scheduler, set_as_default=False))
        self._failed = 0
        self._workers = [self._start(own) for own in self._cores]

    @property
    def slots(self) -> int:
        """Workers that there are to be."""
        return len(self._cores)

    def _start(self, own: list[int]) -> subprocess.Popen[bytes]:
        single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        scratch = {"DASK_TEMPORARY_DIRECTORY": str(self._scratch), "CLOTHSIM_SWEEP_WORKER": "1"}
        quiet = {"DASK_LOGGING__DISTRIBUTED": "critical"}
        with (self._scratch / "stderr").open("ab") as errors:
            return subprocess.Popen(
                [sys.executable, "-m", "clothsim.sweep.worker", self._scheduler.scheduler_address,
                 ",".join(map(str, own))],
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors,
                env={**os.environ, **single, **scratch, **quiet}, start_new_session=True,
            )  # fmt: skip

    def look_after(self) -> None:
        """Replace workers that have ended.

        Raises
        ------
        ClusterError
            They end before they have reached the scheduler.
        """
        if self.client.nthreads():
            self._failed = 0
        for k, process in enumerate(self._workers):
            if process.poll() is None:
                continue
            _close_input(process)
            self._failed += 1
            if self._failed > _STARTS * len(self._workers):
                words = (self._scratch / "stderr").read_text(errors="replace").strip().splitlines()
                raise ClusterError(f"workers do not start: {words[-1] if words else f'exit {process.returncode}'}")
            self._workers[k] = self._start(self._cores[k])

    def close(self) -> None:
        """Let runs under way write a checkpoint, and end all."""
        super().close()
        for process in self._workers:
            process.terminate()
        late = time.monotonic() + _GRACE
        for process in self._workers:
            try:
                process.wait(max(0.0, late - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            _close_input(process)
        with contextlib.suppress(Exception):
            self._scheduler.close(timeout=2)
        shutil.rmtree(self._scratch, ignore_errors=True)


def _close_input(process: subprocess.Popen[bytes]) -> None:
    if process.stdin is not None:
        process.stdin.close()


@contextlib.contextmanager
def connected(scheduler: str | None, processes: int | None, threads: int) -> Iterator[Cluster]:
    """Connect to a scheduler, or start processes of this machine, and let go of them at the end."""
    cluster: Cluster = RemoteCluster(scheduler) if scheduler else LocalCluster(processes, threads)
    try:
        yield cluster
    finally:
        cluster.close()
