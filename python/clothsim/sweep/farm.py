"""Gives runs to workers and takes their results, and starts again what was lost."""

from __future__ import annotations

import asyncio
import contextlib
import queue
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from clothsim import _core
from clothsim.errors import ClothSimError, ClusterError, OutputError
from clothsim.sweep import task
from clothsim.sweep.cluster import Cluster
from clothsim.sweep.request import Request, Run

__all__ = ["run_all"]

_AHEAD = 3  # runs that wait at the scheduler for each that is under way
_TICK = 0.2  # s
_GATHER = 5.0  # s for a result to come over
_GO_ON = "what has finished is kept, and --resume goes on, there or elsewhere"
_GONE = f"the scheduler is gone; {_GO_ON}"
_ALONE = 120.0  # s without a worker after which nobody is expected to come


def run_all(
    cluster: Cluster,
    request: Request,
    runs: Sequence[Run],
    work: task.Work,
    retries: int,
    done: Callable[[Run, Mapping[str, Any]], None],
    lost: Callable[[Run], None],
) -> None:
    """Run what is asked for.

    Parameters
    ----------
    cluster : Cluster
        Workers.
    request : Request
        The sweep.
    runs : sequence of Run
        Those to be run.
    work : task.Work
        Where it lives.
    retries : int
        How often a run whose worker was lost is started again, before it is given up.
    done : callable
        Told of each run and its facts, in the order in which they end.
    lost : callable
        Told of each run that is started again.

    Raises
    ------
    OutputError
        A worker could not write; runs that have finished are kept.
    ClusterError
        The cluster is gone, or not fit for the sweep.
    """
    farm = _Farm(cluster, request, work, retries, done, lost)
    farm.run(list(runs))


class _Farm:
    def __init__(
        self,
        cluster: Cluster,
        request: Request,
        work: task.Work,
        retries: int,
        done: Callable[[Run, Mapping[str, Any]], None],
        lost: Callable[[Run], None],
    ) -> None:
        self._cluster, self._request, self._work = cluster, request, work
        self._retries, self._done, self._lost = retries, done, lost
        self._ended: queue.Queue[Any] = queue.Queue()
        self._open: dict[str, tuple[Run, Any]] = {}
        self._losses: dict[int, int] = {}
        # A task of its own for each scene: what is lost with a worker is made again by the scheduler.
        self._packed = [
            cluster.client.submit(bytes, packed, key=f"clothsim-scene-{request.digest}-{k}", pure=False)
            for k, packed in enumerate(request.packed.values())
        ]

    def run(self, waiting: list[Run]) -> None:
        try:
            self._run_all(waiting)
        except ClothSimError:
            raise
        except (OSError, TimeoutError, asyncio.TimeoutError, asyncio.CancelledError) as error:
            raise ClusterError(_GONE) from error

    def _run_all(self, waiting: list[Run]) -> None:
        waiting.reverse()
        alone = 0.0
        while waiting or self._open:
            while waiting and len(self._open) < max(1, self._cluster.slots) * (1 + _AHEAD):
                self._submit(waiting.pop())
            try:
                self._take(self._ended.get(timeout=_TICK))
                alone = 0.0
            except queue.Empty:
                self._cluster.look_after()
                alone = 0.0 if self._cluster.client.nthreads() else alone + _TICK
            if self._cluster.client.status != "running":
                raise ClusterError(_GONE)
            if alone > _ALONE:
                raise ClusterError(f"the scheduler has had no workers for {_ALONE:g} s; {_GO_ON}")

    def _submit(self, run: Run) -> None:
        request = self._request
        spec = task.Spec(
            run.name, request.data(run), run.seed, request.disturbance, request.threads, run.device,
            tuple(request.metrics), tuple(request.series), tuple(request.keep), request.timeout, _core.__version__,
        )  # fmt: skip
        key = f"clothsim-run-{run.name}-{self._losses.get(run.number, 0)}"
        future = self._cluster.client.submit(
            task.run, spec, self._work, self._packed[run.scene], key=key, pure=False, retries=0, priority=-run.number
        )
        self._open[key] = (run, future)
        future.add_done_callback(self._ended.put)

    def _take(self, future: Any) -> None:
        from distributed.scheduler import KilledWorker

        run, _ = self._open.pop(future.key, (None, None))
        if run is None:
            return
        status = future.status
        if status == "cancelled":
            gone = self._cluster.client.status != "running"
            raise ClusterError(_GONE if gone else f"the scheduler has let go of its runs; {_GO_ON}")
        error = future.exception() if status == "error" else None
        if error is None:  # finished; or "lost" or "pending" since: its worker ended with the result
            facts = self._facts(run, future)
            if facts is None:
                return
            facts.setdefault("starts", 1 + self._losses.get(run.number, 0))
            facts["losses"] = self._losses.get(run.number, 0)
            self._done(run, facts)
            future.release()
            return
        if isinstance(error, KilledWorker):
            self._start_again(run)
        elif isinstance(error, (OutputError, ClusterError)):
            raise error
        elif isinstance(error, ImportError):
            raise ClusterError(f"a worker cannot run clothsim: {error}: install the same version there") from error
        else:
            self._done(run, {"error": str(error) or type(error).__name__, "error_type": type(error).__name__})

    def _facts(self, run: Run, future: Any) -> dict[str, Any] | None:
        """The result of a run; None if it was lost with its worker after all, and the scheduler makes it anew.

        It is not waited for: where no worker is left, somebody has to go on looking after them.
        """
        found = task.read_result(self._work.result(run.name))
        if found is None and future.status == "finished":
            with contextlib.suppress(TimeoutError, asyncio.TimeoutError):
                found = dict(future.result(timeout=_GATHER))
        if found is None:
            self._open[future.key] = (run, future)
            self._cluster.look_after()
            future.add_done_callback(self._ended.put)
        return found

    def _start_again(self, run: Run) -> None:
        self._losses[run.number] = times = self._losses.get(run.number, 0) + 1
        if times > self._retries:
            again = f", and {self._retries} more that took it over" if self._retries else ""
            error = f"its worker was lost{again}"
            self._done(run, {"error": error, "error_type": "WorkerLost", "losses": times, "starts": times})
            return
        self._lost(run)
        self._submit(run)
