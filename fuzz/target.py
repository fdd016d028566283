"""What a target of fuzzing is, and what all of them ask of an answer."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from hypothesis.strategies import SearchStrategy

from clothsim.errors import ClothSimError

__all__ = ["File", "Target", "dump_json", "load_json", "refused"]

# No message is longer: it goes to a terminal.
_MOST_MESSAGE = 2000


@dataclass(frozen=True)
class File:
    """A file, as its suffix (with the dot) and its bytes."""

    suffix: str
    content: bytes

    def __repr__(self) -> str:
        return f"File({self.suffix!r}, {self.content[:200]!r}{'…' if len(self.content) > 200 else ''})"


@dataclass(frozen=True)
class Target:
    """One thing that is fuzzed.

    Attributes
    ----------
    name, what : str
        Name on the command line, and one line about it.
    cases : SearchStrategy
        Random cases; hypothesis shrinks one that is a finding.
    check : callable
        Does what is under test with a case and raises where an answer is not what was promised.
    dump, load : callable
        A case as (suffix, bytes) for the corpus, and back.
    plant : callable
        A context in which the product has a fault that ``check`` must find.
    quick : int
        Cases in ``make test``.
    seconds : float
        Processor time that one case may take at most [s].
    """

    name: str
    what: str
    cases: SearchStrategy[Any]
    check: Callable[[Any], None]
    dump: Callable[[Any], tuple[str, bytes]]
    load: Callable[[str, bytes], Any]
    plant: Callable[[], AbstractContextManager[None]]
    quick: int
    seconds: float = 10.0


def dump_json(case: Any) -> tuple[str, bytes]:
    """A case of plain values."""
    return ".json", json.dumps(case, indent=1).encode() + b"\n"


def load_json(_suffix: str, content: bytes) -> Any:
    """Back from `dump_json`."""
    return json.loads(content)


def refused(error: ClothSimError, *names: str) -> None:
    """Hold an error against what every error must be: a message of bearable length that names what is wrong."""
    message = str(error)
    assert message.strip(), f"{type(error).__name__} without a message"
    assert len(message) <= _MOST_MESSAGE, f"{type(error).__name__} with a message of {len(message)} characters"
    for name in names:
        assert name in message, f"{type(error).__name__} does not name {name}: {message}"
