"""What the module of a figure offers, and what it is given."""

from __future__ import annotations

import csv
import io
import math
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, CancelledError, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

from clothsim._arrays import optional

__all__ = ["Bar", "Check", "Effort", "Reproduction", "Table"]

Item = TypeVar("Item")
Result = TypeVar("Result")


class Reproduction(Protocol):
    """The names that the module of a figure or table has; the first function measures, the others show it.

    Attributes
    ----------
    THESIS : str
        What the paper says or shows, in one sentence with its numbers.
    """

    THESIS: str

    def measure(self, effort: Effort) -> Any:
        """Do the work, and return what the other functions take."""

    def parameters(self, measured: Any) -> Mapping[str, Any]:
        """Everything that was chosen, units in the names: the paper's parameters, and those that it leaves open."""

    def tables(self, measured: Any) -> Mapping[str, Table]:
        """Tables by the end of their file's name; "" for the only or main one."""

    def draw(self, measured: Any) -> bytes:
        """Draw the picture: the content of a PNG file."""

    def here(self, measured: Any) -> str:
        """What came out, in one sentence with its numbers: the answer to `THESIS`."""

    def checks(self, measured: Any) -> Sequence[Check]:
        """Compare with closed forms and with findings of the paper that must come out again."""


@dataclass(frozen=True)
class Table:
    """A CSV file.

    Attributes
    ----------
    columns : sequence of str
        Names with units: ``"curvature [1/m]"``.
    rows : iterable of sequences
        Numbers and strings.
    """

    columns: Sequence[str]
    rows: Iterable[Sequence[Any]]

    def text(self, parameters: Mapping[str, Any]) -> str:
        """CSV whose first lines, each with a ``#``, are the parameters; a name or text with a comma is quoted."""
        written = io.StringIO()
        written.writelines(f"# {name}: {_cell(value)}\n" for name, value in parameters.items())
        rows = csv.writer(written, lineterminator="\n")
        rows.writerow(self.columns)
        rows.writerows([_cell(value) for value in row] for row in self.rows)
        return written.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    return str(value)


@dataclass(frozen=True)
class Check:
    """A measured number against what it has to be.

    Attributes
    ----------
    what : str
        The quantity with its unit.
    here : float
        As measured.
    expected : float
        As it has to be.
    tolerance : float
        Largest difference that passes.
    reason : str
        Where the expected value comes from, and why the tolerance.
    """

    what: str
    here: float
    expected: float
    tolerance: float
    reason: str

    @property
    def passed(self) -> bool:
        """Whether the numbers agree; NaN never does."""
        return math.isfinite(self.here) and abs(self.here - self.expected) <= self.tolerance

    def facts(self) -> dict[str, Any]:
        """The check as a table for JSON."""
        return {
            "what": self.what, "here": self.here, "expected": self.expected, "tolerance": self.tolerance,
            "passed": self.passed, "reason": self.reason,
        }  # fmt: skip

    @classmethod
    def true(cls, what: str, found: bool, reason: str) -> Check:
        """Check a finding that is true or not."""
        return cls(what, float(found), 1.0, 0.0, reason)


def _threads() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Effort:
    """How much work may be spent.

    Attributes
    ----------
    quick : bool
        A coarse variant of the same experiment: seconds.
    threads : int
        How many threads.
    progress : bool
        Show a bar on stderr.
    mesh : Path, optional
        A mesh to use instead of the generated one, for figures whose module has ``TAKES_MESH = True``.
    """

    quick: bool = False
    threads: int = field(default_factory=_threads)
    progress: bool = False
    mesh: Path | None = None

    def bar(self, total: int, name: str, unit: str = "step") -> Bar:
        """Return a progress bar with an estimate of the time left; use it in a ``with``."""
        return Bar(total, name, unit, enabled=self.progress)

    def each(self, work: Callable[[Item], Result], items: Sequence[Item], bar: Bar) -> list[Result]:
        """Do ``work(item)`` for each item on as many threads as there are; return the results in the items' order.

        For simulations, which take one thread each here: they release the interpreter while they step. Where one fails,
        or Ctrl-C comes, the others end at their next `Bar.update`.
        """
        pool = ThreadPoolExecutor(max_workers=max(1, min(self.threads, len(items))))
        try:
            futures = [pool.submit(work, item) for item in items]
            for future in wait(futures, return_when=FIRST_EXCEPTION).done:
                future.result()
            return [future.result() for future in futures]
        except BaseException:
            bar.stop()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


class Bar:
    """A progress bar on stderr, which can also stop who updates it."""

    def __init__(self, total: int, name: str, unit: str, *, enabled: bool) -> None:
        tqdm = optional("tqdm", extra="all", purpose="showing progress")
        self._bar = tqdm.tqdm(total=total, desc=name, unit=unit, disable=not enabled, dynamic_ncols=True)
        self._stopped = threading.Event()

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def update(self) -> None:
        """One more is done.

        Raises
        ------
        CancelledError
            Another thread has failed.
        """
        if self._stopped.is_set():
            raise CancelledError
        self._bar.update()

    def stop(self) -> None:
        """Let the next update of any thread raise."""
        self._stopped.set()
