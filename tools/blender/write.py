"""Write what `check.py` reads in Blender: a recording in all formats, and a skinned character with what we make of it.

Run by ``make blender``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import clothsim as cs

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python" / "tests"))


def main(folder: Path) -> None:
    """Fill the folder."""
    from test_animated_files import skinned

    folder.mkdir(parents=True, exist_ok=True)
    scene = cs.Scene(name="blender", duration=0.5, contact={"thickness": 0.01}, time={"dt": 0.01})
    hem = {"vertices": list(range(3 * 13)), "material": "denim"}
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 13, 13), "cotton", name="napkin", position=(0.05, 0.5, 0.0), regions=[hem])
    scene.add_collider(
        "ball",
        shape={"type": "sphere", "radius": 0.3, "tolerance": 0.005},
        keyframes=[{"time": 0.0, "position": [0, 0, 0]}, {"time": 0.5, "position": [0, 0.2, 0.1]}],
    )
    scene.add_collider("floor", shape={"type": "plane", "half_size": 2.0}, position=(0, -0.5, 0))
    frames = cs.record(cs.Simulation(scene), fps=24, progress=False)
    frames.save_usd(folder / "scene.usdc")
    frames.save_gltf(folder / "scene.glb")
    from clothsim._export import pc2

    pc2.write(frames, folder / "pc2", overwrite=True)
    # A key in every frame: between keys glTF turns at a steady rate, and Blender does not.
    skinned(keys=25).save(folder / "body.glb")
    body = cs.Animation.load(folder / "body.glb", fps=24)
    expected = {f"{b.name}": np.stack([frames.positions(b, f) for f in range(len(frames))]) for b in frames.bodies}
    np.savez(folder / "expected.npz", **expected, body=body.positions, hem=frames.body("napkin").regions["denim"])
    print(f"{folder}: {len(frames)} frames")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
