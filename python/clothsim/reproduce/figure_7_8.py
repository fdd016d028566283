"""Figure 7.8: a cloth draped over a sphere that spins faster and faster; when each friction law casts it off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._frames import moving_positions
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import pictures, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, GRAVITY, LAWS, TABLE_7_1
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "μ_c = 0.2, μ_s = 0.35: with CSSV the cloth spins faster and faster as friction grows with velocity, with C at a "
    "constant acceleration; so CSSV casts it off earlier (frames 400, 2400, 2980 are shown)"
)

COEFFICIENTS = TABLE_7_1["sphere"]
DRAWN = ("C", "CSSV")
FPS = 100.0
LIFTED = 0.75  # of what touches when the sphere begins to turn: less has lifted off
GONE = 0.02  # share of the cloth's mass: less does not touch any more


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    radius: float = 0.25
    side: float = 0.6
    cells: int = 28
    areal_density: float = 0.15
    stretch: float = 300.0
    shear: float = 30.0
    in_plane_damping: float = 1e-3
    rigidity: float = 1e-5
    bending_damping: float = 2e-3
    air_damping: float = 0.1
    thickness: float = 4e-3
    tolerance: float = 3e-4  # of the sphere's triangles
    turned: float = 0.2  # rad, about the sphere's axis
    settling: float = 1.0  # s before the sphere begins to turn
    acceleration: float = 40.0  # of the sphere [rad/s²]
    duration: float = 3.6
    dt: float = 4e-3
    starts: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.003, 0.002), (-0.002, 0.003))  # off the middle [m]


@dataclass(frozen=True)
class Run:
    """One law from one start.

    Attributes
    ----------
    times : (frames,) float64
        From 0 [s].
    spin : (frames,) float64
        Angular velocity of the cloth about the vertical through its centre of mass, L/I [rad/s].
    touching : (frames,) float64
        Share of its mass within two thicknesses of the sphere.
    states : list of (n, 3) float64
        Positions at the moments shown [m].
    """

    times: Floats
    spin: Floats
    touching: Floats
    states: list[Floats]

    def lifts(self, setup: Setup) -> float:
        """When a quarter of what touched has lifted off, from the sphere's start on [s]; NaN if it has not."""
        return self._below(LIFTED * float(self.touching[self.times <= setup.settling][-1]), setup)

    def gone(self, setup: Setup) -> float:
        """When the cloth has left the sphere, from the sphere's start on [s]; NaN if it has not."""
        return self._below(GONE, setup)

    def _below(self, share: float, setup: Setup) -> float:
        found = (self.times > setup.settling) & (self.touching < share)
        return float(self.times[found.argmax()] - setup.settling) if found.any() else float("nan")


@dataclass(frozen=True)
class Measured:
    """All runs, the first start's are drawn."""

    setup: Setup
    runs: dict[tuple[str, int], Run]
    moments: list[float]
    bodies: list[Body]

    def each(self, law: str, what: Callable[[Run], float]) -> Floats:
        """A number of the run from each start."""
        return np.array([what(self.runs[law, k]) for k in range(len(self.setup.starts))])

    def lifts(self, law: str) -> Floats:
        """When it lifts off, from each start [s]."""
        return self.each(law, lambda run: run.lifts(self.setup))

    def gone(self, law: str) -> Floats:
        """When it has left the sphere, from each start [s]."""
        return self.each(law, lambda run: run.gone(self.setup))


