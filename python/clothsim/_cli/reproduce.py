"""``clothsim reproduce``."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
from pathlib import Path

from clothsim._cli.arguments import folder
from clothsim._device import check_threads
from clothsim.errors import InvalidInput
from clothsim.reproduce import CATALOGUE, Effort, Outcome, find, reproduce

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "reproduce"
HELP = "Measure a figure or table of the papers again: CSV, PNG and a line that compares. --list names them all."
EXAMPLE = "clothsim reproduce 4.7 -o out/figure-4.7"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The figure, output folder, and how to run."""
    parser.add_argument("figure", metavar="FIGURE", nargs="?", help="4.7, table-4.1, 2010-7, … (see --list)")
    parser.add_argument("-o", "--out", metavar="OUT", type=folder, help="output folder")
    parser.add_argument("--list", action="store_true", help="list every figure and table of both papers with its state")
    parser.add_argument("--quick", action="store_true", help="a coarse variant of the same experiment, in seconds")
    parser.add_argument("--mesh", metavar="FILE", type=Path, help="a mesh of your own, for figure 4.9")
    parser.add_argument("--overwrite", action="store_true", help="replace the figure if OUT holds it")
    parser.add_argument("--threads", metavar="N", type=int, help="how many threads (default: all)")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress and no warnings on stderr")


def execute(options: argparse.Namespace) -> int:
    """List, or reproduce one; 1 if a check against a closed form or a finding failed."""
    if options.list:
        print(json.dumps([entry.facts() for entry in CATALOGUE]) if options.json else _listing())
        return 0
    if options.figure is None:
        raise InvalidInput("FIGURE: expected a name that clothsim reproduce --list names, got nothing", name="FIGURE")
    entry = find(options.figure)
    entry.load()
    if options.out is None:
        raise InvalidInput(f"-o: expected an output folder, got nothing: {entry.command}", name="OUT")
    threads = check_threads(options.threads)
    effort = Effort(
        quick=options.quick,
        mesh=options.mesh,
        progress=not (options.quiet or options.json),
        **({} if threads is None else {"threads": threads}),
    )
    with contextlib.suppress(ValueError):  # not the main thread: signals go elsewhere
        # Both leave nothing behind; Ctrl-C also where the shell has started this in the background, ignoring it.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    outcome = reproduce(entry.name, options.out, effort, overwrite=options.overwrite)
    print(json.dumps(outcome.facts()) if options.json else _text(outcome))
    return 0 if outcome.passed else 1


def _text(outcome: Outcome) -> str:
    lines = [outcome.line]
    for check in outcome.checks:
        verdict = "agrees" if check.passed else "DIFFERS"
        lines.append(
            f"  {verdict}: {check.what} {check.here:.6g}, expected {check.expected:.6g} ± {check.tolerance:.2g}"
        )
    lines += [f"  {path}" for path in outcome.files]
    return "\n".join([*lines, f"  {outcome.seconds:.1f} s"])


def _listing() -> str:
    lines: list[str] = []
    paper = ""
    wide = max(len(entry.name) for entry in CATALOGUE) + 2
    state = max(len(entry.state) for entry in CATALOGUE) + 2
    for entry in CATALOGUE:
        if entry.paper != paper:
            paper = entry.paper
            lines += ["", paper] if lines else [paper]
        lines.append(f"  {entry.name:<{wide}}{entry.state:<{state}}{entry.title}")
        if entry.command:
            lines.append(f"  {'':<{wide + state}}{entry.command}")
    counts: dict[str, int] = {}
    for entry in CATALOGUE:
        counts[entry.state] = counts.get(entry.state, 0) + 1
    return "\n".join([*lines, "", ", ".join(f"{count} {state}" for state, count in counts.items())])
