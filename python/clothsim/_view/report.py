"""What pictures take from ``report.json``, read by someone who knows nothing of who wrote it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["Report", "read"]

_ENERGIES = ("kinetic", "stretch", "shear", "bending", "gravity", "total")
_CONTACTS = ("proximities", "collisions", "zone_vertices", "held_vertices")


class Report(NamedTuple):
    """Facts of each frame, what each effect cost in the whole run, and the error that stopped it."""

    frames: list[dict[str, Any]]
    effects: list[dict[str, Any]]
    error: str | None


def read(path: Path) -> Report:
    """Read and check a report.

    Raises
    ------
    FileNotFoundError
        There is none.
    ValueError, KeyError, TypeError, RecursionError, OSError
        It cannot be read, or what pictures need of it is not there.
    """
    report = json.loads(path.read_bytes())
    frames, effects, error = list(report["frames"]), list(report["effects"]), report["error"]
    for frame in frames:
        _check_numbers({key: frame[key] for key in ("time", "steps")})
        _check_numbers({kind: frame["energy"][kind] for kind in _ENERGIES})
        _check_numbers(frame["seconds"])
        _check_numbers(frame.get("effects") or {})
        contact = frame["contact"] or {}
        _check_numbers({key: contact[key] for key in _CONTACTS if key in contact})
        if frame.get("work"):
            _check_numbers({kind: frame["work"][kind] for kind in ("pins", "air")})
        _check_numbers({"intersections": frame["intersections"] or 0})
    for effect in effects:
        _check_numbers({str(effect["name"]): effect["milliseconds"] or 0})
    return Report(frames, effects, None if error is None else str(error))


def _check_numbers(table: dict[str, Any]) -> None:
    for key, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{key}: expected a finite number, got {str(value)[:200]}")
