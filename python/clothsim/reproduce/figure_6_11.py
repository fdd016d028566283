"""Figure 6.11: shares of the steps of the octree grid on the cloth on ball benchmark."""

from __future__ import annotations

from collections.abc import Mapping

from clothsim.reproduce.contract import Effort, Table
from clothsim.reproduce.counting import OCTREE
from clothsim.reproduce.timings import OCTREE_GROUPS, Parts, draw_parts, parts

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "cloth on ball: the broad phase takes 40 % of the time, most of all steps, building the octree 19 % (GTX 780)"
SHOWN = "Cloth on ball"
PRINTED = {"building the octree": 19.0, "broad phase": 40.0}


def measure(effort: Effort) -> Parts:
    """Time the stages."""
    return parts(effort, OCTREE, SHOWN, OCTREE_GROUPS, "figure 6.11")


parameters = Parts.parameters


def tables(measured: Parts) -> Mapping[str, Table]:
    """One row per step, and per stage."""
    return measured.tables(PRINTED)


here = Parts.here
checks = Parts.checks  # only what does not depend on the device


def draw(measured: Parts) -> bytes:
    """The shares beside the thesis's."""
    return draw_parts(measured, PRINTED, "Figure 6.11: steps of the octree grid")
