"""Progress of long work, on stderr."""

from __future__ import annotations

from typing import Any

from clothsim._arrays import optional

__all__ = ["progress_bar"]


def progress_bar(total: int, *, initial: int = 0, enabled: bool = True, name: str = "", unit: str = "frame") -> Any:
    """Return a bar with an estimate of the time left, on stderr."""
    tqdm = optional("tqdm", extra="all", purpose="showing progress")
    return tqdm.tqdm(
        total=total, initial=initial, disable=not enabled, unit=unit, desc=name or None, dynamic_ncols=True
    )
