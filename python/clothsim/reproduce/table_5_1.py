"""Table 5.1: times of virtual subdivision, discrete and continuous."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clothsim.reproduce.contract import Effort, Table
from clothsim.reproduce.counting import VIRTUAL
from clothsim.reproduce.timings import Times, draw_times, times

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

# Thousands of triangles; DCD and CCD [ms].
PRINTED = {
    "Funnel": (18, 5.1, 5.6), "Cloth on ball": (92, 12.0, 14.8), "Flamenco": (49, 14.2, 16.1),
    "N-body": (146, 26.7, 31.2), "Reef knot": (20, 5.5, 6.0), "Bowline knot": (12, 4.3, 4.0),
}  # fmt: skip
THESIS = (
    "all stages of DCD and CCD on a GTX 470: Funnel 5.1 and 5.6 ms, Cloth on ball 12.0 and 14.8, Flamenco 14.2 and "
    "16.1, N-body 26.7 and 31.2, Reef knot 5.5 and 6.0, Bowline knot 4.3 and 4.0"
)


def measure(effort: Effort) -> Times:
    """Time both modes."""
    return times(effort, (VIRTUAL,), "table 5.1")


def parameters(measured: Times) -> Mapping[str, Any]:
    """What was timed, on what."""
    return {**measured.parameters(), "method": VIRTUAL, "lambda": 1.2}


def tables(measured: Times) -> Mapping[str, Table]:
    """One row per benchmark beside the thesis's, and the stages."""
    columns = ("triangles, thousands", "DCD [ms]", "CCD [ms]")
    return measured.tables(VIRTUAL, columns, PRINTED)


def here(measured: Times) -> str:
    """Milliseconds per benchmark."""
    return measured.here(VIRTUAL)


checks = Times.checks  # only what does not depend on the device


def draw(measured: Times) -> bytes:
    """Bars beside the thesis's."""
    printed = {VIRTUAL: {name: row[1:] for name, row in PRINTED.items()}}
    return draw_times(
        measured, (VIRTUAL,), printed, "Table 5.1: times of virtual subdivision", "All stages of one step."
    )
