"""The GPUs of this machine, asked of their drivers.

Run as a module of its own (``python -m clothsim._cli.adapters``), because a broken driver may crash or hang the process
that asks: prints one JSON object.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from clothsim import _core

__all__ = ["adapters"]

_TIMEOUT = 60  # s, for a driver that hangs


def adapters() -> tuple[list[dict[str, Any]], str]:
    """Return the adapters with their limits, best first, and what went wrong if there are none."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__], capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return [], f"asking the drivers failed: {error}"
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:]
        return [], f"asking the drivers failed: {last[0] if last else f'exit code {done.returncode}'}"
    answer: dict[str, Any] = json.loads(done.stdout)
    found, problem = answer["adapters"], answer["problem"]
    if not found and not problem:
        problem = "no Vulkan, Metal or DX12 adapter; a software adapter: apt install mesa-vulkan-drivers"
    return found, problem


if __name__ == "__main__":
    listed, why = _core.gpu_adapters()
    sys.stdout.write(json.dumps({"adapters": json.loads(listed), "problem": why}))
