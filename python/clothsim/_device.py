"""The choice of a device and of threads."""

from __future__ import annotations

import operator

from clothsim.errors import GpuUnavailable, InvalidInput

__all__ = ["check_device", "check_threads"]

_MOST_THREADS = 65_536


def check_device(device: str) -> str:
    """Return ``"cpu"`` for what a simulation can do; ``"auto"`` is the CPU too, as it is the only one."""
    if device in ("cpu", "auto"):
        return "cpu"
    if device == "gpu":
        raise GpuUnavailable('device: a simulation detects collisions on the CPU only; use "cpu" or "auto"')
    raise InvalidInput(
        f'device: expected one of "cpu", "auto", got {device!r}',
        name="device",
        expected='one of "cpu", "auto"',
        got=repr(device),
    )


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
