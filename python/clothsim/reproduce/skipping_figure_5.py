"""Figure 5 of Wong 2010: snapshots of experiment set one."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce.contract import Effort
from clothsim.reproduce.skipping_snapshots import Shot, checks, draw_titled, here, parameters, shoot, tables

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "pictures of a cloth on a spinning bumpy ball, a cloth and a ball, a cloth on four cones, a garment on a mannequin"
)


def measure(effort: Effort) -> list[Shot]:
    """Make the frames, and count contacts."""
    return shoot(effort, ("one",), "figure 5")


def draw(measured: Sequence[Shot]) -> bytes:
    """Each animation in a column."""
    return draw_titled(measured, "Figure 5: experiment set one")
