"""Figure 5.15: shares of the steps of virtual subdivision on the N-body benchmark."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clothsim.reproduce.contract import Effort, Table
from clothsim.reproduce.counting import VIRTUAL
from clothsim.reproduce.timings import GROUPS, Parts, draw_parts, parts

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "N-body: virtual subdivision takes 8 % of the time, the broad phase 48 %, most of all steps (GTX 470)"
SHOWN = "N-body"
PRINTED = {"subdivision, assignment": 8.0, "broad phase": 48.0}


def measure(effort: Effort) -> Parts:
    """Time the stages."""
    return parts(effort, VIRTUAL, SHOWN, GROUPS, "figure 5.15")


def parameters(measured: Parts) -> Mapping[str, Any]:
    """What was timed, on what."""
    words = "one stage here; the thesis's 8 % are those of the subdivision alone"
    return {**measured.parameters(), "lambda": 1.2, "subdivision, assignment": words}


def tables(measured: Parts) -> Mapping[str, Table]:
    """One row per step, and per stage."""
    return measured.tables(PRINTED)


here = Parts.here
checks = Parts.checks  # only what does not depend on the device


def draw(measured: Parts) -> bytes:
    """The shares beside the thesis's."""
    return draw_parts(measured, PRINTED, "Figure 5.15: steps of virtual subdivision")
