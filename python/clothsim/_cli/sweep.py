"""``clothsim sweep``."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from pathlib import Path
from typing import Any

from clothsim._cli.arguments import add_existing, count, folder, written
from clothsim._cli.study import fixed_values, interruptible
from clothsim._nearest import brief

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "sweep"
HELP = "Run an ensemble: scenes over parameters and seeds, on this machine's cores or a Dask cluster; Parquet tables."
EXAMPLE = "clothsim sweep examples/sweep.toml -o out/sweep"
_LISTED = 40  # runs of a dry run that are shown
_MOST_OF_A_LINE = 1000  # characters: values may be of any length


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The sweep, where it runs, and what is done with what is there."""
    parser.add_argument("sweep", metavar="SWEEP", help="sweep file (TOML)")
    parser.add_argument("-o", "--out", metavar="OUT", type=folder, help="output folder")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], dest="fixed", help="a value for all runs"
    )
    parser.add_argument(
        "--processes", metavar="N", type=count, help="runs side by side on this machine (default: one per core)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on the Dask cluster with this scheduler, such as tcp://host:8786"
    )
    parser.add_argument("--dry-run", action="store_true", help="list the runs and what cannot be run; run nothing")
    add_existing(parser, "sweep")


def execute(options: argparse.Namespace) -> int:
    """Run the sweep and say what came of it; 1 if every run failed."""
    from clothsim.errors import InvalidInput
    from clothsim.sweep import job
    from clothsim.sweep.file import read

    asked = read(options.sweep, fixed_values(options.fixed))
    request = asked.request
    if options.dry_run:
        print(json.dumps(_listing(request)) if options.json else _text(request))
        return 0
    if options.out is None:
        raise InvalidInput("-o: expected an output folder, got nothing; --dry-run needs none", name="OUT")
    bad = [run for run in request.runs if run.error is not None]
    if bad and not (options.quiet or options.json):
        print(
            f"warning: {len(bad)} of {len(request.runs)} runs cannot be made; run {bad[0].number}: {bad[0].error}",
            file=sys.stderr,
        )
    interruptible()
    again = _command(options)
    settings = job.Options(
        processes=options.processes, scheduler=options.scheduler, retries=asked.retries, resume=options.resume,
        overwrite=options.overwrite, progress=not (options.quiet or options.json), command=again,
    )  # fmt: skip
    try:
        done = job.run(request, options.out, settings)
    except KeyboardInterrupt:
        print(f"clothsim: interrupted; to go on:\n  {again} --resume", file=sys.stderr)
        return 130
    facts = done if isinstance(done, dict) else done.facts
    if isinstance(done, dict):
        facts = {**done, "resumed": "complete already"}
    print(json.dumps({"out": str(options.out), **facts}) if options.json else _summary(facts, options.out))
    return 1 if not facts["counts"].get("ok") else 0


def _command(options: argparse.Namespace) -> str:
    words = ["clothsim", "sweep", options.sweep]
    words += [word for text in options.fixed for word in ("--set", text)]
    words += ["--scheduler", options.scheduler] if options.scheduler else []
    return shlex.join([*words, "-o", str(options.out)])


def _listing(request: Any) -> dict[str, Any]:
    names = list(request.scenes)
    runs = [
        {"run": r.number, "scene": names[r.scene], "seed": r.seed, "settings": r.settings, "error": r.error}
        for r in request.runs
    ]
    return {**request.facts(), "runs": runs}


def _text(request: Any) -> str:
    from clothsim.study.points import label

    names = list(request.scenes)
    bad = sum(run.error is not None for run in request.runs)
    lines = [f"{request.name}: {len(request.runs)} runs" + (f", {bad} of which cannot be made" if bad else "")]
    width = len(str(len(request.runs)))
    for run in request.runs[:_LISTED]:
        parts = [names[run.scene], label(run.settings), "" if run.seed is None else f"seed {run.seed}"]
        error = f": {run.error}" if run.error else ""
        lines.append(brief(f"  {run.number:>{width}}  {', '.join(p for p in parts if p)}{error}", _MOST_OF_A_LINE))
    if len(request.runs) > _LISTED:
        lines.append(f"  … and {len(request.runs) - _LISTED} more (--json lists all)")
    return "\n".join(lines)


def _summary(facts: dict[str, Any], out: Path) -> str:
    words = ", ".join(f"{n} {word}" for word, n in facts["counts"].items())
    lines = [f"{facts['name']}: {facts['runs']} runs in {facts['seconds']:.1f} s: {words}"]
    if "resumed" in facts:
        lines[0] += " (complete already: nothing to do)"
    if facts.get("started_again"):
        lines.append(f"  runs started again after their worker was lost: {facts['started_again']}")
    return "\n".join([*lines, *written(out, facts["files"])])
