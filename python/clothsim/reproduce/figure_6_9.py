"""Figure 6.9: the reef knot, whose ribbons crowd in the knot."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce import snapshots
from clothsim.reproduce.contract import Check, Effort
from clothsim.reproduce.snapshots import Shown

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "two ribbons, 20 thousand triangles, are tied into a reef knot: very dense in the knot, sparse elsewhere"


def measure(effort: Effort) -> Shown:
    """Detect in each step."""
    return snapshots.shoot(effort, ("Reef knot",), ("Reef knot (generated)",), "figure 6.9")


parameters = Shown.parameters
tables = Shown.tables
here = Shown.here


def checks(measured: Shown) -> Sequence[Check]:
    """Sizes, starts, contacts; uneven density."""
    return [*measured.checks(), measured.crowded()]


def draw(measured: Shown) -> bytes:
    """Tiles, with sizes and contacts."""
    return measured.draw("Figure 6.9: the reef knot benchmark")
