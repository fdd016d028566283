"""The command line: ``clothsim COMMAND``. One module per command."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from clothsim._cli import (
    completion,
    doctor,
    example,
    export,
    materials,
    plan,
    reproduce,
    run,
    schema,
    stability,
    study,
    sweep,
    tune,
    view,
)
from clothsim._cli.logs import add_verbose, shown_logs
from clothsim._core import __version__
from clothsim.errors import ClothSimError, GpuUnavailable, MissingDependency, OutputError, OutputExists

__all__ = ["build_parser", "main"]

_COMMANDS = (
    run,
    plan,
    example,
    view,
    export,
    study,
    tune,
    sweep,
    stability,
    reproduce,
    materials,
    doctor,
    schema,
    completion,
)

# Exit codes: what was asked for cannot be done / what was asked for is wrong.
_FAILED, _BAD_INPUT = 1, 2


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(_BAD_INPUT, f"clothsim: {message}\n{self.format_usage().rstrip()}; --help says more\n")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = _Parser(
        prog="clothsim",
        description="Cloth simulation: a scene file in; frames, pictures and a report out.",
        epilog="example: clothsim run examples/drape.toml -o out/drape",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"clothsim {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)
    for command in _COMMANDS:
        sub = commands.add_parser(
            command.NAME,
            help=command.HELP,
            description=command.HELP,
            epilog=f"example: {command.EXAMPLE}",
            allow_abbrev=False,
        )
        command.add_arguments(sub)
        sub.add_argument("--json", action="store_true", help="print one JSON object on stdout instead of text")
        add_verbose(sub)
        sub.set_defaults(execute=command.execute)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0, 1 if it failed, 2 for bad input, 130 after Ctrl-C."""
    options = build_parser().parse_args(arguments)
    try:
        with shown_logs(options.verbose, quiet=getattr(options, "quiet", False)):
            code: int = options.execute(options)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("clothsim: interrupted", file=sys.stderr)
        return 130
    except (ClothSimError, OSError, MemoryError) as error:
        return _report(error, as_json=options.json)
    return code


def _report(error: Exception, *, as_json: bool) -> int:
    """One message, no traceback."""
    bad_input = isinstance(error, (ValueError, GpuUnavailable, MissingDependency, OutputExists))
    message = error.strerror if isinstance(error, OutputError) and error.strerror else str(error)
    message = message or type(error).__name__
    if as_json:
        facts: dict[str, Any] = {"type": type(error).__name__, "message": message}
        facts.update({k: v for k, v in vars(error).items() if not k.startswith("_")})
        print(json.dumps({"error": facts}))
    print(f"clothsim: {message}", file=sys.stderr)
    return _BAD_INPUT if bad_input else _FAILED
