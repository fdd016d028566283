"""Four stiff cards, one friction law each, side by side on a plane: shared by figures 7.2, 7.6 and 7.7."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._frames import moving_positions, standing_positions
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import residual
from clothsim.reproduce.friction_laws import GRAVITY, LAWS, Coefficients, Slide, slide
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["ORDER", "Cards", "Run", "run"]

# Cards as the scene lists them: the renderer's colours then are the laws', red, blue, yellow, green.
ORDER = ("CS", "CSS", "CSSV", "C")
_MARGIN = 0.25  # m of plane above the cards, below their way and beside them


@dataclass(frozen=True)
class Cards:
    """Cards on a plane; what the thesis leaves open but for the slope. SI units."""

    slope: float = 0.3  # tan α; 0 is level
    width: float = 0.24
    length: float = 0.32
    gap: float = 0.14
    cells: tuple[int, int] = (6, 8)
    areal_density: float = 0.25
    stretch: float = 2000.0
    shear: float = 800.0
    rigidity: float = 0.01
    damping: float = 1e-3
    thickness: float = 4e-3
    dt: float = 2e-3

    @property
    def angle(self) -> float:
        """α [rad]."""
        return math.atan(self.slope)

    @property
    def driving(self) -> float:
        """Along the plane, g sin α [m/s²]."""
        return GRAVITY * math.sin(self.angle)

    @property
    def pressing(self) -> float:
        """Against the plane, g cos α [m/s²]."""
        return GRAVITY * math.cos(self.angle)

    @property
    def mass(self) -> float:
        """Of a card [kg]."""
        return self.areal_density * self.width * self.length

    @property
    def down(self) -> Floats:
        """Unit vector along the plane, downhill."""
        return np.array([0.0, -math.sin(self.angle), math.cos(self.angle)])

    @property
    def normal(self) -> Floats:
        """Unit normal of the plane."""
        return np.array([0.0, math.cos(self.angle), math.sin(self.angle)])

    def friction(self, times: Floats, speed: Floats) -> tuple[Floats, Floats]:
        """Friction on a card between samples of its speed, m (g sin α − Δv/Δt): times half-way [s], force [N]."""
        middle: Floats = 0.5 * (times[1:] + times[:-1])
        force: Floats = self.mass * (self.driving - np.diff(speed) / np.diff(times))
        return middle, force

    def exact(self, coefficients: Coefficients, law: str, times: Floats) -> Slide:
        """How a card slides from rest, by its differential equation."""
        return slide(coefficients, law, times, driving=self.driving, pressing=self.pressing)


@dataclass(frozen=True)
class Run:
    """Cards over time.

    Attributes
    ----------
    times : (frames,) float64
        From 0 [s].
    way, speed : dict of (frames,) float64
        Of each card's centre of mass, downhill [m], [m/s].
    states : list of (n, 3) float64
        Positions at the moments asked for [m].
    bodies : list of Body
    standing : (k, 3) float64
        Positions of the plane [m].
    """

    times: Floats
    way: dict[str, Floats]
    speed: dict[str, Floats]
    states: list[Floats]
    bodies: list[Body]
    standing: Floats


def run(
    cards: Cards,
    coefficients: Coefficients,
    duration: float,
    frames: int,
    *,
    start: float = 0.0,
    moments: Sequence[float] = (),
    tick: Callable[[], Any] | None = None,
) -> Run:
    """Let the cards go at ``start`` [m/s] and sample them at ``frames`` equal times after the first."""
    simulation = Simulation(_scene(cards, coefficients, duration, start), threads=1)
    bodies, masses = simulation.bodies, simulation.masses
    parts = {}
    first = 0
    for body in bodies[: len(ORDER)]:
        parts[body.name] = slice(first, first + body.vertex_count)
        first += body.vertex_count
    times = np.linspace(0.0, duration, frames + 1)
    shown = {int(np.argmin(np.abs(times - moment))) for moment in moments}
    way: dict[str, list[float]] = {law: [] for law in LAWS}
    speed: dict[str, list[float]] = {law: [] for law in LAWS}
    states = []
    for frame in range(frames + 1):
        if frame > 0:
            simulation.advance(duration / frames)
            if tick is not None:
                tick()
        along, rate = simulation.positions @ cards.down, simulation.velocities @ cards.down
        for law, part in parts.items():
            way[law].append(float(np.average(along[part], weights=masses[part])))
            speed[law].append(float(np.average(rate[part], weights=masses[part])))
        if frame in shown:
            states.append(moving_positions(bodies, simulation.positions, simulation.collider_positions))
    return Run(
        times,
        {law: np.array(places) - places[0] for law, places in way.items()},
        {law: np.array(speeds) for law, speeds in speed.items()},
        states,
        bodies,
        standing_positions(bodies, simulation.collider_positions),
    )


def _scene(cards: Cards, coefficients: Coefficients, duration: float, start: float) -> Scene:
    c = cards
    farthest = max(start * duration, *(float(c.exact(coefficients, law, np.array([duration])).way[-1]) for law in LAWS))
    length = c.length + farthest + 2.0 * _MARGIN
    turn = {"axis": [1.0, 0.0, 0.0], "angle": c.angle}
    material = residual.fabric(
        c.areal_density, c.stretch, c.shear, c.damping, {"model": "hinge", "rigidity": c.rigidity, "damping": c.damping}
    )
    scene = Scene(
        name="cards",
        duration=duration,
        gravity=[0.0, -GRAVITY, 0.0],
        time={"dt": c.dt},
        contact={"thickness": c.thickness, "self": False},
    )
    pitch = c.width + c.gap
    for law in ORDER:
        aside = (LAWS.index(law) - 1.5) * pitch
        place = (_MARGIN + 0.5 * c.length - 0.5 * length) * c.down + c.thickness * c.normal
        scene.add_cloth(
            Mesh.grid(c.width, c.length, c.cells[0] + 1, c.cells[1] + 1),
            material,
            name=law,
            position=(place + [aside, 0.0, 0.0]).tolist(),
            rotation=turn,
            velocity=(start * c.down).tolist(),
            friction=coefficients.friction(law, c.areal_density),
        )
    half = (2.0 * pitch + 0.5 * _MARGIN, 0.02, 0.5 * length)
    shape: Mapping[str, Any] = {"type": "box", "half_extents": list(half)}
    scene.add_collider("plane", shape=shape, position=(-half[1] * c.normal).tolist(), rotation=turn)
    return scene
