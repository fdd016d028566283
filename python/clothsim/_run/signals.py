"""Signals that stop a run between two steps."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType
from typing import Any

__all__ = ["Signals"]


class Signals:
    """Ctrl-C and SIGTERM raise only where the engine can stop between two steps; elsewhere they wait."""

    def __init__(self) -> None:
        self.signum = 0
        self._inside = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Signals:
        for signum in (signal.SIGINT, signal.SIGTERM):
            with contextlib.suppress(ValueError):  # not the main thread: signals go elsewhere
                self._before[signum] = signal.signal(signum, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._before.items():
            signal.signal(signum, handler)

    def _handle(self, signum: int, _frame: FrameType | None) -> None:
        self.signum = signum
        if self._inside:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def raising(self) -> Iterator[None]:
        """Let signals raise here, one that came before included."""
        self._inside = True
        try:
            if self.signum:
                raise KeyboardInterrupt
            yield
        finally:
            self._inside = False
