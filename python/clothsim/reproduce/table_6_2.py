"""Table 6.2: times of the octree grid, discrete and continuous."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clothsim.reproduce.contract import Effort, Table
from clothsim.reproduce.counting import OCTREE
from clothsim.reproduce.timings import Times, draw_times, times

__all__ = ["PRINTED", "THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

# DCD and CCD on a GTX 470, then on a GTX 780 [ms].
PRINTED = {
    "Funnel": (4.7, 5.1, 3.7, 3.4), "Cloth on ball": (10.5, 13.3, 8.3, 9.2), "Flamenco": (16.1, 17.4, 11.7, 10.8),
    "N-body": (30.2, 24.8, 20.8, 19.1), "Reef knot": (4.7, 4.9, 3.2, 3.0),
}  # fmt: skip
THESIS = (
    "all stages of DCD and CCD on a GTX 780: Funnel 3.7 and 3.4 ms, Cloth on ball 8.3 and 9.2, Flamenco 11.7 and 10.8, "
    "N-body 20.8 and 19.1, Reef knot 3.2 and 3.0"
)


def measure(effort: Effort) -> Times:
    """Time both modes."""
    return times(effort, (OCTREE,), "table 6.2", quick=("Funnel (generated)",))


def parameters(measured: Times) -> Mapping[str, Any]:
    """What was timed, on what."""
    return {**measured.parameters(), "method": OCTREE}


def tables(measured: Times) -> Mapping[str, Table]:
    """One row per benchmark beside the thesis's, and the stages."""
    columns = ("GTX 470 DCD [ms]", "GTX 470 CCD [ms]", "GTX 780 DCD [ms]", "GTX 780 CCD [ms]")
    return measured.tables(OCTREE, columns, PRINTED)


def here(measured: Times) -> str:
    """Milliseconds per benchmark."""
    return measured.here(OCTREE)


checks = Times.checks  # only what does not depend on the device


def draw(measured: Times) -> bytes:
    """Bars beside the thesis's on a GTX 780."""
    printed = {OCTREE: {name: row[2:] for name, row in PRINTED.items()}}
    words = "All stages of one step; the thesis's on a GTX 780."
    return draw_times(measured, (OCTREE,), printed, "Table 6.2: times of the octree grid", words)
