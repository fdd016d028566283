"""``clothsim completion``."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from typing import Any

__all__ = ["EXAMPLE", "HELP", "NAME", "SHELLS", "add_arguments", "annotate", "execute"]

NAME = "completion"
HELP = "Print a script that completes commands, options, values and files of clothsim in a shell."
EXAMPLE = 'eval "$(clothsim completion bash)"'

SHELLS = ("bash", "zsh", "fish")

# What arguments that are shown as this take.
_DIRECTORIES = frozenset({"OUT", "FOLDER", "RUN"})
_FILES = frozenset({"FILE", "SCENE"})


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which shell."""
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=f"one of {', '.join(SHELLS)}")


def execute(options: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from clothsim._cli import build_parser

    parser = build_parser()
    annotate(parser)
    script = shtab.complete(parser, options.shell)
    print(json.dumps({"shell": options.shell, "script": script}) if options.json else script)
    return 0


def annotate(parser: argparse.ArgumentParser, command: str = "") -> None:
    """Give each argument what ``shtab`` completes it with: its ``choices``, values known here, folders or files.

    Changes the parser: it would refuse then what the commands check later, with errors that say more.
    """
    import shtab

    values = _values()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                annotate(sub, name)
        elif action.choices is None and action.nargs != 0:
            known = values.get((command, action.dest)) or values.get(("", action.dest))
            _complete(action, known, shtab)


def _complete(action: argparse.Action, known: Callable[[], Iterable[str]] | None, shtab: Any) -> None:
    if known is not None:
        action.choices = list(known())
    elif action.metavar in _DIRECTORIES:
        action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    elif action.metavar in _FILES:
        action.complete = shtab.FILE  # type: ignore[attr-defined]


def _values() -> dict[tuple[str, str], Callable[[], Iterable[str]]]:
    """Values by command (``""``: all) and argument, of arguments without ``choices``."""
    from clothsim import _core

    return {
        ("", "device"): lambda: ("auto", "cpu", "gpu"),
        ("example", "scene"): lambda: [name for name, _ in _core.example_scenes()],
        ("materials", "names"): _core.material_names,
        ("reproduce", "figure"): _figures,
        ("stability", "cases"): _cases,
        ("tune", "per"): lambda: ("frame", "run"),
        ("study", "reference"): lambda: ("auto", "closed-form", "finest"),
        ("tune", "reference"): lambda: ("auto", "closed-form", "finest"),
    }


def _figures() -> list[str]:
    from clothsim.reproduce.catalogue import CATALOGUE, REPRODUCED

    return [entry.name for entry in CATALOGUE if entry.state == REPRODUCED]


def _cases() -> list[str]:
    from clothsim.stability.catalogue import CATALOGUE

    return [case.name for case in CATALOGUE]
