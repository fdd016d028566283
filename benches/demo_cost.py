"""What the demo's first two seconds cost, and whether they are right.

Usage: ``python benches/demo_cost.py [--repeats N]``. Runs ``examples/drape.toml`` from 0 to 2 s without output and
prints the CPU seconds of the whole process during the run (user + system, all threads), the number of intersecting
triangle pairs
over all frames, and the deepest point of the cloth below the true sphere.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
from pathlib import Path

import numpy as np

import clothsim as cs

SCENE = Path(__file__).parents[1] / "examples" / "drape.toml"
SECONDS = 2.0
RADIUS = 0.5  # of the ball in the scene [m]
FPS = 60


def run() -> tuple[float, float, int, float]:
    """Run once: CPU seconds, wall seconds, intersecting pairs over all frames, deepest penetration [m]."""
    sim = cs.Simulation(cs.Scene.load(SCENE), threads=2)
    triangles = sim.bodies[0].triangles
    cpu = wall = 0.0
    pairs, deepest = 0, 0.0
    for _ in range(round(SECONDS * FPS)):
        c, w = time.process_time(), time.perf_counter()
        sim.advance(1.0 / FPS)
        cpu += time.process_time() - c
        wall += time.perf_counter() - w
        x = sim.positions
        pairs += len(cs.collision.self_intersections(x, triangles))
        # Inside a triangle the cloth is nearest to the centre at its centroid, or at an edge's middle.
        corners = x[triangles]
        points = np.concatenate([x, corners.mean(axis=1), 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)])
        deepest = max(deepest, RADIUS - float(np.linalg.norm(points, axis=1).min()))
    return cpu, wall, pairs, deepest


def main() -> None:
    """Print one line per repeat and the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    repeats = parser.parse_args().repeats
    machine = f"{platform.machine()}, {os.cpu_count()} CPUs"
    print(f"clothsim {cs.__version__}, {machine}, threads=2, first {SECONDS} s of {SCENE.name}")
    results = []
    for _ in range(repeats):
        results.append(run())
        cpu, wall, pairs, deepest = results[-1]
        print(
            f"CPU {cpu:.1f} s, wall {wall:.1f} s, intersecting pairs over all frames {pairs}, "
            f"deepest point below the sphere {1e3 * deepest:.3f} mm"
        )
    cpus = [r[0] for r in results]
    print(f"median CPU {statistics.median(cpus):.1f} s (from {min(cpus):.1f} to {max(cpus):.1f} s)")


if __name__ == "__main__":
    main()
