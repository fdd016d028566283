"""Tables of the validation: targets with their sources, results, and work spread over processes."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
TARGETS = FOLDER / "targets.csv"
RESULTS = FOLDER / "results.csv"

# Processes that run simulations side by side, each with one thread; results do not depend on it.
PROCESSES = max(1, min(4, os.cpu_count() or 1))
DIGITS = 6


@dataclass(frozen=True)
class Result:
    """One row of results.csv.

    ``ours`` against ``target``, both in ``unit``; ``deviation`` as ``measure`` says, in per cent unless that names a
    unit; ``bound``, in the same unit, is what is claimed, empty where the row informs only.
    """

    test: str
    case: str
    quantity: str
    unit: str
    ours: float
    target: float
    deviation: float
    measure: str
    bound: float | None = None
    note: str = ""

    @property
    def within(self) -> bool:
        """Whether a claimed bound holds; true where nothing is claimed."""
        return self.bound is None or self.deviation <= self.bound


def targets(test: str) -> list[dict[str, str]]:
    """Rows of targets.csv for a test."""
    with TARGETS.open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["test"] == test]


def cell(value: object) -> str:
    """Text of a value in a table: numbers to `DIGITS` significant digits."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    return str(value)


def write(path: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([cell(value) for value in row] for row in rows)


def write_results(results: Sequence[Result], tests: Sequence[str]) -> None:
    """Write results.csv; rows of tests other than ``tests`` stay as they are."""
    names = [f.name for f in fields(Result)]
    kept = []
    if RESULTS.exists():
        with RESULTS.open(encoding="utf-8", newline="") as file:
            kept = [[row[n] for n in names] for row in csv.DictReader(file) if row["test"] not in tests]
    write(RESULTS, names, sorted([*kept, *(astuple(r) for r in results)], key=lambda row: str(row[0])))


def spread(function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Call ``function`` with each tuple of arguments, side by side; results in order."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        return [f.result() for f in [pool.submit(function, *a) for a in arguments]]
