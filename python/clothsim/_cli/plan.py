"""``clothsim plan``."""

from __future__ import annotations

import argparse
import json

from clothsim._cli.device import add_device
from clothsim.errors import IntersectingStart
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "plan"
HELP = "Say which effects a scene runs and why, and what they take, without running it."
EXAMPLE = "clothsim plan examples/drape.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene."""
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
    add_device(parser)


def execute(options: argparse.Namespace) -> int:
    """Print the plan."""
    scene = Scene.load(options.scene)
    warning = ""
    try:
        plan = Simulation(scene, device=options.device).plan
    except IntersectingStart as error:
        plan = Simulation(scene, device=options.device, allow_intersections=True).plan
        warning = str(error)
        plan["warnings"] = [*plan["warnings"], warning]
    print(json.dumps(plan) if options.json else str(plan).rstrip())
    if warning and not options.json:
        print(f"warning: {warning}")
    return 0
