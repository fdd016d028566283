"""``clothsim study``."""

from __future__ import annotations

import argparse
import json
import shlex
import signal
import sys
from contextlib import suppress
from typing import Any

from clothsim._cli.arguments import add_existing, add_out, count

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "study"
HELP = "Measure what accuracy costs: run a scene over combinations of settings; tables and work-precision plots."
EXAMPLE = (
    "clothsim study examples/hanging.toml --set duration=0.2 --set resolution=9 --vary integrator=rk4,midpoint "
    "--vary dt=4e-4,2e-4,1e-4 -o out/study"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, what to vary and measure, and how to run."""
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    add_out(parser)
    parser.add_argument(
        "--vary", metavar="AXIS=VALUES", action="append", default=[],
        help="values of an axis, by commas, or first:last:count (geometric); an axis is one of dt, integrator, "
        "resolution, solver, solver_tolerance, bending, hinges, fabric, friction, detector, precision, … or any key of "
        "the scene",
    )  # fmt: skip
    parser.add_argument(
        "--metric", metavar="NAMES", action="append", default=[],
        help="what to measure: rms (default), max, shape, energy_drift, momentum_drift, spin_drift, contact_error, "
        "stick_drift, drape, lowest, strain_energy, kinetic_energy; the front is about the first",
    )  # fmt: skip
    add_common(parser)
    parser.add_argument("--sample", metavar="N", type=count, help="run a seeded sample of N combinations")
    parser.add_argument(
        "--seeds", metavar="N", type=count, default=1, help="disturbed starts per point, for scenes that buckle"
    )
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="first seed, and that of --sample (default 0)")
    parser.add_argument(
        "--disturbance", metavar="V", type=float, default=1e-3, help="velocity of the disturbance [m/s] (default 1e-3)"
    )


def add_common(parser: argparse.ArgumentParser) -> None:
    """Arguments that study and tune share."""
    parser.add_argument(
        "--set", metavar="AXIS=VALUE", action="append", default=[], dest="fixed", help="a value for all runs"
    )
    parser.add_argument(
        "--reference", default="auto", help="auto (default), closed-form, or finest: what errors are measured against"
    )
    parser.add_argument(
        "--cost",
        default="seconds",
        help="what is weighed against the error: seconds (default), cpu_seconds, peak_bytes, …",
    )
    parser.add_argument("--repeats", metavar="N", type=count, default=3, help="timed runs of each point (default 3)")
    parser.add_argument(
        "--patience", metavar="S", type=float, default=60.0, help="repeat a point only for so long [s] (default 60)"
    )
    parser.add_argument("--processes", metavar="N", type=count, help="runs side by side (default: one per core)")
    parser.add_argument(
        "--limit",
        metavar="S",
        type=float,
        help="stop a run, its repeats included, after so many seconds; its point is kept",
    )
    add_existing(parser, "study")


def interruptible() -> None:
    """Let Ctrl-C and termination end a study in order, its runs first."""
    with suppress(ValueError):  # not the main thread: signals go elsewhere
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.default_int_handler)


def command(options: argparse.Namespace, *more: str) -> str:
    """The command line that does the same again."""
    words = ["clothsim", options.command, options.scene]
    asked = {"--set": options.fixed, "--vary": options.vary, "--metric": options.metric}
    for name, texts in asked.items():
        for text in [texts] if isinstance(texts, str) else texts:
            words += [name, text]
    defaults = {
        "reference": "auto", "cost": "seconds", "sample": None, "seeds": 1, "seed": 0, "disturbance": 1e-3,
        "repeats": 3, "patience": 60.0, "limit": None, "error": None, "budget": None, "per": "frame",
    }  # fmt: skip
    for name, usual in defaults.items():
        value = getattr(options, name, usual)
        if value != usual:
            words += [f"--{name}", str(value)]
    return shlex.join([*words, "-o", str(options.out), *more])


def fixed_values(texts: list[str]) -> dict[str, Any]:
    """Values by axis, one each."""
    from clothsim.errors import InvalidInput
    from clothsim.study.axes import parse

    out = {}
    for text in texts:
        only = parse(text)
        if len(only.values) != 1:
            raise InvalidInput(f"--set: expected one value, got {text}; --vary takes several", name="set")
        out[only.name] = only.values[0]
    return out


def execute(options: argparse.Namespace) -> int:
    """Run the study and say what came of it; 1 if there is no reference to trust."""
    from clothsim.scene import Scene
    from clothsim.study import job, tables
    from clothsim.study.axes import parse

    interruptible()
    names = [name.strip() for text in options.metric for name in text.split(",") if name.strip()]
    request = job.Request(
        Scene.load(options.scene), [parse(text) for text in options.vary], names or None,
        fixed=fixed_values(options.fixed), reference=options.reference, cost=options.cost, sample=options.sample,
        seeds=options.seeds, seed=options.seed, disturbance=options.disturbance, repeats=options.repeats,
        patience=options.patience,
    )  # fmt: skip
    again = command(options)
    try:
        done = job.run(
            request, options.out, resume=options.resume, overwrite=options.overwrite, processes=options.processes,
            limit=options.limit, progress=not (options.quiet or options.json), command=again,
        )  # fmt: skip
    except KeyboardInterrupt:
        print(f"clothsim: interrupted; to go on:\n  {again} --resume", file=sys.stderr)
        return 130
    if isinstance(done, dict):
        text = json.dumps({**done, "resumed": "complete already"})
        print(text if options.json else f"{options.out}: complete already")
        return 0
    print(json.dumps({"out": str(options.out), **tables.facts(done)}) if options.json else tables.summary(done))
    no_reference = any(r.kind == "none" for _, r in done.references) and done.metric.needs_reference
    return 1 if no_reference or all(row.error is not None for row in done.rows) else 0
