"""``clothsim run``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from clothsim._cli.arguments import add_existing, add_out, count, folder, written
from clothsim._cli.device import add_device
from clothsim._device import check_device, check_threads
from clothsim._run.job import Job, Stopped
from clothsim._run.start import Start
from clothsim.errors import InvalidInput
from clothsim.scene import Scene

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "run"
HELP = "Simulate a scene and write what its [output] asks for: frames, USD, pictures, plots, a report."
EXAMPLE = "clothsim run examples/drape.toml -o out/drape --threads 2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Scene, output folder, and how to run."""
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    add_out(parser)
    parser.add_argument(
        "--threads", metavar="N", type=count, help="how many threads (default: all); results do not depend on it"
    )
    add_device(parser)
    parser.add_argument("--frames", metavar="N", type=count, help="stop after N frames (default: the whole duration)")
    parser.add_argument(
        "--allow-intersections",
        action="store_true",
        help="run from a start state in which triangles pass through others",
    )
    parser.add_argument(
        "--from",
        dest="run",
        metavar="RUN",
        type=folder,
        help="begin at a frame of this run, also with an edited scene: with its full state where the run has kept "
        "states (output.states), and to the same bits if nothing is edited; else with positions and velocities; or at "
        "a .state or .checkpoint, or a frame of a frames.npz",
    )
    parser.add_argument(
        "--frame", metavar="N", type=int, help="number of that frame (default: the last one; -2: the one before)"
    )
    parser.add_argument(
        "--no-state", action="store_true", help="positions and velocities alone, though the run has kept states"
    )
    add_existing(parser, "run")


def execute(options: argparse.Namespace) -> int:
    """Run the job and say what came of it."""
    check_device(options.device)
    scene = Scene.load(options.scene)
    start = None
    if options.run is not None:
        start = Start.of_run(options.run, scene, options.frame, state=not options.no_state)
    for name, given in (("--frame", options.frame is not None), ("--no-state", options.no_state)):
        if given and options.run is None:
            raise InvalidInput(f"{name}: expected --from RUN with it, got {name} alone", name=name)
    job = Job(
        scene,
        options.out,
        threads=check_threads(options.threads),
        device=options.device,
        frames=options.frames,
        allow_intersections=options.allow_intersections,
        resume=options.resume,
        overwrite=options.overwrite,
        progress=not (options.quiet or options.json),
        start=start,
    )
    try:
        report = job.run()
    except Stopped as stop:
        device = "" if options.device == "auto" else f" --device {options.device}"
        begin = "" if options.run is None else f" --from {options.run}"
        begin += "" if options.frame is None else f" --frame {options.frame}"
        begin += " --no-state" if options.no_state else ""
        again = f"clothsim run {options.scene} -o {options.out}{begin}{device} --resume"
        if options.json:
            print(json.dumps({"stopped": str(stop), "frames": stop.frames, "of": stop.total, "resume": again}))
        print(
            f"clothsim: {stop} at {stop.seconds:.3f} s, {stop.frames} of {stop.total} frames; to go on:\n  {again}",
            file=sys.stderr,
        )
        return 128 + stop.signum
    if options.json:
        print(json.dumps({"out": str(options.out), **report}))
    else:
        print(_summary(report, options.out))
    return 0


def _summary(report: dict[str, Any], out: Path) -> str:
    simulated, wall = report["simulated_seconds"], report["wall_seconds"]
    lines = [f"{report['scene']}: {report['frame_count']} frames, {simulated:g} s simulated in {wall:.1f} s"]
    if "resumed" in report:
        lines[0] += " (complete already: nothing to do)"
    if report["max_intersections"] is not None:
        lines.append(f"  intersecting pairs of triangles at most: {report['max_intersections']}")
    if report["totals"]["not_converged"]:
        lines.append(f"  steps that met a cap before their tolerance: {report['totals']['not_converged']}")
    return "\n".join([*lines, *written(out, report["outputs"])])
