"""Names of bodies as parts of file names."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["file_stem", "frame_name", "unique_stems"]


def file_stem(name: str) -> str:
    """Keep letters, digits, ``-`` and ``_``; everything else becomes ``_``."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name) or "body"


def unique_stems(names: Iterable[str]) -> list[str]:
    """A stem for each name, no two alike in letters of either case: the later of two gets a number."""
    stems: list[str] = []
    for name in names:
        stem, number = file_stem(name), 1
        while stem.casefold() in (other.casefold() for other in stems):
            number += 1
            stem = f"{file_stem(name)}-{number}"
        stems.append(stem)
    return stems


def frame_name(stem: str, frame: int, count: int) -> str:
    """``<stem>_0007``: as many digits for each of ``count`` frames, four at least."""
    return f"{stem}_{frame:0{max(4, len(str(count - 1)))}d}"
