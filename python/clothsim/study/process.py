"""What every run in a process of its own does around its work: cores, the parent's end, and its result as files."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._files import whole, write_whole
from clothsim.errors import ClothSimError, OutputError

__all__ = ["UNWRITTEN", "die_with_parent", "serve"]

# Exit code of a process whose result could not be written (EX_IOERR of sysexits.h).
UNWRITTEN = 74


def serve(path: Path, run: Callable[[dict[str, Any]], tuple[dict[str, Any], Mapping[str, Any]]]) -> int:
    """Run the job in a file; write ``<stem>.npz``, if there are arrays, and then ``<stem>.result``, each whole.

    Parameters
    ----------
    path : Path
        JSON of the job, with the ``cores`` it may use.
    run : callable
        Takes the job, returns facts for JSON and arrays by name.
    """
    die_with_parent()
    job = json.loads(path.read_bytes())
    if job["cores"] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, job["cores"])
    try:
        facts, arrays = run(job)
        if arrays:
            with whole(path.with_suffix(".npz")) as file:
                np.savez(file, **arrays)
    except OutputError as error:
        return _unwritten(error)
    except (ClothSimError, MemoryError) as error:
        facts = {"error": str(error) or type(error).__name__, "error_type": type(error).__name__}
    try:
        write_whole(path.with_suffix(".result"), json.dumps(facts).encode())
    except OutputError as error:
        return _unwritten(error)
    return 0


def _unwritten(error: OutputError) -> int:
    """Say why there is no result: nothing is wrong with the run, and it can be made again."""
    with contextlib.suppress(OSError):
        sys.stderr.write(f"{error.strerror}\n")
    return UNWRITTEN


def die_with_parent() -> None:
    """End when the parent does, however it ends: its end of the pipe closes."""

    def watch() -> None:
        while os.read(0, 4096):  # not through sys.stdin, whose lock would outlive the interpreter
            pass
        os._exit(3)

    threading.Thread(target=watch, daemon=True).start()
