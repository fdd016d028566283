"""Figure 5.11: a dancing figure in a skirt of several layers."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce import snapshots
from clothsim.reproduce.contract import Check, Effort
from clothsim.reproduce.snapshots import Shown

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "a dancing figure in a skirt of several layers of cloth, 49 thousand triangles"


def measure(effort: Effort) -> Shown:
    """Detect in each step."""
    return snapshots.shoot(effort, ("Flamenco",), ("Skirt (generated)",), "figure 5.11")


parameters = Shown.parameters
tables = Shown.tables
here = Shown.here


def checks(measured: Shown) -> Sequence[Check]:
    """Sizes, starts, contacts; triangles of many sizes."""
    return [*measured.checks(), measured.differing_sizes()]


def draw(measured: Shown) -> bytes:
    """Tiles, with sizes and contacts."""
    return measured.draw("Figure 5.11: the flamenco benchmark")
