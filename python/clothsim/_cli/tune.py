"""``clothsim tune``."""

from __future__ import annotations

import argparse
import json
import sys

from clothsim._cli.arguments import add_out
from clothsim._cli.study import add_common, command, fixed_values, interruptible

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "tune"
HELP = "Find the cheapest settings that meet an error, or the most precise ones within a time; write them as a scene."
EXAMPLE = "clothsim tune examples/hanging.toml --set duration=0.2 --set resolution=9 --error 1mm -o out/tune"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, the bound, and how to run."""
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    add_out(parser)
    goal = parser.add_mutually_exclusive_group(required=True)
    goal.add_argument("--error", metavar="E", help="largest error, such as 1mm; the reference's own counts too")
    goal.add_argument("--budget", metavar="T", help="most time, such as 20ms (per frame of output.fps, or see --per)")
    parser.add_argument("--per", default="frame", help="what the budget is for: frame (default) or run")
    parser.add_argument("--metric", default="rms", help="what the error is measured in (default rms)")
    parser.add_argument(
        "--vary", metavar="AXIS=VALUES", action="append", default=[],
        help="what to choose from: integrator, dt, solver_tolerance, resolution, …; by default integrator and dt",
    )  # fmt: skip
    add_common(parser)


def execute(options: argparse.Namespace) -> int:
    """Search, write what was found, and say it; 1 if nothing meets the bound."""
    from clothsim.scene import Scene
    from clothsim.study import quantities, tune
    from clothsim.study.axes import parse
    from clothsim.study.metrics import metrics as look_up

    interruptible()
    unit = look_up([options.metric])[0].unit
    error = None if options.error is None else quantities.parse(options.error, unit, "--error")
    budget = None if options.budget is None else quantities.parse(options.budget, "s", "--budget")
    again = command(options)
    try:
        found = tune(
            Scene.load(options.scene), error=error, budget=budget, per=options.per, metric=options.metric,
            vary=[parse(text) for text in options.vary], fixed=fixed_values(options.fixed), reference=options.reference,
            cost=options.cost, repeats=options.repeats, patience=options.patience, processes=options.processes,
            limit=options.limit, out=options.out, resume=options.resume, overwrite=options.overwrite, command=again,
            progress=not (options.quiet or options.json),
        )  # fmt: skip
    except KeyboardInterrupt:
        print(f"clothsim: interrupted; to go on:\n  {again} --resume", file=sys.stderr)
        return 130
    if options.json:
        print(json.dumps({"out": str(options.out), **found.facts()}))
    else:
        print("\n".join([found.statement, *(f"  {path}" for path in found.files)]))
    return 0 if found.met else 1
