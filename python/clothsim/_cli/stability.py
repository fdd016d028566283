"""``clothsim stability``."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from typing import Any

from clothsim._cli.arguments import add_existing, count, folder
from clothsim._cli.study import fixed_values, interruptible

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "stability"
HELP = (
    "Run hard cases over grids of two parameters and judge every cell: stable, energy grew, diverged and caught, "
    "intersected, stuck, ...; a coloured map per case."
)
EXAMPLE = "clothsim stability stretch plates --quick -o out/stability"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which cells, and how to run."""
    parser.add_argument("cases", metavar="CASE", nargs="*", help="names that --list gives (default: all)")
    parser.add_argument("-o", "--out", metavar="OUT", type=folder, help="folder for tables and maps")
    parser.add_argument("--list", action="store_true", help="list the cases with their parameters")
    parser.add_argument("--quick", action="store_true", help="a few cells of each case")
    parser.add_argument(
        "--at", metavar="NAME=VALUES", action="append", default=[],
        help="values of a parameter in place of the map's, by commas, in every case that has it: dt=1e-3,1/60",
    )  # fmt: skip
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], dest="fixed",
        help="a key of every scene, as for study: integrator=implicit-newton",
    )  # fmt: skip
    parser.add_argument("--jobs", metavar="N", type=count, help="cells side by side (default: one per core)")
    parser.add_argument("--limit", metavar="S", type=_seconds, help="seconds that a cell may take (default 60)")
    add_existing(parser, "atlas")


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a number > 0 [s], got {text!r}")
    return value


def execute(options: argparse.Namespace) -> int:
    """List, or run and say what came of it; 1 if a promise was broken."""
    from clothsim.errors import InvalidInput
    from clothsim.stability import job, outputs
    from clothsim.stability.atlas import Request, values_by_name
    from clothsim.stability.catalogue import CATALOGUE

    if options.list:
        print(json.dumps([_facts(case) for case in CATALOGUE]) if options.json else _listing(CATALOGUE))
        return 0
    if (options.resume or options.overwrite) and options.out is None:
        raise InvalidInput("-o: expected an output folder with --resume or --overwrite, got nothing", name="OUT")
    interruptible()
    request = Request(
        options.cases,
        quick=options.quick,
        at=values_by_name(options.at),
        fixed=fixed_values(options.fixed),
    )
    again = _command(options)
    try:
        done = job.run(
            request, options.out, resume=options.resume, overwrite=options.overwrite, processes=options.jobs,
            limit=options.limit or job.LIMIT, progress=not (options.quiet or options.json), command=again,
        )  # fmt: skip
    except KeyboardInterrupt:
        how = f"; to go on:\n  {again} --resume" if options.out is not None else ""
        print(f"clothsim: interrupted{how}", file=sys.stderr)
        return 130
    if isinstance(done, dict):
        print(
            json.dumps({**done, "resumed": "complete already"}) if options.json else f"{options.out}: complete already"
        )
        return 1 if done.get("broken") else 0
    print(json.dumps(done.facts()) if options.json else outputs.summary(done))
    return 1 if done.broken else 0


def _command(options: argparse.Namespace) -> str:
    words = ["clothsim", "stability", *options.cases]
    words += ["--quick"] if options.quick else []
    words += [word for text in options.at for word in ("--at", text)]
    words += [word for text in options.fixed for word in ("--set", text)]
    words += ["--limit", f"{options.limit:g}"] if options.limit else []
    words += ["-o", str(options.out)] if options.out is not None else []
    return shlex.join(words)


def _facts(case: Any) -> dict[str, Any]:
    axes = {
        key: {"name": a.name, "label": a.label, "values": list(a.values), "quick": list(a.quick)}
        for key, a in (("x", case.x), ("y", case.y))
    }
    return {"case": case.name, "title": case.title, "about": case.about, **axes}


def _listing(cases: Any) -> str:
    from clothsim.stability.atlas import value_text

    lines = []
    for case in cases:
        axes = [
            f"  {a.name} = {', '.join(value_text(v) for v in a.values)} {a.unit}".rstrip() for a in (case.x, case.y)
        ]
        lines += [f"{case.name:<18}{case.title}", *(" " * 18 + text for text in axes)]
    cells = sum(len(case.x.values) * len(case.y.values) for case in cases)
    return "\n".join([*lines, f"{len(cases)} cases, {cells} cells"])