def measure(effort: Effort) -> Measured:
    """Spin the sphere under each law, from each start."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, cells=14, starts=setup.starts[:1], duration=2.4)
    moments = [setup.settling + t for t in (0.0, 0.5, 0.9, 1.3)]
    jobs = [(law, k) for k in range(len(setup.starts)) for law in LAWS]
    frames = round(setup.duration * FPS)
    with effort.bar(frames * len(jobs), "figure 7.8", "frame") as bar:
        runs = effort.each(lambda job: _run(*job, setup, moments, bar.update), jobs, bar)
    bodies = Simulation(_scene("C", setup, 0), threads=1).bodies
    return Measured(setup, dict(zip(jobs, runs, strict=True)), moments, bodies)


def _run(law: str, start: int, setup: Setup, moments: Sequence[float], tick: Callable[[], Any]) -> Run:
    simulation = Simulation(_scene(law, setup, start), threads=1)
    bodies, masses = simulation.bodies, simulation.masses
    weights = masses / masses.sum()
    shown = {round(moment * FPS) for moment in moments}
    rows, states = [], []
    for frame in range(round(setup.duration * FPS) + 1):
        if frame > 0:
            simulation.advance(1.0 / FPS)
            tick()
        x, v = simulation.positions, simulation.velocities
        distance = np.linalg.norm(x, axis=1) - setup.radius
        rows.append((frame / FPS, _spin(x, v, masses), weights[distance < 2.0 * setup.thickness].sum()))
        if frame in shown:
            states.append(moving_positions(bodies, x, simulation.collider_positions))
    columns = np.array(rows).T
    return Run(columns[0], columns[1], columns[2], states)


def _spin(x: Floats, v: Floats, masses: Floats) -> float:
    """Angular momentum about the vertical through the centre of mass over the moment of inertia [rad/s]."""
    arm = x - np.average(x, axis=0, weights=masses)
    momentum = np.sum(masses * (arm[:, 2] * v[:, 0] - arm[:, 0] * v[:, 2]))
    return float(momentum / np.sum(masses * (arm[:, 0] ** 2 + arm[:, 2] ** 2)))


def _scene(law: str, setup: Setup, start: int) -> Scene:
    s = setup
    scene = Scene(
        name=law,
        duration=s.duration,
        gravity=[0.0, -GRAVITY, 0.0],
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={
            "thickness": s.thickness, "friction": COEFFICIENTS.friction(law, s.areal_density),
            "self_friction": COEFFICIENTS.self_friction(law, s.areal_density),
        },
    )  # fmt: skip
    aside = s.starts[start]
    scene.add_cloth(
        Mesh.grid(s.side, s.side, s.cells + 1, s.cells + 1),
        residual.fabric(
            s.areal_density, s.stretch, s.shear, s.in_plane_damping,
            {"model": "hinge", "rigidity": s.rigidity, "damping": s.bending_damping},
        ),
        name="cloth",
        position=(aside[0], s.radius + 2.0 * s.thickness, aside[1]),
        rotation={"axis": [0, 1, 0], "angle": s.turned},
    )  # fmt: skip
    keyframes = [
        {"time": s.settling + float(t), "rotation": {"axis": [0, 1, 0], "angle": 0.5 * s.acceleration * float(t) ** 2}}
        for t in np.arange(0.0, s.duration - s.settling + 0.01, 0.01)
    ]
    scene.add_collider(
        "sphere", shape={"type": "sphere", "radius": s.radius, "tolerance": s.tolerance}, keyframes=keyframes
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "F_v of the scene [N/m2 per m/s]": COEFFICIENTS.per_area(measured.setup.areal_density),
        "lifts off": f"touches with {100 * LIFTED:g} % of the mass that did at the sphere's start",
        "gone": f"less than {100 * GONE:g} % of the mass touches", "touches": "within two thicknesses of the sphere",
        "frames per second": FPS, "chosen": "all but the coefficients: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """Times and largest spin of each run; the drawn runs over time."""
    rows = [
        (law, 100.0 * s[0], 100.0 * s[1], r.lifts(measured.setup), r.gone(measured.setup), float(r.spin.max()))
        for (law, k), r in measured.runs.items()
        for s in [measured.setup.starts[k]]
    ]
    motion = [
        (law, *map(float, row))
        for law in LAWS
        for r in [measured.runs[law, 0]]
        for row in zip(r.times, r.spin, r.touching, strict=True)
    ]
    columns = (
        "law",
        "off the middle, x [cm]",
        "z [cm]",
        "lifts off after [s]",
        "gone after [s]",
        "largest angular velocity [rad/s]",
    )
    return {
        "": Table(columns, rows),
        "motion": Table(("law", "time [s]", "angular velocity [rad/s]", "share of the mass that touches"), motion),
    }


def here(measured: Measured) -> str:
    """When the cloth lifts off and is gone, and its spin, per law."""
    count = len(measured.setup.starts)
    words = []
    for law in LAWS:
        spin = measured.each(law, lambda run: float(run.spin.max())).mean()
        words.append(f"{law} {measured.lifts(law).mean():.2f} s, {measured.gone(law).mean():.2f} s, {spin:.1f} rad/s")
    starts = "one start" if count == 1 else f"mean of {count} starts"
    return (
        "after the sphere's start a quarter of what touched has lifted, the cloth has slid off, and its largest spin, "
        f"{starts}: {'; '.join(words)}"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order of spin and of lifting off."""
    source, s = "thesis 7.5, figure 7.8", measured.setup
    spins = {law: measured.each(law, lambda run: float(run.spin[_turning(run, s)].mean())) for law in DRAWN}
    count = float(len(s.starts))
    return [
        Check("starts from which the cloth spins faster with CSSV", float(np.sum(spins["CSSV"] > spins["C"])), count,
              0.0, source),
        Check("starts from which it lifts off earlier with CSSV",
              float(np.sum(measured.lifts("CSSV") < measured.lifts("C"))), count, 0.0, source),
        Check("largest angular velocity over the sphere's", max(_fastest(run, s) for run in measured.runs.values()),
              0.5, 0.5, "friction drags, it does not drive: between 0 and 1"),
    ]  # fmt: skip


