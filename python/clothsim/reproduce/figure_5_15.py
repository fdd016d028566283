"""Figure 5.15: shares of the steps of virtual subdivision on the N-body benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.counting import VIRTUAL, agreement, chosen, device_words, left_out
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
    return {
        "shown": measured.name, **chosen(measured.suite), "mode": "continuous", "lambda": 1.2,
        "device": device_words(measured.counted.device),
        **{f"step {group!r}": ", ".join(stages) for group, stages in GROUPS.items()},
        "subdivision, assignment": "one stage here; the thesis's 8 % are those of the subdivision alone",
    }  # fmt: skip


def tables(measured: Parts) -> Mapping[str, Table]:
    """One row per step, and per stage."""
    rows = [(group, share, PRINTED.get(group, float("nan"))) for group, share in measured.shares.items()]
    stages = [(stage, 1e3 * s) for stage, s in measured.counted.seconds.items()]
    return {
        "": Table(("step", "share [%]", "thesis [%]"), rows),
        "stages": Table(("stage", "time [ms]"), stages),
    }


def here(measured: Parts) -> str:
    """The shares."""
    words = ", ".join(f"{group} {share:.0f} %" for group, share in measured.shares.items())
    text = (
        f"{measured.name}: {words} of {measured.counted.milliseconds:.3g} ms; {device_words(measured.counted.device)}"
    )
    return text if measured.name == SHOWN else left_out(measured.suite, text)


def checks(measured: Parts) -> Sequence[Check]:
    """Only what does not depend on the device."""
    total = sum(measured.shares.values())
    return [
        Check("shares of all steps [%]", total, 100.0, 1e-6, "each stage counts once"),
        *agreement([measured.counted]),
    ]


def draw(measured: Parts) -> bytes:
    """The shares beside the thesis's."""
    return draw_parts(
        measured,
        PRINTED,
        "Figure 5.15: steps of virtual subdivision",
        "Continuous detection on a GPU; narrow phase on the CPU.",
    )
