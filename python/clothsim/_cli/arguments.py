"""Arguments that several commands have, and what their values may be."""

from __future__ import annotations

import argparse
from pathlib import Path

__all__ = ["add_existing", "add_out", "count", "folder"]


def add_out(parser: argparse.ArgumentParser) -> None:
    """The output folder, which there has to be."""
    parser.add_argument("-o", "--out", metavar="OUT", required=True, type=folder, help="output folder")


def add_existing(parser: argparse.ArgumentParser, what: str) -> None:
    """What to do with what the output folder holds already, and whether to show progress."""
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--resume", action="store_true", help=f"go on with an unfinished {what} in OUT, or start one")
    mode.add_argument("--overwrite", action="store_true", help=f"replace the {what} that OUT holds")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress and no warnings on stderr")


def folder(text: str) -> Path:
    """A path that is not blank."""
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a folder, got {text!r}")
    return Path(text)


def count(text: str) -> int:
    """A whole number ≥ 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number ≥ 1, got {text!r}")
    return value
