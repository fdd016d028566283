"""The choice of a device and of threads."""

from __future__ import annotations

import json
import operator

from clothsim.errors import InvalidInput

__all__ = ["DEVICES", "GPU_METHODS", "check_device", "check_threads"]

_MOST_THREADS = 65_536


DEVICES = ("auto", "cpu", "gpu")
GPU_METHODS = ("grid", "virtual-subdivision", "octree-single", "octree")


def check_device(device: str) -> str:
    """Refuse what is no name of a device."""
    if not isinstance(device, str) or device not in DEVICES:
        expected = f"one of {', '.join(json.dumps(name) for name in DEVICES)}"
        raise InvalidInput(
            f"device: expected {expected}, got {device!r}", name="device", expected=expected, got=repr(device)
        )
    return device


def check_threads(threads: int | None) -> int | None:
    """Refuse what is no number of threads that a machine can have."""
    if threads is None:
        return None
    try:
        count = operator.index(threads)
    except TypeError:
        count = 0
    if not 1 <= count <= _MOST_THREADS or isinstance(threads, bool):
        expected = "a whole number ≥ 1" if count < _MOST_THREADS else f"at most {_MOST_THREADS}"
        raise InvalidInput(
            f"threads: expected {expected}, got {threads!r}", name="threads", expected=expected, got=repr(threads)
        )
    return count
