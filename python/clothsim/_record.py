"""A simulation that is run to keep its frames."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clothsim._frames import moving_positions, standing_positions
from clothsim._scene_facts import contact_thickness
from clothsim.recording import Recording

if TYPE_CHECKING:
    from clothsim.simulation import Simulation

__all__ = ["record"]


def record(
    simulation: Simulation, seconds: float | None = None, fps: float = 60.0, *, progress: bool = True
) -> Recording:
    """Run a simulation and keep its frames, to save, render or look at.

    Parameters
    ----------
    simulation : Simulation
        Where to go on from.
    seconds, fps, progress
        As for `Simulation.run`.

    Returns
    -------
    Recording

    Examples
    --------
    >>> import clothsim as cs
    >>> scene = cs.Scene(duration=0.1)
    >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0, 5]}])
    >>> cs.record(cs.Simulation(scene), fps=20, progress=False)
    Recording(3 frames of cloth, 0 s to 0.1 s)
    """
    bodies = simulation.bodies
    if simulation.time > 0.0:  # the first frame is not the scene's start
        bodies = [replace(body, rest=None) if body.rest == "start" else body for body in bodies]
    scene = json.loads(simulation._core.scene())
    rows, times, velocities = [], [], []
    standing = standing_positions(bodies, simulation.collider_positions)
    for frame in simulation.run(seconds, fps, progress):
        rows.append(moving_positions(bodies, frame.positions, frame.collider_positions))
        times.append(frame.time)
        velocities.append(frame.velocities)
    return Recording(
        bodies, np.array(times), np.array(rows), standing,
        velocities=np.array(velocities), fps=fps, up=scene["up"], name=scene["name"],
        thickness=contact_thickness(scene),
    )  # fmt: skip
