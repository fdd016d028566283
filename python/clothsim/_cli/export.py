"""``clothsim export``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from clothsim._export.writers import FORMATS, write
from clothsim._files import output_error
from clothsim._run.start import load_run

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "export"
HELP = "Write the frames of a finished run in other formats: USD, glTF, PC2, VTK, OBJ or PLY sequences."
EXAMPLE = "clothsim export out/drape --format gltf --format vtk"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The run, the formats, and where to write."""
    parser.add_argument("run", metavar="OUT", type=Path, help="folder of a run (or its frames.npz)")
    parser.add_argument(
        "-f", "--format", dest="formats", metavar="FORMAT", required=True, action="append", choices=sorted(FORMATS),
        help=f"one of {', '.join(sorted(FORMATS))}; may be given several times",
    )  # fmt: skip
    parser.add_argument("--to", metavar="FOLDER", type=Path, help="where to write (default: OUT)")
    parser.add_argument("--overwrite", action="store_true", help="replace files of the same name")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress and no warnings on stderr")


def execute(options: argparse.Namespace) -> int:
    """Write each format, and say where."""
    recording = load_run(options.run)
    folder = options.to or (options.run if options.run.is_dir() else options.run.parent)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise output_error(folder, error) from error
    written: list[Path] = []
    for name in dict.fromkeys(options.formats):
        if not (options.quiet or options.json):
            print(f"writing {FORMATS[name].file}", file=sys.stderr)
        written.append(write(recording, folder, name, overwrite=options.overwrite))
    if options.json:
        print(json.dumps({"frames": len(recording), "written": [str(path) for path in written]}))
    else:
        print("\n".join(str(path) for path in written))
    return 0
