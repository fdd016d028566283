"""One target for a while in this process, under limits of memory and time. Run in processes of its own by `fuzz.pool`.

A case that takes more processor time than the target allows is a finding; what does not come back from compiled code is
ended by a second clock, and the parent finds the case in the file that was written before it began. The parent also
sees a process that dies: of memory that Rust cannot get, of a signal.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import json
import logging
import resource
import signal
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
from hypothesis import HealthCheck, Phase, Verbosity

from fuzz.target import Target
from fuzz.targets import TARGETS

__all__ = ["main", "run_slice"]

# What a case may ask for beyond what the process has when it begins [B].
_MEMORY = 3 * 2**30
# The clock on the wall is for what waits and for compiled code that never returns: generous, for machines under load.
_WALL_FACTOR = 30
# Cases per run of hypothesis: between two of them the clock is looked at.
_BATCH = 100


class TooLong(Exception):
    """A case took more processor time than it may."""


@contextlib.contextmanager
def limited(target: Target) -> Iterator[None]:
    """Bound the time of one case."""

    def stop(*_: object) -> None:
        raise TooLong(f"more than {target.seconds:g} s of processor time")

    signal.signal(signal.SIGPROF, stop)
    faulthandler.dump_traceback_later(target.seconds * _WALL_FACTOR, exit=True)
    signal.setitimer(signal.ITIMER_PROF, target.seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        faulthandler.cancel_dump_traceback_later()


def bound_memory() -> None:
    """Let this process have so much address space more."""
    with open("/proc/self/statm", encoding="ascii") as file:
        present = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (present + _MEMORY, present + _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


class _Watched:
    """The check of a target with its limits, its count, and the case that failed last."""

    def __init__(self, target: Target, current: Path) -> None:
        self._target, self._current = target, current
        self.cases = 0
        self.slowest = 0.0
        self.failed: Any = None

    def __call__(self, case: Any) -> None:
        suffix, content = self._target.dump(case)
        self._current.write_bytes(suffix.encode() + b"\n" + content)
        self.cases += 1
        began = time.process_time()
        try:
            with limited(self._target):
                self._target.check(case)
        except BaseException as error:
            self.failed = case
            # A panic of Rust is no Exception: hypothesis would let it pass through without shrinking it.
            if not isinstance(error, (Exception, KeyboardInterrupt, SystemExit)):
                raise AssertionError(f"panic: {error}") from error
            raise
        finally:
            self.slowest = max(self.slowest, time.process_time() - began)


def run_slice(
    target: Target, seed: int, seconds: float, most: int, current: Path, *, shrink: bool = True
) -> dict[str, Any]:
    """Fuzz until the time or the number of cases is over, or there is a finding; facts about it."""
    check = _Watched(target, current)

    def case_of(case: Any) -> None:
        check(case)

    began = time.monotonic()
    finding = None
    number = 0
    while finding is None and check.cases < most and (time.monotonic() - began < seconds or not number):
        wrapped = hypothesis.given(target.cases)(case_of)
        wrapped = hypothesis.settings(
            max_examples=min(_BATCH, most - check.cases), database=None, deadline=None, print_blob=False,
            verbosity=Verbosity.quiet, phases=(Phase.generate, Phase.shrink)[: 1 + shrink], report_multiple_bugs=False,
            suppress_health_check=list(HealthCheck),
        )(wrapped)  # fmt: skip
        wrapped = hypothesis.seed(f"{target.name}-{seed}-{number}")(wrapped)
        number += 1
        try:
            wrapped()
        except Exception as error:
            finding = _facts(target, check.failed, error)
    return {"cases": check.cases, "slowest": check.slowest, "seconds": time.monotonic() - began, "finding": finding}


def _facts(target: Target, case: Any, error: BaseException) -> dict[str, Any]:
    suffix, content = target.dump(case)
    lines = traceback.format_exception(error)
    places = [f for f in traceback.extract_tb(error.__traceback__) if "hypothesis" not in f.filename]
    where = f"{Path(places[-1].filename).name}:{places[-1].name}" if places else ""
    return {
        "error": f"{type(error).__name__}: {error}"[:2000], "where": where, "suffix": suffix,
        "content": content.hex(), "traceback": "".join(lines)[-6000:],
    }  # fmt: skip


def replay(target: Target, path: Path, current: Path) -> dict[str, Any]:
    """Check one file of the corpus."""
    case = target.load(path.suffix, path.read_bytes())
    try:
        _Watched(target, current)(case)
    except Exception as error:
        return {"cases": 1, "finding": _facts(target, case, error)}
    return {"cases": 1, "finding": None}


def main() -> int:
    """Run a slice and print one line of JSON."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.slice")
    parser.add_argument("target", choices=sorted(TARGETS))
    parser.add_argument("current", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--most", type=int, default=10**9)
    parser.add_argument("--replay", type=Path, nargs="*", default=[])
    parser.add_argument("--plant", action="store_true", help="with a fault in the product")
    parser.add_argument("--as-found", action="store_true", help="do not shrink")
    options = parser.parse_args()
    target = TARGETS[options.target]()
    logging.disable(logging.CRITICAL)
    bound_memory()
    with target.plant() if options.plant else contextlib.nullcontext():
        for path in options.replay:
            print(json.dumps({"file": str(path), **replay(target, path, options.current)}), flush=True)
        if options.most:
            facts = run_slice(
                target, options.seed, options.seconds, options.most, options.current, shrink=not options.as_found
            )
            print(json.dumps(facts), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
