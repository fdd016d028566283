"""Lines for ``logging``, made of what the engine reports of its steps, of its devices and of what it chose."""

from __future__ import annotations

import contextlib
import json
import logging
from collections.abc import Iterator
from typing import Any

from clothsim import _core

__all__ = ["EngineLog", "log_step", "step_reports"]


class EngineLog:
    """Says of an engine, once each, what is worth a line.

    Parameters
    ----------
    logger : Logger
        Where it says it.
    core : _core.Simulation
        The engine.
    resumed : bool
        What it did before its last step has been said.
    """

    def __init__(self, logger: logging.Logger, core: _core.Simulation, *, resumed: bool = False) -> None:
        self._logger, self._core = logger, core
        self._fallbacks = self._choices = 0
        if resumed:
            self._fallbacks = sum(f["step"] < core.step_count for f in json.loads(core.fallbacks()))
            self._choices = len(json.loads(core.choices()))
        self._log_fallbacks()

    @contextlib.contextmanager
    def stepping(self) -> Iterator[None]:
        """Log what the steps within took; their lines are made only where somebody listens."""
        first = step_reports(self._core) if self._logger.isEnabledFor(logging.INFO) else None
        try:
            yield
        finally:
            if first is not None:
                steps = json.loads(self._core.steps(first))
                reasons = self._reasons() if any(step["retries"] for step in steps) else {}
                for step in steps:
                    log_step(self._logger, step, reasons.get(step["step"], ""))
            self._log_fallbacks()
            self._log_choices()

    def _reasons(self) -> dict[int, str]:
        """Why the first attempt of a step was refused, by step, as far as the engine has kept it."""
        refused = json.loads(self._core.summary())["refused"]
        return {r["step"]: r["reason"] for r in reversed(refused)}

    def _log_fallbacks(self) -> None:
        """Say of each GPU that is done without since when, and why."""
        fallbacks = json.loads(self._core.fallbacks())
        for f in fallbacks[self._fallbacks :]:
            self._logger.warning(
                'detector "%s": on the CPU instead of a GPU since step %d: %s: %s',
                *(f[key] for key in ("detector", "step", "device", "reason")),
            )
        self._fallbacks = len(fallbacks)

    def _log_choices(self) -> None:
        """Say of each detector that was chosen by measuring since when, and why."""
        choices = json.loads(self._core.choices())
        for c in choices[self._choices :]:
            keys = ("detector", "device", "step", "why")
            self._logger.info('detector "%s" on %s after step %d: %s', *(c[key] for key in keys))
        self._choices = len(choices)


def step_reports(core: _core.Simulation) -> int:
    """How many steps an engine has taken, those before a checkpoint included."""
    return int(json.loads(core.summary())["totals"]["steps"])


def log_step(logger: logging.Logger, step: dict[str, Any], reason: str = "") -> None:
    """Log one row of a report's ``steps``: a line at DEBUG, and one at INFO for each thing that went hard.

    ``reason`` is why its first attempt was refused, where that is known.
    """
    where = f"step {step['step']} to {step['time']:.4f} s"
    if step["retries"]:
        logger.info(
            "%s: refused %d times, taken in %d parts, the smallest %.3g s%s",
            where, step["retries"], step["substeps"], step["smallest_dt"], f": {reason}" if reason else "",
        )  # fmt: skip
    if not step["converged"]:
        logger.info("%s: met a cap before its tolerance, residual %.2g", where, step["residual"])
    contact = step["contact"] or {}
    if contact.get("held_vertices"):
        logger.info("%s: %d vertices held back", where, contact["held_vertices"])
    if step["intersections"]:
        logger.info("%s: %d pairs of triangles pass through each other", where, step["intersections"])
    logger.debug(
        "%s: %d Newton and %d linear iterations, %d collisions, %.1f ms",
        where, step["newton_iterations"], step["linear_iterations"], contact.get("collisions", 0),
        1e3 * sum(seconds for _, seconds in step["seconds"]),
    )  # fmt: skip
