"""Figure 6 of Wong 2010: snapshots of experiment set two."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce.contract import Effort
from clothsim.reproduce.skipping_snapshots import Shot, checks, draw_titled, here, parameters, shoot, tables

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "pictures of cloths of 320k to 502k triangles over bodies whose ridges show through"


def measure(effort: Effort) -> list[Shot]:
    """Make the frames, and count contacts."""
    return shoot(effort, ("two",), "figure 6")


def draw(measured: Sequence[Shot]) -> bytes:
    """Each animation in a column."""
    return draw_titled(measured, "Figure 6: experiment set two")
