"""``clothsim example``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from clothsim import _core
from clothsim._files import write_whole
from clothsim._nearest import hint
from clothsim.errors import InvalidInput, OutputExists

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "example"
HELP = "List the example scenes that come with clothsim, or print one, to run it or to start from."
EXAMPLE = "clothsim example drape > drape.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which scene, and where to write it."""
    parser.add_argument("scene", metavar="NAME", nargs="?", help="which scene (default: list all)")
    parser.add_argument("-o", "--out", metavar="FILE", type=Path, help="write it to this file instead of stdout")


def execute(options: argparse.Namespace) -> int:
    """List the scenes with their first line, or print one."""
    scenes = dict(_core.example_scenes())
    if options.scene is None:
        about = {name: _about(text) for name, text in scenes.items()}
        width = max(map(len, about))
        print(json.dumps(about) if options.json else "\n".join(f"{k:<{width}}  {v}" for k, v in about.items()))
        return 0
    if options.scene not in scenes:
        expected = f"one of {', '.join(scenes)}"
        raise InvalidInput(
            f"NAME: expected {expected}, got {options.scene!r}{hint(options.scene, scenes)}",
            name="NAME",
            expected=expected,
            got=options.scene,
        )
    text = scenes[options.scene]
    if options.out is not None:
        if options.out.exists():
            raise OutputExists(f"{options.out}: is there already")
        write_whole(options.out, text.encode())
    if options.json:
        print(json.dumps({"name": options.scene, "scene": text, "out": options.out and str(options.out)}))
    elif options.out is not None:
        print(f"{options.out}: run it with  clothsim run {options.out} -o out/{options.scene}")
    else:
        print(text, end="")
    return 0


def _about(text: str) -> str:
    """The comment at the head of a scene, as one line."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return " ".join(lines).split(". ")[0].rstrip(".") + "."
