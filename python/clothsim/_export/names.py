"""Names of bodies as parts of file names."""

from __future__ import annotations

__all__ = ["file_stem"]


def file_stem(name: str) -> str:
    """Keep letters, digits, ``-`` and ``_``; everything else becomes ``_``."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name) or "body"
