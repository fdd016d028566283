"""Figure 5.1: two ribbons are tied into a reef knot."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce import snapshots
from clothsim.reproduce.contract import Check, Effort
from clothsim.reproduce.snapshots import Shown

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "two ribbons, 20 thousand triangles, are tied into a reef knot and drawn tight"


def measure(effort: Effort) -> Shown:
    """Detect in each step."""
    return snapshots.shoot(effort, ("Reef knot",), ("Reef knot (generated)",), "figure 5.1")


parameters = Shown.parameters
tables = Shown.tables
here = Shown.here


def checks(measured: Shown) -> Sequence[Check]:
    """Sizes, starts, contacts."""
    return measured.checks()


def draw(measured: Shown) -> bytes:
    """Tiles, with sizes and contacts."""
    return measured.draw("Figure 5.1: the reef knot benchmark")