def _turning(run: Run, setup: Setup) -> Any:
    """The frames from 0.3 s to 0.9 s after the sphere's start."""
    return (run.times >= setup.settling + 0.3) & (run.times <= setup.settling + 0.9)


def _fastest(run: Run, setup: Setup) -> float:
    """Largest ratio of the cloth's angular velocity to the sphere's, after the first tenth of a second."""
    frames = (run.times >= setup.settling + 0.1) & (run.times <= setup.settling + 0.9)
    return float((run.spin[frames] / ((run.times[frames] - setup.settling) * setup.acceleration)).max())


def draw(measured: Measured) -> bytes:
    """C and CSSV at four moments, then spin, touching share and cast-off times."""
    s = measured.setup
    note = (
        f"A cloth of {100 * s.side:.0f} cm on a sphere of {200 * s.radius:.0f} cm that turns at {s.acceleration:g} "
        f"rad/s² from {s.settling:g} s on. Sizes, weight and acceleration are chosen; coefficients as in the thesis."
    )
    figure = pictures.figure("Figure 7.8: a cloth on an accelerating sphere", (16.0, 11.6), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.7, 1.0])
    states = [state for law in DRAWN for state in measured.runs[law, 0].states]
    images = pictures.tiles(measured.bodies, states, np.zeros((0, 3)), size=(520, 440))
    count = len(measured.moments)
    axes = upper.subplots(len(DRAWN), count)
    for row, law in enumerate(DRAWN):
        run = measured.runs[law, 0]
        for column, moment in enumerate(measured.moments):
            spin = abs(float(run.spin[round(moment * FPS)]))
            sphere = max(0.0, moment - s.settling) * s.acceleration
            words = f"{moment:.2f} s: sphere {sphere:.0f}, cloth {spin:.1f} rad/s"
            pictures.show(axes[row, column], images[row * count + column], law if column == 0 else "", words)
    spin, touch, off = lower.subplots(1, 3)
    pictures.tidy(spin, "angular velocity of the cloth [rad/s]", "time [s]")
    pictures.tidy(touch, "share of its mass that touches the sphere", "time [s]")
    pictures.tidy(off, "lifts off (filled), is gone (open) after [s]")
    for number, law in enumerate(LAWS):
        run, colour = measured.runs[law, 0], COLOURS[law]
        gone = run.gone(s)
        end = round((s.settling + (gone if np.isfinite(gone) else s.duration)) * FPS) + 1
        spin.plot(run.times[:end], run.spin[:end], color=colour, linewidth=1.7, label=law)
        touch.plot(run.times[:end], run.touching[:end], color=colour, linewidth=1.7)
        for times, face in ((measured.lifts(law), colour), (measured.gone(law), "white")):
            off.plot([number] * len(times), times, "o", color=colour, markersize=7, markerfacecolor=face)
            off.hlines(np.nanmean(times) if np.isfinite(times).any() else np.nan, number - 0.3, number + 0.3,
                       color=colour, linewidth=2.0)  # fmt: skip
    times = measured.runs["C", 0].times
    spin.plot(times, np.maximum(0.0, times - s.settling) * s.acceleration, color=pictures.FAINT, linewidth=1.0,
              label="sphere")  # fmt: skip
    spin.set_xlim(0.0, touch.get_xlim()[1])
    spin.set_ylim(0.0, 1.25 * max(float(measured.runs[law, 0].spin.max()) for law in LAWS))
    spin.legend(frameon=False, fontsize=9.5, loc="upper left")
    off.set_xticks(range(len(LAWS)), LAWS)
    off.set_ylim(bottom=0.0)
    return pictures.png(figure)
