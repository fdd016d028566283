"""The option ``--device``, which several commands have."""

from __future__ import annotations

import argparse

__all__ = ["add_device"]


def add_device(parser: argparse.ArgumentParser) -> None:
    """Where to detect collisions."""
    parser.add_argument(
        "--device",
        metavar="DEVICE",
        default="auto",
        help="where to detect collisions: cpu, gpu (a software adapter too) or auto (a GPU if there is one; default); "
        "results do not depend on it",
    )
