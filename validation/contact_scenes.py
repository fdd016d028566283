"""Meshes and scenes of the friction tests: a card on a plane that is level or tilted.

A plane tilted by α about the z-axis has the normal (sin α, cos α, 0) and falls along (cos α, −sin α, 0).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import Delaunay

import clothsim as cs

from .sliding import Law

METHODS = ("velocity-filter", "constraints")
GRAVITY = 9.81  # m/s²
THICKNESS = 1e-3  # m
# Cloth starts this share of the thickness above what it lies on: within the range where contact carries it at rest.
START = 0.9999
SIZE = 0.1  # side of a card [m]
DENSITY = 0.25  # kg/m²
# A card that keeps its shape: under its own weight it strains by 2e-3 at most.
CARD = {
    "in_plane": {"model": "baraff-witkin", "warp": 1000.0, "weft": 1000.0, "shear": 1000.0},
    "bending": {"model": "hinge", "rigidity": 1e-3},
}
SEED = 7
# Meshes of a card: points along a side of the generator's grid; points inside of a random triangulation.
GRIDS = {"grid 5x5": 5, "grid 9x9": 9}
IRREGULAR = "irregular"
INSIDE, ALONG = 30, 6


def card(kind: str) -> cs.Mesh:
    """Make a square card in the xz-plane, centred at the origin."""
    if kind in GRIDS:
        return cs.Mesh.grid(SIZE, SIZE, GRIDS[kind], GRIDS[kind])
    side = np.linspace(0.0, 1.0, ALONG)
    border = [(s, e) for e in (0.0, 1.0) for s in side] + [(e, s) for e in (0.0, 1.0) for s in side[1:-1]]
    inside = np.random.default_rng(SEED).uniform(0.05, 0.95, (INSIDE, 2))
    points = np.vstack([border, inside])
    corners = Delaunay(points).simplices
    a, b, c = (points[corners[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    # Slivers of rounding along the border go; all triangles face up (x × z = −y).
    corners = np.where((area > 0.0)[:, None], corners[:, ::-1], corners)[np.abs(area) > 1e-9]
    flat = (points - 0.5) * SIZE
    return cs.Mesh(np.column_stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]]), corners.astype(np.int64))


def normal(angle: float) -> np.ndarray:
    """Up from a plane that is tilted by ``angle`` [rad]."""
    return np.array([np.sin(angle), np.cos(angle), 0.0])


def down(angle: float) -> np.ndarray:
    """Down along it."""
    return np.array([np.cos(angle), -np.sin(angle), 0.0])


def tilt(angle: float) -> dict[str, Any]:
    """Rotation key of what lies on it."""
    return {"axis": [0, 0, 1], "angle": -angle}


def contact(law: Law, method: str, thickness: float = THICKNESS) -> dict[str, Any]:
    """Contact table: nothing but the cloth and what it lies on."""
    return {"thickness": thickness, "friction": law.table, "method": method, "self": False}


def scene(law: Law, method: str, dt: float, gravity: float = GRAVITY, **keys: Any) -> cs.Scene:
    """Make a scene with contact and without bodies."""
    return cs.Scene(
        duration=1e6,
        gravity=[0.0, -gravity, 0.0],
        time={"dt": dt, "integrator": "implicit-euler"},
        contact=contact(law, method),
        **keys,
    )


def card_on_slope(law: Law, method: str, dt: float, kind: str, angle: float, plane: Any = None) -> cs.Scene:
    """Make the scene of a card at rest on a slope; ``plane``: the collider's keys instead."""
    made = scene(law, method, dt)
    place = (normal(angle) * START * THICKNESS).tolist()
    material = cs.Material(DENSITY, CARD["in_plane"], CARD["bending"])
    made.add_cloth(card(kind), material, position=place, rotation=tilt(angle))
    made.add_collider("plane", **(plane or {"shape": {"type": "plane", "half_size": 10.0}, "rotation": tilt(angle)}))
    return made
