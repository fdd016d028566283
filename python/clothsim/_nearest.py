"""What somebody may have meant who wrote a name that is not known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any

from clothsim.errors import InvalidInput

__all__ = ["hint", "one_of"]


def hint(name: object, known: Iterable[str], cutoff: float = 0.5) -> str:
    """``' (did you mean "x"?)'`` with the nearest of what is known; empty if none is as near as ``cutoff`` (0 to 1)."""
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=cutoff)
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
