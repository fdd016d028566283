"""A napkin falls over a post: a scene made in Python, frames in NumPy, a film strip and a USD file out.

Run: python examples/napkin.py [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

import clothsim as cs


def main(out: Path, seconds: float = 1.0) -> cs.Recording:
    """Simulate, save, and return the frames."""
    scene = cs.Scene(name="napkin", duration=seconds, contact={"thickness": 0.004, "friction": 0.4})
    scene.add_cloth(cs.Mesh.grid(0.6, 0.6, 41, 41), "cotton", name="napkin", position=(0.01, 0.215, 0.02))
    scene.add_collider("post", shape={"type": "capsule", "radius": 0.08, "half_height": 0.12, "tolerance": 0.001})
    sim = cs.Simulation(scene)
    print(sim.plan)
    frames = cs.record(sim, fps=30)
    crossing = cs.collision.self_intersections(frames.positions("napkin", -1), frames.body("napkin").triangles)
    print(f"{frames}: {len(crossing)} intersections in the last frame, {sim.energy['total']:.3f} J")

    out.mkdir(parents=True, exist_ok=True)
    frames.save(out / "frames.npz")
    frames.save_usd(out / "napkin.usdc")
    frames.film_strip(out / "napkin.png")
    return frames


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/napkin"))
