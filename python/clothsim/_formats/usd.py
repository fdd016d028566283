"""USD files, read by a process of its own: over a damaged one usd-core may die, and would take its caller along."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from clothsim._arrays import demand
from clothsim._formats import RawMesh
from clothsim._formats.animation import RawAnimation, Request
from clothsim.errors import MeshError

__all__ = ["load", "load_still"]


def load_still(path: Path) -> RawMesh:
    """All meshes at the first time code, in metres and the stage's own axes."""
    raw = load(path, Request(), most_frames=1)
    return RawMesh(raw.positions[0], raw.triangles, None)


def load(path: Path, request: Request, *, most_frames: int | None = None) -> RawAnimation:
    """What `clothsim._formats.usd_stage.load` reads.

    Raises
    ------
    MeshError
        As it does, and for a file over which usd-core dies.
    MissingDependency
        usd-core is not installed.
    """
    demand("pxr", extra="usd", purpose="reading USD")
    asked = json.dumps(asdict(request) | {"most_frames": most_frames})
    with tempfile.TemporaryDirectory(prefix="clothsim-usd-") as room:
        command = [sys.executable, "-m", "clothsim._formats.usd_stage", str(path), asked, room]
        paths = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        done = subprocess.run(
            command,
            env=os.environ | {"PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            check=False,
        )
        said = Path(room) / "answer.json"
        if done.returncode or not said.is_file():
            last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
            reason = f"usd-core died of signal {-done.returncode}" if done.returncode < 0 else last[:200]
            raise MeshError(f"{path}: not a USD file that can be read: {reason}", kind="file")
        answer = json.loads(said.read_text())
        if "error" in answer:
            raise MeshError(answer["error"], kind=answer["kind"])
        positions, triangles = (np.load(Path(room) / f"{name}.npy") for name in ("positions", "triangles"))
        return RawAnimation(positions, triangles, answer["fps"], answer["up"])
