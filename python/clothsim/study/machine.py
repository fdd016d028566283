"""Where a study ran."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import _core
from clothsim.study.pool import cores, load

__all__ = ["facts"]


def facts() -> dict[str, Any]:
    """Processor, cores, system, versions, and how busy it was before."""
    return {
        "processor": _processor(), "cores": len(cores()), "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(), "numpy": np.__version__, "clothsim": _core.__version__,
        "load_before": None if (busy := load()) is None else round(busy, 2),
    }  # fmt: skip


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
