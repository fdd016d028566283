"""Every colliding pair between two frames of the UNC benchmark scenes, against their exact ground truth.

Run: python examples/detect.py [DATA]      (DATA: the folder with ccd/*.npz; else $CLOTHSIM_DATA or ../shared/data)
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import clothsim as cs
from clothsim._data import VARIABLE, data_folder


def main(data: Path, scenes: tuple[str, ...] = ("cloth-funnel", "cloth-ball", "n-body-simulation")) -> int:
    """Print what is found; return the number of missed pairs."""
    missed = 0
    for scene in scenes:
        frames = np.load(data / "ccd" / f"{scene}.npz")
        start = time.perf_counter()
        found = cs.collision.detect(frames["V0"], frames["V1"], frames["F"])
        seconds = time.perf_counter() - start
        reported = set(map(tuple, found.vertex_triangle.tolist()))
        colliding = set(map(tuple, frames["vf"][frames["vf_true"]].tolist()))
        missed += len(colliding - reported)
        counts = f"{len(found.vertex_triangle)} vertex-triangle and {len(found.edge_edge)} edge-edge pairs"
        truth = f"{len(colliding - reported)} of {len(colliding)} truly colliding vertex-triangle pairs missed"
        print(f"{scene}: {counts} in {seconds:.2f} s; {truth}")
    return missed


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data_folder()
    if folder is None:
        sys.exit(f"no data: name its folder, or set ${VARIABLE}")
    sys.exit(1 if main(folder) else 0)
