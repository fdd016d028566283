"""Seeded disturbances: the same smooth field on every mesh."""

from __future__ import annotations

import copy

import numpy as np

from clothsim._arrays import Floats
from clothsim.scene import Scene
from clothsim.simulation import Simulation
from clothsim.study.axes import variant

__all__ = ["disturbed", "field"]

_WAVES, _SHORTEST = 24, 6.0  # waves of the field; the shortest has so many periods over the cloth


def field(points: Floats, seed: int, amplitude: float) -> Floats:
    """Velocities (n, 3) [m/s] at points (n, 3) [m]: a sum of waves, ``amplitude`` in each direction in the mean square.

    Its waves depend on the seed and on the box around the points alone, not on how many points there are.
    """
    random = np.random.default_rng(seed)
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-12)
    directions = random.normal(size=(_WAVES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = 2.0 * np.pi * random.uniform(0.5, _SHORTEST, size=_WAVES)
    phases = random.uniform(0.0, 2.0 * np.pi, size=(_WAVES, 3))
    along = ((points - low) / size) @ directions.T * lengths
    waves = np.cos(along[:, :, None] + phases).sum(axis=1)
    return np.asarray(amplitude * np.sqrt(2.0 / _WAVES) * waves)


def disturbed(scene: Scene, seed: int, amplitude: float) -> Scene:
    """Return the scene with a seeded disturbance added to its start velocities."""
    data = scene.to_dict()
    simulation = Simulation(variant(scene, copy.deepcopy(data)), threads=1)
    points = simulation.positions
    velocities, first = dict(scene._velocities), 0
    for i, (cloth, body) in enumerate(zip(data["cloth"], simulation.bodies, strict=False)):
        own = points[first : first + body.vertex_count]
        first += body.vertex_count
        noise = field(own, seed + 1000 * i, amplitude)
        name = cloth.get("velocities")
        if name is not None:
            noise = noise + velocities[name]
        cloth["velocities"] = f"disturbed-{i}"
        velocities[f"disturbed-{i}"] = noise
    made = variant(scene, data)
    made._velocities = velocities
    return made
