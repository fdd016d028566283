"""The reader of TOML: the standard library's, or the package it came from on Python 3.10, within bounds."""

from __future__ import annotations

import re
import sys
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["loads"]

# The reader keeps every beginning of a dotted key: memory goes with the square of its parts, 7 GB for 40,000 of them.
_MOST_PARTS = 1000
_TOKEN = re.compile(r"""(?P<part>"(?:[^"\\]|\\.)*"|'[^']*'|[\w+-]+)|\.|\S""")


def loads(text: str) -> dict[str, Any]:
    """Read TOML.

    Raises
    ------
    ValueError
        It is no TOML, or a key has more than a thousand parts.
    RecursionError
        Its values are nested too deep.
    """
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") >= _MOST_PARTS and _parts(line) > _MOST_PARTS:
            raise ValueError(f"expected keys of at most {_MOST_PARTS} parts (at line {number})")
    return tomllib.loads(text)


def _parts(line: str) -> int:
    """How many names with dots between them the longest key of a line has."""
    longest = dots = 0
    after_part = False
    for token in _TOKEN.finditer(line):
        is_part = token["part"] is not None
        if not is_part and token[0] == "." and after_part:
            dots += 1
            longest = max(longest, dots)
        elif not is_part or after_part:
            dots = 0
        after_part = is_part
    return longest + 1
