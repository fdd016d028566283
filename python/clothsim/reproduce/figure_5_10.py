"""Figure 5.10: benchmarks of chapter 5: funnel, cloth on ball, N-body, bowline knot."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce import snapshots
from clothsim.reproduce.contract import Check, Effort
from clothsim.reproduce.snapshots import Shown

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = "Funnel 18, Cloth on ball 92, N-body 146 and Bowline knot 11 thousand triangles, whose sizes vary considerably"


def measure(effort: Effort) -> Shown:
    """Detect in each step."""
    return snapshots.shoot(
        effort,
        ("Funnel", "Cloth on ball", "N-body", "Bowline knot"),
        ("Funnel (generated)", "Bowline (generated)"),
        "figure 5.10",
    )


parameters = Shown.parameters
tables = Shown.tables
here = Shown.here


def checks(measured: Shown) -> Sequence[Check]:
    """Sizes, starts, contacts; triangles of many sizes."""
    return [*measured.checks(), measured.differing_sizes()]


def draw(measured: Shown) -> bytes:
    """Tiles, with sizes and contacts."""
    return measured.draw("Figure 5.10: benchmarks of virtual subdivision")
