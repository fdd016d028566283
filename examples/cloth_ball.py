"""Simulate on from two frames of the UNC scene "cloth-ball": 92,230 triangles, tangled from the start.

The data are two successive frames of a cloth that is dragged round by a turning ball. Cloth and ball are told apart
as the two connected parts of the mesh. What the data do not say is assumed here: one unit is 0.1 m (a cloth of
2.6 m, a ball of 1 m), a frame lasts 1/30 s (so that velocity = (V1 − V0) / (1/30 s)), the cloth is at rest in the
shape of the second frame, and the ball goes on turning at its rate.

Both frames intersect already, so the scene says `allow_intersections`: the engine counts the intersecting pairs, adds
none that it can avoid, and the count per frame is printed.

Run: python examples/cloth_ball.py [--frames N] [--data DATA] [-o OUT]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import clothsim as cs
from clothsim._data import VARIABLE, data_folder

UNIT = 0.1  # m
FRAME = 1.0 / 30.0  # s

Floats = NDArray[np.float64]


def parts(vertex_count: int, triangles: NDArray[Any]) -> list[NDArray[np.bool_]]:
    """Masks of the vertices of each connected part, the largest first."""
    label = np.arange(vertex_count)
    while True:  # every vertex takes the lowest label in its triangles, and the label of that label
        lowest = label[triangles].min(axis=1)
        before = label.copy()
        for k in range(3):
            np.minimum.at(label, triangles[:, k], lowest)
        label = label[label]
        if np.array_equal(label, before):
            break
    names, sizes = np.unique(label, return_counts=True)
    return [label == name for name in names[np.argsort(-sizes)]]


def part_mesh(x: Floats, triangles: NDArray[Any], mask: NDArray[np.bool_]) -> cs.Mesh:
    """Vertices and triangles of one part."""
    number = np.cumsum(mask) - 1
    return cs.Mesh(x[mask], number[triangles[mask[triangles[:, 0]]]])


def rigid_motion(x_t0: Floats, x_t1: Floats) -> tuple[Floats, float, Floats]:
    """Axis and angle [rad] about the centre, and displacement, that best carry x_t0 to x_t1 (Kabsch)."""
    c_t0, c_t1 = x_t0.mean(axis=0), x_t1.mean(axis=0)
    u, _, vt = np.linalg.svd((x_t0 - c_t0).T @ (x_t1 - c_t1))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    r = (u @ flip @ vt).T
    turn = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    angle = float(np.arctan2(np.linalg.norm(turn), np.trace(r) - 1.0))
    axis = turn / np.linalg.norm(turn) if angle > 0.0 else np.array([0.0, 1.0, 0.0])
    return axis, angle, c_t1 - c_t0


def build(data: Path, seconds: float) -> cs.Scene:
    """The scene at the second frame, moving on as the two frames say."""
    frames = np.load(data / "ccd" / "cloth-ball.npz")
    x_t0, x_t1, triangles = UNIT * frames["V0"], UNIT * frames["V1"], frames["F"]
    cloth, ball = parts(len(x_t0), triangles)
    axis, angle, shift = rigid_motion(x_t0[ball], x_t1[ball])
    centre = x_t1[ball].mean(axis=0)
    turns = seconds / FRAME
    keyframes = [
        {"time": 0.0, "position": centre, "rotation": {"axis": axis, "angle": 0.0}},
        {"time": seconds, "position": centre + turns * shift, "rotation": {"axis": axis, "angle": turns * angle}},
    ]
    scene = cs.Scene(
        name="cloth-ball",
        duration=seconds,
        time={"dt": FRAME / 4},
        contact={"thickness": 0.001, "friction": 0.3, "allow_intersections": True},
    )
    velocities = (x_t1[cloth] - x_t0[cloth]) / FRAME
    scene.add_cloth(part_mesh(x_t1, triangles, cloth), "cotton", velocities=velocities)
    ball_mesh = part_mesh(x_t1, triangles, ball)
    scene.add_collider("ball", mesh=cs.Mesh(ball_mesh.vertices - centre, ball_mesh.triangles), keyframes=keyframes)
    return scene


def main(data: Path, frames: int = 5, out: Path | None = None) -> list[int]:
    """Simulate, print and return the number of intersecting pairs of triangles in each frame."""
    scene = build(data, frames * FRAME)
    sim = cs.Simulation(scene)
    print(f"{scene}: {len(sim.positions)} cloth vertices, {sum(len(b.triangles) for b in sim.bodies)} triangles")
    counts: list[int] = []
    for frame in sim.run(fps=1.0 / FRAME, progress=False):
        counts.append(len(sim.intersections()))
        wall = sim.report["totals"]["wall_seconds"]
        print(f"frame {frame.index}: t = {frame.time:.4f} s, {counts[-1]} intersecting pairs, {wall:.1f} s", flush=True)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            cs.Mesh(frame.positions, sim.bodies[0].triangles).save(out / f"cloth_{frame.index:04d}.ply")
    return counts


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=5, help="how many frames to simulate")
    parser.add_argument(
        "--data", type=Path, default=data_folder(), help=f"folder with ccd/*.npz (default: ${VARIABLE})"
    )
    parser.add_argument("-o", "--out", type=Path, help="folder for one PLY file per frame")
    options = parser.parse_args()
    if options.data is None:
        sys.exit(f"no data: name its folder, or set ${VARIABLE}")
    main(options.data, options.frames, options.out)
