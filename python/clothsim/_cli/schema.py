"""``clothsim schema``."""

from __future__ import annotations

import argparse
import json

from clothsim import _core

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "schema"
HELP = "Print the JSON schema of scene files: every key with its unit and meaning."
EXAMPLE = "clothsim schema > scene.schema.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def execute(options: argparse.Namespace) -> int:
    """Print the schema."""
    schema = json.loads(_core.scene_schema())
    print(json.dumps(schema, indent=None if options.json else 2, ensure_ascii=False))
    return 0
