"""A Dask worker of this machine: ``python -m clothsim.sweep.worker ADDRESS CORES``.

It ends when the process that started it does, however that ends. SIGTERM lets the run under way write a checkpoint.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys

from clothsim.study.process import die_with_parent
from clothsim.sweep import task

__all__ = ["main"]

_GRACE = 5.0  # s that a frame has to end
_POLL = 0.02  # s


async def _serve(address: str) -> None:
    from distributed import Worker

    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGTERM, task.STOP.set)
    worker = Worker(address, nthreads=1, memory_limit=0, death_timeout=60, dashboard=False, validate=False)
    async with worker:
        ended = asyncio.ensure_future(worker.finished())
        while not (task.STOP.is_set() or ended.done()):
            await asyncio.sleep(_POLL)
        late = loop.time() + _GRACE
        while task.active() and loop.time() < late:
            await asyncio.sleep(_POLL)
        os._exit(0)  # the scheduler knows; what else there is to tidy is the parent's


def main(address: str, cores: str) -> int:
    """Serve until told to end."""
    die_with_parent()
    if cores and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, [int(core) for core in cores.split(",")])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C comes to the parent, which ends its workers
    asyncio.run(_serve(address))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
