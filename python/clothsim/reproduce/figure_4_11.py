"""Figure 4.11: a fast sphere hits a hanging cloth; four bending laws side by side, and their energy over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from clothsim import bending
from clothsim._arrays import Floats
from clothsim._frames import moving_positions, standing_positions
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import CURVATURE, Loop
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 3.4, b2 = 2.0, c1 = −2.23 (K0 = 0.1π), λ = 0.2, μ = 0.02: the oscillation after the hit is strongest without "
    "plasticity and hysteresis, weaker with plasticity, weakest with hysteresis"
)

FABRIC = Loop(b1=3.4, b2=2.0, c1=-2.23, plasticity=0.2, fatigue=0.02)
LAWS = ("linear", "nonlinear", "plastic", "hysteresis")
FPS = 100.0
FRAMES = {"the hit": 9, "frame 230": 230}  # frame 230 as in the thesis, whose frame rate is not given
WINDOW = (0.5, 3.0)  # s, the oscillation after the hit


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    side: float = 0.2
    cells: int = 20
    areal_density: float = 0.15
    stretch: float = 300.0
    shear: float = 30.0
    in_plane_damping: float = 2e-4
    air_damping: float = 0.02
    friction: float = 0.2
    thickness: float = 4e-3
    radius: float = 0.03
    speed: float = 2.0
    start: float = 0.15  # the sphere comes from here along −z …
    turn: float = -0.04  # … to here, and back
    across: float = 0.04  # where it hits, from the middle
    below: float = 0.15  # … and below the upper edge
    dt: float = 5e-4
    bending_substeps: int = 3
    duration: float = 3.0


@dataclass(frozen=True)
class Run:
    """One law."""

    energy: dict[str, Floats]  # by kind, at each frame [J]
    lost: Floats  # what bending has dissipated up to each frame [J]
    states: dict[str, Floats]  # positions at the frames that are shown
    peak: float  # largest curvature of 99 % of the hinges [1/m]


@dataclass(frozen=True)
class Measured:
    """The four runs."""

    setup: Setup
    times: Floats
    runs: dict[str, Run]
    bodies: list[Body]
    standing: Floats

    def oscillation(self, law: str) -> float:
        """Mean kinetic energy after the hit [J]."""
        return float(self.runs[law].energy["kinetic"][self._after()].mean())

    def decay(self, law: str) -> float:
        """Rate at which the kinetic energy falls after the hit, from a straight line through its logarithm [1/s].

        Means over half a second: longer than a swing.
        """
        kinetic, times = self.runs[law].energy["kinetic"][self._after()], self.times[self._after()]
        count = len(times) // 50
        means = [float(part.mean()) for part in np.array_split(kinetic, count)]
        middles = [float(part.mean()) for part in np.array_split(times, count)]
        return float(-np.polyfit(middles, np.log(means), 1)[0])

    def _after(self) -> Any:
        return (self.times >= WINDOW[0]) & (self.times <= WINDOW[1])


def measure(effort: Effort) -> Measured:
    """Simulate the four laws."""
    setup = Setup(cells=12, bending_substeps=1) if effort.quick else Setup()
    frames = round(setup.duration * FPS)
    with effort.bar(frames * len(LAWS), "figure 4.11", "frame") as bar:
        found = effort.each(lambda law: _run(law, setup, frames, bar.update), LAWS, bar)
        runs = dict(zip(LAWS, found, strict=True))
    simulation = Simulation(_scene("linear", setup), threads=1)
    bodies = simulation.bodies
    standing = standing_positions(bodies, simulation.collider_positions)
    return Measured(setup, np.arange(frames + 1) / FPS, runs, bodies, standing)


def _run(law: str, setup: Setup, frames: int, tick: Any) -> Run:
    simulation = Simulation(_scene(law, setup), threads=1)
    bodies = simulation.bodies
    energies = [simulation.energy]
    path = [simulation.hinges.curvature]
    vertices, rest = simulation.hinges.vertices, simulation.positions
    states = {}
    samples = 5  # of the curvature in a frame: turning points between them are lost
    for frame in range(1, frames + 1):
        for _ in range(samples):
            simulation.advance(1.0 / FPS / samples)
            path.append(simulation.hinges.curvature)
        energies.append(simulation.energy)
        for name, number in FRAMES.items():
            if frame == number:
                states[name] = moving_positions(bodies, simulation.positions, simulation.collider_positions)
        tick()
    curvature = np.array(path)
    return Run(
        {kind: np.array([e[kind] for e in energies]) for kind in energies[0]},
        _dissipated(law, curvature, rest[vertices])[::samples],
        states,
        float(np.percentile(np.abs(curvature), 99, axis=1).max()) if curvature.size else 0.0,
    )


def _dissipated(law: str, curvature: Floats, corners: Floats) -> Floats:
    """What bending has taken up to each sample: the law alone along each hinge's path, times the area it stands for."""
    total = np.zeros(len(curvature))
    if curvature.shape[1] == 0:
        return total  # laws that give back what they took
    a, b, c, d = (corners[:, k] for k in range(4))
    areas = 0.5 * (np.linalg.norm(np.cross(b - a, c - a), axis=1) + np.linalg.norm(np.cross(b - a, d - a), axis=1))
    keys = FABRIC.si()
    if law == "plastic":
        keys = {"rigidity": keys["b2"], "elastic_limit": FABRIC.k0 * CURVATURE}
    for hinge, area in enumerate(areas):
        total += area * bending.trace(curvature[:, hinge], law, **keys).dissipated
    return total


