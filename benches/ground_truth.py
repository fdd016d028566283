"""Detection against the exact ground truth: what is missed, what is false, and the memory it takes.

Usage: ``python benches/ground_truth.py``. Needs the data at ``$CLOTHSIM_DATA`` or ``../shared/data``. Prints, per
scene and for the single queries, the true pairs that are missed and the reported pairs that are not true, and at the
end the largest resident memory of the whole process.
"""

from __future__ import annotations

import os
import resource
from pathlib import Path

import numpy as np

import clothsim as cs

DATA = Path(os.environ.get("CLOTHSIM_DATA", Path(__file__).parents[2] / "shared" / "data")) / "ccd"
SCENES = ["cloth-ball", "cloth-funnel", "n-body-simulation"]


def edge_pairs(rows: np.ndarray) -> set[tuple[int, ...]]:
    """Pairs of edges, each pair the same whatever the order of its edges and of their ends."""
    pairs = np.sort(rows.reshape(-1, 2, 2), axis=2)
    return {tuple(sum(sorted(map(tuple, pair.tolist())), ())) for pair in pairs}


def main() -> None:
    """Print one line per scene and kind of query."""
    for name in SCENES:
        z = np.load(DATA / f"{name}.npz")
        d = cs.collision.detect(z["V0"], z["V1"], z["F"])
        true, found = set(map(tuple, z["vf"][z["vf_true"]].tolist())), set(map(tuple, d.vertex_triangle.tolist()))
        print(f"{name} vertex-triangle: {len(true)} true, {len(true - found)} missed, {len(found - true)} not true")
        true, found = edge_pairs(z["ee"][z["ee_true"]]), edge_pairs(d.edge_edge)
        print(f"{name} edge-edge: {len(true)} true, {len(true - found)} missed, {len(found - true)} not true")
    q = np.load(DATA / "queries.npz")
    for kind, ccd in [("vf", cs.collision.vertex_triangle_ccd), ("ee", cs.collision.edge_edge_ccd)]:
        hit, true = ccd(q[kind])[0], q[f"{kind}_true"]
        print(f"queries {kind}: {true.sum()} true, {(true & ~hit).sum()} missed, {(hit & ~true).sum()} not true")
    print(f"largest resident memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
