"""One cell of the atlas, in a process of its own: ``python -m clothsim.stability.worker JOB``."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from clothsim.errors import ClothSimError
from clothsim.scene import Scene
from clothsim.stability.catalogue import find
from clothsim.stability.observe import observe
from clothsim.study.axes import apply, axis, variant
from clothsim.study.process import serve

__all__ = ["run_cell"]


def run_cell(job: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Build the scene of a cell and observe it; returns facts and no arrays."""
    case = find(job["case"])
    try:
        setup = case.build(job["x"], job["y"])
        if job["fixed"]:
            setup = replace(setup, scene=_with(setup.scene, job["fixed"]))
    except ClothSimError as error:
        return {"error": str(error), "error_type": type(error).__name__, "time": 0.0}, {}
    except (ArithmeticError, TypeError, ValueError) as error:  # a value of --at that makes no scene
        return {"error": f"no scene with these values: {error}", "error_type": "InvalidInput", "time": 0.0}, {}
    return observe(setup), {}


def _with(scene: Scene, fixed: Mapping[str, Any]) -> Scene:
    """The scene with keys set, arrays kept."""
    data = scene.to_dict()
    for name, value in fixed.items():
        only = axis(name, [value])
        apply(data, only.key, value)
    made = variant(scene, data)
    made.check()
    return made


if __name__ == "__main__":
    sys.exit(serve(Path(sys.argv[1]), run_cell))
