"""What several commands have: arguments, what their values may be, and the list of what was written."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

__all__ = ["add_existing", "add_out", "count", "folder", "written"]


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


def written(out: Path, names: Iterable[str]) -> list[str]:
    """A line for each file, with its size, and folder, with its entries, of those that are there."""
    lines = []
    for path in (out / name for name in names):
        if path.is_dir():
            lines.append(f"  {path}/  {sum(1 for _ in path.iterdir())} entries")
        elif path.exists():
            size = path.stat().st_size
            lines.append(f"  {path}  {size / 1e6:.1f} MB" if size >= 1e6 else f"  {path}  {size / 1e3:.0f} kB")
    return lines
