"""What the package logs, on stderr: ``-v`` and ``--quiet``."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["add_verbose", "shown_logs"]


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """How much to say on stderr."""
    parser.add_argument(
        "-v", "--verbose", action="count", default=0,
        help="say more on stderr: choices and what went hard; twice: every step",
    )  # fmt: skip


@contextmanager
def shown_logs(verbose: int, *, quiet: bool) -> Iterator[None]:
    """Write what the logger ``clothsim`` gets to stderr: warnings; with ``quiet`` errors alone; more if asked.

    Afterwards the logger is as it was: a program that calls the command line keeps its own logging.
    """
    logger = logging.getLogger("clothsim")
    level, handler = logger.level, _Stderr()
    logger.setLevel(logging.DEBUG if verbose > 1 else logging.INFO if verbose else _least(quiet=quiet))
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def _least(*, quiet: bool) -> int:
    return logging.ERROR if quiet else logging.WARNING


class _Stderr(logging.Handler):
    """Lines on what ``sys.stderr`` is when they come, above a progress bar if there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            line = f"{record.levelname.lower()}: {record.getMessage()}"
            bars = sys.modules.get("tqdm")
            if bars is not None:
                bars.tqdm.write(line, file=sys.stderr)
            else:
                print(line, file=sys.stderr, flush=True)
        except Exception:  # a log line never ends what it is about
            self.handleError(record)