def _scene(law: str, setup: Setup) -> Scene:
    s = setup
    n = s.cells + 1
    scene = Scene(
        name=law,
        duration=s.duration,
        time={"dt": s.dt, "integrator": "semi-implicit", "bending_substeps": s.bending_substeps},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self": False},
    )
    scene.add_cloth(
        Mesh.grid(s.side, s.side, n, n),
        {
            "areal_density": s.areal_density,
            "in_plane": {
                "model": "baraff-witkin", "warp": s.stretch, "weft": s.stretch, "shear": s.shear,
                "damping": s.in_plane_damping,
            },
            "bending": FABRIC.law(law),
        },
        rotation={"axis": [1, 0, 0], "angle": 0.5 * np.pi},
        position=(0.0, -0.5 * s.side, 0.0),
        pins=[{"vertices": list(range(2 * n))}],
    )  # fmt: skip
    way = (s.start - s.turn) / s.speed
    places = ((0.0, s.start), (way, s.turn), (7.0 * way, s.turn + 6.0 * (s.start - s.turn)))  # and out of the picture
    scene.add_collider(
        "sphere",
        shape={"type": "sphere", "radius": s.radius, "tolerance": 1e-3},
        keyframes=[{"time": t, "position": [s.across, -s.below, z]} for t, z in places],
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The caption's coefficients, and what is chosen."""
    return {
        **FABRIC.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "integrator": "semi-implicit", "bending damping": 0.0, "linear": "rigidity b2",
        "plastic": f"rigidity b2, elastic limit K0 = {FABRIC.k0:.4f} 1/cm, no hardening",
        "held": "the two upper rows of vertices", "frames per second": FPS,
        "chosen": "all but b1, b2, c1, lambda, mu, bending damping: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """Energies over time, and one row per law."""
    kinds = ("kinetic", "stretch", "shear", "bending", "gravity", "total")
    columns = ("law", "time [s]", *(f"{kind} [J]" for kind in kinds), "dissipated by bending [J]")
    rows = [
        (law, float(t), *(float(run.energy[kind][i]) for kind in kinds), float(run.lost[i]))
        for law, run in measured.runs.items()
        for i, t in enumerate(measured.times)
    ]
    summary = [
        (law, measured.oscillation(law), measured.decay(law), float(run.lost[-1]), run.peak)
        for law, run in measured.runs.items()
    ]
    names = (
        "law", f"mean kinetic energy {WINDOW[0]} s to {WINDOW[1]} s [J]", "decay rate [1/s]",
        "dissipated by bending [J]", "largest curvature of 99 % of the hinges [1/m]",
    )  # fmt: skip
    return {"": Table(names, summary), "energy": Table(columns, rows)}


def here(measured: Measured) -> str:
    """Kinetic energy after the hit, decay rate, and what bending took, per law."""
    words = [
        f"{law} {1e3 * measured.oscillation(law):.2f} mJ, {measured.decay(law):.2f} /s, "
        f"{1e3 * float(measured.runs[law].lost[-1]):.2f} mJ"
        for law in LAWS
    ]
    return "mean kinetic energy after the hit, its decay rate, and what bending dissipated: " + "; ".join(words)


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    linear, plastic, hysteresis = (measured.oscillation(law) for law in ("linear", "plastic", "hysteresis"))
    lost = {law: float(run.lost[-1]) for law, run in measured.runs.items()}
    return [
        Check.true("the oscillation is weaker with plasticity than without", plastic < linear, "thesis 4.5.3"),
        Check.true("the oscillation is weakest with hysteresis", hysteresis < plastic, "thesis 4.5.3"),
        Check.true("bending dissipates most with hysteresis", lost["hysteresis"] > lost["plastic"] > 0.0, "loop area"),
    ]


def draw(measured: Measured) -> bytes:
    """Two rows of tiles, the hit and the frame of the thesis; below them energies over time."""
    s = measured.setup
    note = (
        f"A sheet of {100 * s.side:.0f} cm, its upper edge held; the sphere comes at {s.speed:g} m/s and goes back. "
        "No bending damping. Size, density, stretch and speed are chosen; bending coefficients as in the thesis, in "
        "KES units."
    )
    figure = pictures.figure("Figure 4.11: a sphere hits a hanging cloth", (14.0, 12.0), note)
    grid = figure.add_gridspec(3, 12, height_ratios=[1.0, 1.0, 1.1])
    shown = [measured.runs[law].states[frame] for frame in FRAMES for law in LAWS]
    images = pictures.tiles(measured.bodies, shown, measured.standing, size=(480, 440))
    for row, frame in enumerate(FRAMES):
        for column, (law, image) in enumerate(zip(LAWS, images[row * len(LAWS) :], strict=False)):
            axis = figure.add_subplot(grid[row, 3 * column : 3 * column + 3])
            pictures.show(
                axis, image, law if row == 0 else "", f"{frame}, {FRAMES[frame] / FPS:.2f} s" if column == 0 else ""
            )
    left, middle, right = (figure.add_subplot(grid[2, 4 * k : 4 * k + 4]) for k in range(3))
    pictures.tidy(left, "total energy above rest [mJ]", "time [s]")
    pictures.tidy(middle, "kinetic energy [mJ]", "time [s]")
    pictures.tidy(right, "dissipated by bending [mJ]", "time [s]")
    for law in LAWS:
        run, colour = measured.runs[law], pictures.LAWS[law]
        total = run.energy["total"] - run.energy["total"][0]
        left.plot(measured.times, 1e3 * total, color=colour, linewidth=1.7, label=law)
        middle.plot(measured.times, 1e3 * run.energy["kinetic"], color=colour, linewidth=1.2, label=law)
        right.plot(measured.times, 1e3 * run.lost, color=colour, linewidth=1.7, label=law)
    left.legend(frameon=False, fontsize=9.5)
    middle.axvspan(*WINDOW, color=pictures.GRID, alpha=0.5, linewidth=0)
    lines = [f"{law} {1e3 * measured.oscillation(law):.2f}" for law in LAWS]
    pictures.caption(middle, "mean over the shaded time [mJ]\n" + "\n".join(lines), (0.97, 0.97))
    return pictures.png(figure)
