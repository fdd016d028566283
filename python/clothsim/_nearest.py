"""What a message says of what came: the nearest of what is known, and no more of it than can be read."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any

from clothsim.errors import InvalidInput

__all__ = ["brief", "hint", "one_of"]

_MOST = 1000  # characters of a message
_MOST_COMPARED = 100  # characters of a name that is looked for: the search takes their square


def brief(text: str, most: int = _MOST) -> str:
    """Cut the middle out of a text that nobody would read to its end."""
    return text if len(text) <= most else f"{text[: most // 2]} … {text[-(most // 2) :]}"


def hint(name: object, known: Iterable[str], cutoff: float = 0.5) -> str:
    """``' (did you mean "x"?)'`` with the nearest of what is known; empty if none is as near as ``cutoff`` (0 to 1)."""
    near = difflib.get_close_matches(str(name)[:_MOST_COMPARED], list(known), n=1, cutoff=cutoff)
    return f' (did you mean "{near[0]}"?)' if near else ""


def one_of(name: str, value: Any, known: Sequence[str], text: str | None = None) -> str:
    """Refuse a value of the parameter ``name`` that is not known; ``text`` is how the message writes it.

    Raises
    ------
    InvalidInput
        Names what is known, and the nearest.
    """
    if value in known:
        return str(value)
    expected, got = f"one of {', '.join(known)}", str(value) if text is None else text
    raise InvalidInput(f'{name}: expected {expected}, got "{got}"{hint(value, known)}', name=name, expected=expected)
