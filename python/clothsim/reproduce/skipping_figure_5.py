"""Figure 5 of Wong 2010: snapshots of experiment set one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.reproduce import skipping_snapshots as snapshots
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "pictures of a cloth on a spinning bumpy ball, a cloth and a ball, a cloth on four cones, a garment on a mannequin"
)


def measure(effort: Effort) -> list[snapshots.Shot]:
    """Make the frames, and count contacts."""
    return snapshots.shoot(effort, ("one",), "figure 5")


def parameters(measured: Sequence[snapshots.Shot]) -> Mapping[str, Any]:
    """How the animations came about."""
    return snapshots.parameters(measured)


def tables(measured: Sequence[snapshots.Shot]) -> Mapping[str, Table]:
    """One row per animation and moment."""
    return snapshots.tables(measured)


def here(measured: Sequence[snapshots.Shot]) -> str:
    """What there is to detect."""
    return snapshots.here(measured)


def checks(measured: Sequence[snapshots.Shot]) -> Sequence[Check]:
    """Start, contact, motion."""
    return snapshots.checks(measured)


def draw(measured: Sequence[snapshots.Shot]) -> bytes:
    """Each animation in a column."""
    return snapshots.draw(
        measured, "Figure 5: experiment set one", "By formula, not simulated. Contacts: bvh, continuous."
    )
