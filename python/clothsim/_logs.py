"""Lines about steps for ``logging``, made of what the engine reports of them."""

from __future__ import annotations

import logging
from typing import Any

__all__ = ["log_step"]


def log_step(logger: logging.Logger, step: dict[str, Any]) -> None:
    """Log one row of a report's ``steps``: a line at DEBUG, and one at INFO for each thing that went hard."""
    where = f"step {step['step']} to {step['time']:.4f} s"
    if step["retries"]:
        logger.info(
            "%s: refused %d times, taken in %d parts, the smallest %.3g s",
            where, step["retries"], step["substeps"], step["smallest_dt"],
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
