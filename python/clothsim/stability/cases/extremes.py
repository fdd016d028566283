"""Places, scales and laws far from the usual."""

from __future__ import annotations

from typing import Any

import numpy as np

from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, grid

__all__ = ["CASES"]


def _draped(dt: float, size: float = 1.0, at: float = 0.0, seconds: float = 0.4, **contact: Any) -> Setup:
    """A square of ``size`` [m] falls on a ball of 0.3 of that, ``at`` [m] from the origin in x, y and z."""
    away = np.full(3, at)
    ball = {"type": "sphere", "radius": 0.3 * size, "tolerance": 6e-3 * size}
    scene = Scene(
        duration=max(seconds, 8.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS * size, **contact},
        cloth=[{
            "name": "cloth", "mesh": grid(size, 15), "material": "cotton",
            "position": (away + size * np.array([0.02, 0.31, 0.01])).tolist(),
        }],
        collider=[{"name": "ball", "shape": ball, "position": away.tolist()}],
    )  # fmt: skip

    def sides(x: Any, colliders: Any) -> Any:
        """No vertex is in the ball, whose mesh lies within its radius by the tolerance."""
        return (np.linalg.norm(x - colliders.mean(axis=0), axis=1) < 0.3 * size - 6e-3 * size).astype(np.int64)

    return Setup(scene, sides)


def _far(dt: float, at: float) -> Setup:
    return _draped(dt, at=at)


def _scaled(dt: float, size: float) -> Setup:
    """Times go with the root of the size, as falling does."""
    slow = size**0.5
    return _draped(dt * slow, size, seconds=0.4 * slow)


def _friction(dt: float, friction: float) -> Setup:
    return _draped(dt, friction=friction, self_friction=friction)


def _weightless(dt: float, spin: float) -> Setup:
    """A sheet spins about an axis in its plane and one across, in nothing."""
    mesh = Mesh.grid(0.3, 0.3, 11, 11)
    scene = Scene(duration=max(0.2, 8.0 * dt), gravity=[0, 0, 0], time={"dt": dt}, contact={"thickness": THICKNESS})
    velocities = np.cross(np.array([0.6, 0.8, 0.0]) * spin, np.asarray(mesh.vertices))
    scene.add_cloth(mesh, "cotton", velocities=velocities)
    return Setup(scene)


CASES = (
    Case(
        "far",
        "Up to 10⁶ m from the origin",
        "A square of cotton falls on a ball, all of it so far from the origin in every direction: a position then has "
        "as many digits less. Passed if a vertex is in the ball.",
        dt_axis((1e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("distance", (0.0, 1e2, 1e4, 1e6), (1e6,), "m", "distance from the origin along each axis"),
        _far,
    ),
    Case(
        "scale",
        "From a millimetre to a kilometre",
        "The same square and ball at other sizes, the thickness in proportion; durations and steps go with the root of "
        "the size. Cotton is a board at a millimetre and rubber at a kilometre.",
        dt_axis((1e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("size", (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3), (1e-3, 1e3), "m", "side of the square"),
        _scaled,
    ),
    Case(
        "friction",
        "Friction 0 to 10",
        "The same square and ball, with that coefficient against the ball and against itself.",
        dt_axis((1e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("friction", (0.0, 0.1, 0.5, 1.0, 3.0, 10.0), (0.0, 10.0), "", "coefficient of friction"),
        _friction,
    ),
    Case(
        "weightless",
        "Zero gravity",
        "A free sheet of cotton spins in nothing; at 1000 rad/s its corners fly at 200 m/s and pull it apart.",
        dt_axis(),
        Axis("spin", (0.0, 1.0, 10.0, 100.0, 1000.0), (10.0,), "rad/s", "spin"),
        _weightless,
    ),
)
