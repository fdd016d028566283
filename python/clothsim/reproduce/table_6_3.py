"""Table 6.3: times of virtual subdivision on the device of Table 6.2, and how much faster the octree grid is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.reproduce import table_6_2
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import OCTREE, VIRTUAL, device_words, left_out
from clothsim.reproduce.timings import MODES, Times, draw_times, times

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

# DCD [ms], speed-up, CCD [ms], speed-up; GTX 780.
PRINTED = {
    "Funnel": (4.4, 1.2, 4.0, 1.2), "Cloth on ball": (10.2, 1.2, 11.1, 1.2), "Flamenco": (11.2, 0.9, 11.0, 1.0),
    "N-body": (18.7, 0.9, 24.5, 1.3), "Reef knot": (4.3, 1.3, 4.4, 1.5),
}  # fmt: skip
THESIS = (
    "the octree grid is 1.2 (DCD) and 1.2 (CCD) times as fast as virtual subdivision in Funnel, 1.2 and 1.2 in Cloth "
    "on ball, 0.9 and 1.0 in Flamenco, 0.9 and 1.3 in N-body, 1.3 and 1.5 in Reef knot (GTX 780)"
)


def measure(effort: Effort) -> Times:
    """Time both methods, both modes."""
    return times(effort, (VIRTUAL, OCTREE), "table 6.3", quick=("Funnel (generated)",))


def _faster(measured: Times, name: str, mode: str) -> float:
    return measured.milliseconds(name, VIRTUAL, mode) / measured.milliseconds(name, OCTREE, mode)


def parameters(measured: Times) -> Mapping[str, Any]:
    """What was timed, on what."""
    return {**measured.parameters(), "lambda": 1.2}


def tables(measured: Times) -> Mapping[str, Table]:
    """One row per benchmark beside the thesis's, and the stages."""
    columns = (
        "benchmark", "triangles", "DCD [ms]", "DCD speed-up", "CCD [ms]", "CCD speed-up", "CCD tests",
        "CCD tests of the octree", "thesis: benchmark", "thesis: DCD [ms]", "thesis: DCD speed-up", "thesis: CCD [ms]",
        "thesis: CCD speed-up",
    )  # fmt: skip
    nothing = (float("nan"),) * 4
    rows = []
    for b in measured.suite.benchmarks:
        each = [(measured.milliseconds(b.name, VIRTUAL, mode), _faster(measured, b.name, mode)) for mode in MODES]
        tests = [measured.counts[b.name, method, "continuous"].tests for method in (VIRTUAL, OCTREE)]
        rows.append((
            b.name, len(b.triangles), *each[0], *each[1], *tests, b.thesis, *PRINTED.get(b.thesis, nothing)
        ))  # fmt: skip
    return {"": Table(columns, rows), "stages": measured.stages()}


def here(measured: Times) -> str:
    """How many times as fast, per benchmark."""
    words = [
        f"{b.name} {' and '.join(f'{_faster(measured, b.name, mode):.2g}' for mode in MODES)}"
        for b in measured.suite.benchmarks
    ]
    return left_out(measured.suite, f"times as fast, DCD and CCD: {', '.join(words)}; {device_words(measured.device)}")


def checks(measured: Times) -> Sequence[Check]:
    """Only what does not depend on the device."""
    return measured.checks()


def draw(measured: Times) -> bytes:
    """Bars of both beside the thesis's."""
    printed = {
        VIRTUAL: {name: row[::2] for name, row in PRINTED.items()},
        OCTREE: {name: row[2:] for name, row in table_6_2.PRINTED.items()},
    }
    words = "All stages of one step; the thesis's on a GTX 780."
    return draw_times(
        measured, (VIRTUAL, OCTREE), printed, "Table 6.3: virtual subdivision against the octree grid", words
    )
