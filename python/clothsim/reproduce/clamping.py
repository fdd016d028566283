"""The experiment of figures 4.13 and 4.14: a strip is gently folded, clamped by two planes again and again, then hung.

The strip lies along x on the lower plane and is held by one short side at x = 0. A flap under its free half turns
over by half a turn and folds it, becomes part of the upper plane, and the upper plane goes down and up. To hang the
strip the upper plane leaves, and the lower one swings away about the held side like a door.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import whole_steps
from clothsim.reproduce.kes import Loop
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["FABRIC", "Setup", "Specimen", "clamp", "parameters"]

FABRIC = Loop(b1=5.20, b2=2.51, c1=-4.45, plasticity=0.15, fatigue=0.1)
# H of the plastic law over its rigidity: the thesis names no flow rule. A quarter of what exceeds the limit stays.
HARDENING = 3.0


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    length: float = 0.128
    cells: int = 32  # along the length
    rows: int = 6  # across, of square cells
    areal_density: float = 0.1
    stretch: float = 500.0  # warp and weft [N/m]
    shear: float = 50.0  # [N/m]
    in_plane_damping: float = 2e-3  # s
    bending_damping: float = 0.01  # s: without it the strip vibrates between the planes, and each vibration is a cycle
    air_damping: float = 20.0  # 1/s
    friction: float = 0.5
    thickness: float = 2e-3
    open: float = 0.05  # distance of the planes when lifted
    closed: float = 0.019  # … when clamped
    fold_time: float = 0.4
    lower_time: float = 0.12
    clamped_time: float = 0.005  # a short while: at rest, vibrations would end the cycle
    lift_time: float = 0.13
    hang_time: float = 1.5
    dt: float = 1e-3

    @property
    def cell(self) -> float:
        """Side of a cell [m]."""
        return self.length / self.cells

    @property
    def cycle_time(self) -> float:
        """From one start of lowering to the next [s]."""
        return self.lower_time + self.clamped_time + self.lift_time


@dataclass(frozen=True)
class Specimen:
    """What came of one strip.

    Attributes
    ----------
    model : str
        Bending law.
    cycles : int
        How often it was clamped.
    clamped, lifted : dict of arrays (cycles, hinges)
        Curvature, moment, rest curvature [1/m, N, 1/m], b1 [N m] and frictional moment [N] of the hinges across the
        fold.
    path : (steps, hinges) float64
        Their curvature after each step that the engine took up to the last time the planes are lifted [1/m]; of a
        strip that is ``followed``.
    place : (hinges,) float64
        Where they are along the strip [m].
    hung : (n, 3) float64 or None
        Positions after hanging [m].
    rest : (hinges,) float64
        Rest curvature at the end [1/m].
    """

    model: str
    cycles: int
    clamped: dict[str, Floats]
    lifted: dict[str, Floats]
    path: Floats
    place: Floats
    hung: Floats | None
    rest: Floats
    body: Body

    def apex(self) -> int:
        """The hinge in the middle of the fold: of those that are bent in every clamping, weighted by how much."""
        least = np.abs(self.clamped["curvature"]).min(axis=0)
        return round(float(np.average(np.arange(len(least)), weights=least**2)))

    def fold_angle(self, setup: Setup) -> float:
        """Angle between the two legs of the hung strip, flat = 0 [rad]."""
        assert self.hung is not None
        lines = self.hung.reshape(setup.rows + 1, setup.cells + 1, 3).mean(axis=0)
        first, last = (
            lines[b] - lines[a] for a, b in ((setup.cells // 8, setup.cells // 3), (2 * setup.cells // 3, setup.cells))
        )
        cosine = float(first @ last / np.linalg.norm(first) / np.linalg.norm(last))
        return math.acos(max(-1.0, min(1.0, cosine)))


def parameters(setup: Setup) -> dict[str, Any]:
    """For the head of a table."""
    units = {
        "length": "m", "areal_density": "kg/m2", "stretch": "N/m", "shear": "N/m", "in_plane_damping": "s",
        "bending_damping": "s", "air_damping": "1/s", "thickness": "m", "open": "m", "closed": "m", "fold_time": "s",
        "lower_time": "s", "clamped_time": "s", "lift_time": "s", "hang_time": "s", "dt": "s",
    }  # fmt: skip
    chosen = {f"{key} [{units[key]}]" if key in units else key: value for key, value in asdict(setup).items()}
    return {**FABRIC.named(), **chosen, "chosen": "all but b1, b2, c1, lambda, mu: the thesis does not state them"}


def clamp(model: str, cycles: int, setup: Setup, *, hang: bool, followed: bool = False, tick: Any = None) -> Specimen:
    """Simulate one strip; ``tick()`` is called after each cycle.

    ``followed``: keep the path of its hinges' curvature, and take each step whole (`whole_steps`), so that no turn of
    it is missed.
    """
    scene = _scene(model, cycles, setup)
    simulation = Simulation(scene, threads=1)
    ids, place = _across_the_fold(simulation, setup)
    clamped: list[dict[str, Floats]] = []
    lifted: list[dict[str, Floats]] = []
    path: list[Floats] = []
    with TemporaryDirectory() as folder:

        def go(simulation: Simulation, seconds: float) -> Simulation:
            count = round(seconds / setup.dt)
            if followed:
                file = Path(folder) / "stretch"
                return whole_steps.advance(simulation, count, setup.dt, lambda s: s.hinges.curvature[ids], path, file)
            for _ in range(count):
                simulation.step()
            return simulation

        simulation = go(simulation, setup.fold_time)
        for _ in range(cycles):
            simulation = go(simulation, setup.lower_time)
            clamped.append(_state(simulation, ids))
            simulation = go(simulation, setup.clamped_time + setup.lift_time)
            lifted.append(_state(simulation, ids))
            if tick is not None:
                tick()
    hung = None
    if hang:
        simulation.advance(setup.hang_time)
        hung = simulation.positions
    rest = simulation.hinges.rest_curvature[ids]
    return Specimen(
        model, cycles, _stack(clamped), _stack(lifted), np.array(path), place, hung, rest, simulation.bodies[0]
    )  # fmt: skip


def _state(simulation: Simulation, ids: Ints) -> dict[str, Floats]:
    hinges = simulation.hinges
    names = ("curvature", "moment", "rest_curvature", "b1", "frictional_moment")
    return {name: getattr(hinges, name)[ids] for name in names}


def _stack(states: list[dict[str, Floats]]) -> dict[str, Floats]:
    return {name: np.array([state[name] for state in states]) for name in (states[0] if states else ())}


def _across_the_fold(simulation: Simulation, setup: Setup) -> tuple[Ints, Floats]:
    """Hinges whose edge lies across the strip, on its middle row, with their place along it."""
    x = simulation.positions
    edges = x[simulation.hinges.vertices[:, :2]]
    across = np.abs(edges[:, 0, 0] - edges[:, 1, 0]) < 1e-3 * setup.cell
    middle = np.abs(edges[:, :, 2].mean(axis=1)) <= 0.5 * setup.cell * (1.0 + 1e-6)
    upper = edges[:, :, 2].mean(axis=1) > -0.25 * setup.cell
    found = np.flatnonzero(across & middle & upper)
    found = found[np.argsort(edges[found, 0, 0])]
    return found, edges[found, 0, 0]


def _scene(model: str, cycles: int, setup: Setup) -> Scene:
    s = setup
    end = s.fold_time + cycles * s.cycle_time
    extra = {"damping": s.bending_damping}
    if model == "plastic":
        extra["hardening"] = HARDENING * FABRIC.si()["b2"]
    scene = Scene(
        name=f"{model}, clamped {cycles} times",
        duration=end + s.hang_time,
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self_friction": s.friction},
    )
    nx = s.cells + 1
    half = 0.5 * s.length
    start = 1.1 * s.thickness
    scene.add_cloth(
        Mesh.grid(s.length, s.rows * s.cell, nx, s.rows + 1),
        {
            "areal_density": s.areal_density,
            "in_plane": {
                "model": "baraff-witkin", "warp": s.stretch, "weft": s.stretch, "shear": s.shear,
                "damping": s.in_plane_damping,
            },
            "bending": FABRIC.law(model, **extra),
        },
        name="strip",
        position=(half, start, 0.0),
        pins=[{"vertices": [row * nx for row in range(s.rows + 1)]}],
    )  # fmt: skip
    width = (s.rows + 4) * s.cell
    flap = _slab(0.004, 0.75 * s.length, -0.5 * s.open, width, below=True)
    press = _slab(-0.014, 0.055, 0.0, width, below=False)
    floor = _slab(-0.01, 0.75 * s.length, -start, width, below=True)
    heights = [(s.fold_time, s.open)]
    for cycle in range(cycles):
        now = s.fold_time + cycle * s.cycle_time
        down = now + s.lower_time
        heights += [(down, s.closed), (down + s.clamped_time, s.closed), (now + s.cycle_time, s.open)]
    heights.append((end + 0.3, 0.3))
    over = {"axis": [0, 0, 1], "angle": math.pi}
    flat = {"axis": [0, 0, 1], "angle": 0.0}
    turning = [{"time": 0.0, "position": [half, 0.5 * s.open, 0.0], "rotation": flat}]
    turning += [{"time": t, "position": [half, y - 0.5 * s.open, 0.0], "rotation": over} for t, y in heights]
    scene.add_collider("flap", mesh=flap, keyframes=turning)
    pressing = [{"time": t, "position": [half, y, 0.0]} for t, y in [(0.75 * s.fold_time, 0.25), *heights]]
    scene.add_collider("press", mesh=press, keyframes=pressing)
    door = [(end + 0.1, 0.0), (end + 0.7, -2.2)]
    scene.add_collider(
        "floor",
        mesh=floor,
        position=(0.0, start, 0.0),
        keyframes=[
            {"time": t, "position": [0.0, start, 0.0], "rotation": {"axis": [0, 0, 1], "angle": angle}}
            for t, angle in door
        ],
    )
    return scene


def _slab(x0: float, x1: float, face: float, width: float, *, below: bool) -> Mesh:
    """A slab from x0 to x1 with one face at y = ``face``, the rest below or above it."""
    thick = 0.01
    box = Mesh.box((x1 - x0, thick, width), (6, 1, 3))
    middle = face + (-0.5 if below else 0.5) * thick
    return Mesh(box.vertices + np.array([0.5 * (x0 + x1), middle, 0.0]), box.triangles)
