"""Figure 6.8: benchmarks of chapter 6: funnel, cloth on ball, flamenco, N-body."""

from __future__ import annotations

from collections.abc import Sequence

from clothsim.reproduce import snapshots
from clothsim.reproduce.contract import Check, Effort
from clothsim.reproduce.snapshots import Shown

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "Funnel, Cloth on ball, Flamenco and N-body (18, 92, 49 and 146 thousand triangles): in most steps some "
    "places are much denser than others"
)


def measure(effort: Effort) -> Shown:
    """Detect in each step."""
    return snapshots.shoot(
        effort,
        ("Funnel", "Cloth on ball", "Flamenco", "N-body"),
        ("Funnel (generated)", "Skirt (generated)"),
        "figure 6.8",
    )


parameters = Shown.parameters
tables = Shown.tables
here = Shown.here


def checks(measured: Shown) -> Sequence[Check]:
    """Sizes, starts, contacts; uneven density."""
    return [*measured.checks(), measured.crowded()]


def draw(measured: Shown) -> bytes:
    """Tiles, with sizes and contacts."""
    return measured.draw("Figure 6.8: benchmarks of the octree grid")
