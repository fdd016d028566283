"""Folding a towel in half with two grippers, as a Gymnasium environment: `reset(seed)`, `step(action)`.

The towel lies on a table, held by two corners of one edge. An action is the velocity of both grippers; the towel is
folded when its held half lies on the other one. Fabric, place and friction are drawn from the seed, and equal seeds and
actions give equal observations to the bit.

Run: python examples/cloth_env.py [--episodes N] [--envs N] [--picture FILE]       (pip install 'clothsim[robot,view]')
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import clothsim as cs

Floats = NDArray[np.float64]

SIDE = 0.3  # m, of the towel
COUNT = 13  # vertices along a side
HEIGHT = 0.004  # m, at which the towel starts; also the thickness of contact
PERIOD = 0.05  # s, between two actions
SPEED = 0.5  # m/s, of a gripper at an action of 1
HORIZON = 60  # actions in an episode
REACH = 0.3  # m, a gripper's displacement from its start, along the table
FOLDED = 0.005  # m, mean distance to the folded shape below which the towel counts as folded
FABRICS = ("cotton", "linen", "silk", "wool")
KEYPOINTS = np.arange(COUNT * COUNT).reshape(COUNT, COUNT)[::3, ::3].ravel()


class FoldTowel(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Fold a towel in half.

    Observation (82 numbers): displacement of both grippers from their start [m], positions of 5 × 5 points of the towel
    [m], share of the episode that is left. Action (6 numbers in [-1, 1]): velocities of both grippers in units of
    ``SPEED``. Reward: what the action took off the mean distance to the folded shape, as a share of that at the start,
    less a hundredth of the mean squared action; 1 more when the towel is folded, which ends the episode.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1.0 / PERIOD)}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self.observation_space = gym.spaces.Box(-2.0, 2.0, (6 + 3 * len(KEYPOINTS) + 1,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (6,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Lay out a towel; ``options`` may name its ``fabric``."""
        super().reset(seed=seed)
        drawn = str(self.np_random.choice(FABRICS))
        fabric = (options or {}).get("fabric", drawn)
        x, z = self.np_random.uniform(-0.05, 0.05, 2)
        friction = float(self.np_random.uniform(0.5, 0.8))
        mesh = cs.Mesh.grid(SIDE, SIDE, COUNT, COUNT)
        at = np.asarray(mesh.vertices)
        held = [np.flatnonzero((at[:, 0] > 0.45 * SIDE) & (s * at[:, 2] > 0.4 * SIDE)).tolist() for s in (-1.0, 1.0)]
        scene = cs.Scene(
            name="towel",
            duration=HORIZON * PERIOD,
            time={"dt": PERIOD / 5},
            contact={"thickness": HEIGHT, "friction": friction},
        )
        scene.add_cloth(mesh, fabric, name="towel", position=(x, HEIGHT, z), pins=[{"vertices": v} for v in held])
        scene.add_collider("table", shape={"type": "plane", "half_size": 0.5})
        self._sim = cs.Simulation(scene, threads=1, device="cpu")
        self._grippers = np.zeros((2, 3))
        self._steps = 0
        self._goal = self._sim.positions
        far = self._goal[:, 0] > x + 1e-9
        self._goal[far, 0] = 2.0 * x - self._goal[far, 0]
        self._goal[far, 1] += HEIGHT
        self._start = self._distance = self._measure()
        return self._observe(), {"fabric": fabric, "distance": self._distance}

    def step(self, action: NDArray[Any]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Move the grippers for ``PERIOD``."""
        wanted = np.clip(np.asarray(action, float), -1.0, 1.0).reshape(2, 3)
        self._grippers = reachable(self._grippers + wanted * SPEED * PERIOD, self._grippers)
        info: dict[str, Any] = {}
        failed = False
        try:
            for pin, place in enumerate(self._grippers):
                self._sim.steer("towel", pin, position=place, seconds=PERIOD)
            self._sim.advance(PERIOD)
        except cs.ClothSimError as error:  # the state is the last good one
            failed, info["error"] = True, str(error)
        self._steps += 1
        before, self._distance = self._distance, self._measure()
        info["distance"] = self._distance
        info["is_success"] = self._distance < FOLDED
        reward = (before - self._distance) / self._start - 0.01 * float(np.square(wanted).mean())
        reward += float(info["is_success"])
        return self._observe(), reward, info["is_success"] or failed, self._steps >= HORIZON, info

    def render(self) -> Any:
        """Picture of the table, (480, 640, 3) uint8, in the mode ``rgb_array``; needs PyVista (the extra ``view``)."""
        if self.render_mode is None:
            return None
        import pyvista as pv

        pv.vtk_verbosity("off")
        plotter = pv.Plotter(off_screen=True, window_size=[640, 480], lighting="three lights")
        [towel] = [body for body in self._sim.bodies if body.kind == "cloth"]
        plotter.set_background("#f4f2ee")
        surface = pv.PolyData.from_regular_faces(self._sim.positions, towel.triangles)
        normals = surface.compute_normals(split_vertices=False)
        back = pv.Property(color="#c98f6a", diffuse=0.8, ambient=0.25)
        plotter.add_mesh(normals, color="#9c2f35", smooth_shading=True, ambient=0.25, backface_params=back)
        table = pv.Plane(center=(0.0, -0.002, 0.0), direction=(0.0, 1.0, 0.0), i_size=1.0, j_size=1.0)
        plotter.add_mesh(table, color="#d9dce1", ambient=0.15, diffuse=0.75, specular=0.0)
        for pin in self._sim.positions[list(self._held())]:
            plotter.add_mesh(pv.Sphere(radius=0.008, center=pin), color="#343230")
        plotter.camera_position = [(0.25, 0.42, 0.6), (-0.02, 0.02, 0.0), (0.0, 1.0, 0.0)]
        picture = plotter.screenshot(return_img=True)
        plotter.close()
        return picture

    def _held(self) -> tuple[int, int]:
        corners = np.asarray(cs.Mesh.grid(SIDE, SIDE, COUNT, COUNT).vertices)
        return int(np.argmax(corners[:, 0] - corners[:, 2])), int(np.argmax(corners[:, 0] + corners[:, 2]))

    def _measure(self) -> float:
        return float(np.linalg.norm(self._sim.positions - self._goal, axis=1).mean())

    def _observe(self) -> NDArray[np.float32]:
        left = 1.0 - self._steps / HORIZON
        points = self._sim.positions[KEYPOINTS].ravel()
        return np.concatenate([self._grippers.ravel(), points, [left]]).astype(np.float32)


def reachable(wanted: Floats, now: Floats) -> Floats:
    """Displacements within reach and above the table, with the grippers no further apart than the edge is long."""
    low, high = np.array([-2.0 * REACH, 0.0, -REACH]), np.array([REACH, REACH, REACH])
    wanted = np.clip(wanted, low, high)
    apart = np.array([0.0, 0.0, SIDE])  # from the first gripper to the second at the start
    return wanted if np.linalg.norm(apart + wanted[1] - wanted[0]) <= SIDE else now


def arc(step: int) -> NDArray[np.float32]:
    """A hand-made policy: both grippers follow half an ellipse about the fold line, and wait at its end."""
    turns, radius = 36, 0.5 * SIDE  # actions for the way; half a towel

    def place(s: int) -> Floats:
        angle = np.pi * min(s / turns, 1.0)
        return np.array([radius * (np.cos(angle) - 1.0), 0.8 * radius * np.sin(angle), 0.0])

    velocity = (place(step + 1) - place(step)) / (SPEED * PERIOD)
    return np.concatenate([velocity, velocity]).astype(np.float32)


def play(
    env: gym.Env[Any, Any], policy: Callable[[int], NDArray[np.float32]], seed: int
) -> tuple[float, dict[str, Any], list[Any]]:
    """Play an episode; return the sum of rewards, the last info and the pictures, if the environment makes any."""
    env.reset(seed=seed)
    total, step, over, pictures = 0.0, 0, False, [env.render()]
    info: dict[str, Any] = {}
    while not over:
        _, reward, terminated, truncated, info = env.step(policy(step))
        total, step, over = total + float(reward), step + 1, terminated or truncated
        pictures.append(env.render())
    return total, {**info, "steps": step}, pictures


gym.register("clothsim/FoldTowel-v0", entry_point=lambda **options: FoldTowel(**options))  # noqa: PLW0108  (for mypy: a class is no such callable)


def main(episodes: int, envs: int, picture: Path | None) -> None:
    """Fold some towels by hand, and say how fast environments step, alone and side by side."""
    for seed in range(episodes):
        env = FoldTowel("rgb_array" if picture else None)
        total, info, pictures = play(env, arc, seed)
        state, off = "folded" if info["is_success"] else "not folded", 1e3 * info["distance"]
        print(f"seed {seed}: {state} in {info['steps']} actions, {off:.0f} mm off, return {total:.2f}")
        if picture and seed == 0:
            import matplotlib.image

            chosen = [pictures[round(k * (len(pictures) - 1) / 3)] for k in range(4)]
            matplotlib.image.imsave(picture, np.concatenate(chosen, axis=1))
    vector = gym.vector.AsyncVectorEnv([FoldTowel] * envs)  # a process each
    vector.reset(seed=0)
    began, count = time.perf_counter(), 20
    for step in range(count):
        vector.step(np.stack([arc(step)] * envs))
    seconds = time.perf_counter() - began
    vector.close()
    print(f"{envs} environments side by side: {envs * count / seconds:.0f} actions per second")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=3, help="towels to fold by hand")
    parser.add_argument("--envs", type=int, default=2, help="environments side by side")
    parser.add_argument("--picture", type=Path, help="write moments of the first episode to this PNG")
    options = parser.parse_args()
    main(options.episodes, options.envs, options.picture)
