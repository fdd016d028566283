"""The targets by name; each is built when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from fuzz.target import Target

__all__ = ["NAMES", "TARGETS"]

NAMES = (
    "scenes",
    "sweeps",
    "meshes",
    "animations",
    "recordings",
    "checkpoints",
    "detection",
    "sessions",
    "runs",
    "arrays",
    "commands",
)


def _built(name: str) -> Callable[[], Target]:
    def build() -> Target:
        target: Target = importlib.import_module(f"fuzz.targets.{name}").target()
        return target

    return build


TARGETS = {name: _built(name) for name in NAMES}
