"""Figure 7.5: stick–slip of a cloth whose lower part lies on the ground while its upper edge moves on steadily."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._frames import moving_positions, standing_positions
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import pictures, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, GRAVITY, TABLE_7_1
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "μ_c = 0.1, μ_s = 0.4: with CSS the lower part sticks until the pull reaches stiction, slips, and sticks again, "
    "periodically; with C it moves much smoother"
)

COEFFICIENTS = TABLE_7_1["stick-slip"]
LAWS = ("C", "CS", "CSS")
OTHER = "CSS, constraints"  # the same with the other contact method, at four times the step
VARIANTS = (*LAWS, OTHER)
FPS = 100.0


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    length: float = 0.36
    width: float = 0.12
    height: float = 0.16  # of the edge that is held
    bend: float = 0.03  # radius at the start, between hanging and lying part
    cell: float = 0.015
    areal_density: float = 0.15
    stretch: float = 40.0
    shear: float = 8.0
    rigidity: float = 1e-6
    damping: float = 1e-3
    air_damping: float = 1.0
    thickness: float = 3e-3
    speed: float = 0.03  # of the held edge …
    start: float = 0.2  # … from this time on
    duration: float = 8.0
    measured_from: float = 1.5
    dt: float = 5e-4  # stretch · dt² < areal density · cell²: else stick and slip of single vertices shake the cloth


@dataclass(frozen=True)
class Run:
    """One law.

    Attributes
    ----------
    times : (frames,) float64
        [s]
    way, velocity : (frames,) float64
        Mean displacement and velocity of the lower part [m], [m/s].
    pull : (frames,) float64
        What the hanging part pulls the lying one with, over the lying one's weight; without the parts' inertia.
    states : list of (n, 3) float64
        Positions at the moments shown [m].
    """

    times: Floats
    way: Floats
    velocity: Floats
    pull: Floats
    states: list[Floats]


@dataclass(frozen=True)
class Cycle:
    """From stick to stick: when the lower part breaks loose and stops [s], how far it slips [m]."""

    loose: float
    stop: float
    slip: float
    pull: float


@dataclass(frozen=True)
class Measured:
    """All runs."""

    setup: Setup
    runs: dict[str, Run]
    cycles: dict[str, list[Cycle]]
    moments: list[float]
    bodies: list[Body]
    standing: Floats

    def steady(self, law: str) -> Any:
        """The frames that are measured."""
        return self.runs[law].times >= self.setup.measured_from

    def stuck(self, law: str) -> float:
        """Share of the measured time for which the lower part is at rest."""
        return float(_rests(self.runs[law].velocity, self.setup)[self.steady(law)].mean())

    def periods(self, law: str) -> Floats:
        """Times between breaking loose [s]."""
        return np.diff([cycle.loose for cycle in self.cycles[law]])


def _rests(velocity: Floats, setup: Setup) -> Any:
    return np.abs(velocity) < 0.02 * setup.speed


def measure(effort: Effort) -> Measured:
    """Pull the cloth, once for each law."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, cell=0.02, dt=1e-3, duration=6.0)
    moments = [0.0, 1.5, 3.0, 4.5]
    with effort.bar(round(setup.duration * FPS) * len(VARIANTS), "figure 7.5", "frame") as bar:
        found = effort.each(lambda name: _run(name, setup, moments, bar.update), VARIANTS, bar)
    runs = dict(zip(VARIANTS, found, strict=True))
    simulation = Simulation(_scene("C", setup), threads=1)
    standing = standing_positions(simulation.bodies, simulation.collider_positions)
    cycles = {law: _cycles(run, setup) for law, run in runs.items()}
    return Measured(setup, runs, cycles, moments, simulation.bodies, standing)


def _run(variant: str, setup: Setup, moments: Sequence[float], tick: Callable[[], Any]) -> Run:
    simulation = Simulation(_scene(variant, setup), threads=1)
    bodies, masses = simulation.bodies, simulation.masses
    place = _sheet(setup)[1]
    low = place < 0.5 * _lying(setup)
    top = place > setup.length - 1e-9
    begin = simulation.positions[low, 0].mean()
    shown = {round(moment * FPS) for moment in moments}
    rows, states = [], []
    for frame in range(round(setup.duration * FPS) + 1):
        if frame > 0:
            simulation.advance(1.0 / FPS)
            tick()
        x, v = simulation.positions, simulation.velocities
        rows.append((frame / FPS, x[low, 0].mean() - begin, v[low, 0].mean(), _pull(x, masses, top, setup)))
        if frame in shown:
            states.append(moving_positions(bodies, x, simulation.collider_positions))
    columns = np.array(rows).T
    return Run(columns[0], columns[1], columns[2], columns[3], states)


def _pull(x: Floats, masses: Floats, top: Any, setup: Setup) -> float:
    """Horizontal pull at the foot of the hanging part over the lying part's weight, by moments about the held edge."""
    hangs = x[:, 1] > 1.05 * setup.thickness
    edge = x[top].mean(axis=0)
    moment = float(np.sum(masses[hangs] * (edge[0] - x[hangs, 0])))
    return float(moment / (edge[1] - setup.thickness) / masses[~hangs].sum())


def _cycles(run: Run, setup: Setup) -> list[Cycle]:
    """Slips in the measured time, each between two rests of at least three frames."""
    rests = _rests(run.velocity, setup)
    settled = rests.copy()
    for k in range(len(rests)):  # a passing zero of the velocity is no rest
        left, right = max(0, k - 2), k + 3
        settled[k] = rests[k] and any(rests[j : j + 3].all() for j in range(left, min(right, len(rests)) - 2))
    cycles = []
    changes = np.flatnonzero(np.diff(settled.astype(int)))
    for a, b in itertools.pairwise(changes):
        if settled[a] and not settled[a + 1] and run.times[a] >= setup.measured_from:
            cycles.append(
                Cycle(float(run.times[a]), float(run.times[b]), float(run.way[b] - run.way[a]), float(run.pull[a]))
            )
    return cycles


def _lying(setup: Setup) -> float:
    """Length of the part that lies on the ground at the start [m]."""
    return setup.length - (setup.height - setup.thickness - setup.bend) - 0.5 * math.pi * setup.bend


def _sheet(setup: Setup) -> tuple[Mesh, Floats]:
    """The cloth as it starts, undeformed in its UV panel, and each vertex's distance from its free end [m]."""
    s = setup
    grid = Mesh.grid(s.length, s.width, round(s.length / s.cell) + 1, round(s.width / s.cell) + 1)
    place: Floats = grid.vertices[:, 0] + 0.5 * s.length
    lying = _lying(s)
    angle = np.clip((place - lying) / s.bend, 0.0, 0.5 * math.pi)
    above = np.maximum(place - lying - 0.5 * math.pi * s.bend, 0.0)
    x = np.minimum(place, lying) + s.bend * np.sin(angle) - lying - s.bend
    y = s.thickness + s.bend * (1.0 - np.cos(angle)) + above
    across = grid.vertices[:, 2]
    return Mesh(np.column_stack([x, y, across]), grid.triangles, np.column_stack([place, across])), place


def _scene(variant: str, setup: Setup) -> Scene:
    s, law = setup, variant.split(",", maxsplit=1)[0]
    scene = Scene(
        name=variant,
        duration=s.duration,
        gravity=[0.0, -GRAVITY, 0.0],
        time={"dt": 4.0 * s.dt if variant == OTHER else s.dt},
        air={"damping": s.air_damping},
        contact={
            "method": "constraints" if variant == OTHER else "velocity-filter", "thickness": s.thickness,
            "friction": COEFFICIENTS.friction(law, s.areal_density),
            "self_friction": COEFFICIENTS.self_friction(law, s.areal_density),
        },
    )  # fmt: skip
    mesh, place = _sheet(s)
    end = s.duration - s.start
    motion = [{"time": s.start}, {"time": s.duration, "position": [s.speed * end, 0.0, 0.0]}]
    scene.add_cloth(
        mesh,
        residual.fabric(
            s.areal_density, s.stretch, s.shear, s.damping, {"model": "hinge", "rigidity": s.rigidity, "damping": 2e-3}
        ),
        name="cloth",
        rest="uv",
        pins=[{"vertices": np.flatnonzero(place > s.length - 1e-9).tolist(), "keyframes": motion}],
    )
    low, high = -_lying(s) - 0.12, s.speed * end + 0.1
    scene.add_collider(
        "ground",
        shape={"type": "box", "half_extents": [0.5 * (high - low), 0.01, 0.5 * s.width + 0.05]},
        position=[0.5 * (high + low), -0.01, 0.0],
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "lower part": "the half farther from the bend of what lies on the ground at the start",
        "at rest": "slower than 2 % of the held edge, for three frames", "frames per second": FPS,
        "chosen": "all but the coefficients: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law; motion at each frame; every slip."""
    columns = (
        "law", "share of time at rest", "slips", "period [s]", "spread of the period [s]", "slip [m]",
        "pull when breaking loose over weight", "smallest velocity [m/s]", "largest velocity [m/s]",
    )  # fmt: skip
    rows = []
    for law, run in measured.runs.items():
        cycles, steady = measured.cycles[law], measured.steady(law)
        periods = measured.periods(law)
        mean = [float(np.mean(part)) if len(part) else math.nan
                for part in (periods, [c.slip for c in cycles], [c.pull for c in cycles])]  # fmt: skip
        spread = float(np.std(periods)) if len(periods) else math.nan
        velocity = run.velocity[steady]
        rows.append((law, measured.stuck(law), len(cycles), mean[0], spread, mean[1], mean[2],
                     float(velocity.min()), float(velocity.max())))  # fmt: skip
    motion = [
        (law, *map(float, row))
        for law, run in measured.runs.items()
        for row in zip(run.times, run.way, run.velocity, run.pull, strict=True)
    ]
    slips = [(law, c.loose, c.stop, c.slip, c.pull) for law, cycles in measured.cycles.items() for c in cycles]
    return {
        "": Table(columns, rows),
        "motion": Table(("law", "time [s]", "displacement [m]", "velocity [m/s]", "pull over weight"), motion),
        "slips": Table(("law", "breaks loose [s]", "stops [s]", "slip [m]", "pull over weight"), slips),
    }


def here(measured: Measured) -> str:
    """Share at rest, period and slip per law."""
    words = []
    for law in VARIANTS:
        cycles = measured.cycles[law]
        text = f"{law} rests {100.0 * measured.stuck(law):.0f} % of the time"
        if len(cycles) > 1:
            slips = 100.0 * np.mean([c.slip for c in cycles])
            pulls = np.mean([c.pull for c in cycles])
            text += (
                f", slips {slips:.1f} cm every {measured.periods(law).mean():.2f} s once pulled by {pulls:.2f} of its "
                "weight"
            )
        words.append(text)
    return f"held edge at {100.0 * measured.setup.speed:g} cm/s: {'; '.join(words)}"


def _mean(values: Any) -> float:
    """Mean, NaN of nothing."""
    return float(np.mean(values)) if len(values) else math.nan


def checks(measured: Measured) -> Sequence[Check]:
    """Stick–slip where the thesis finds it and nowhere else; both contact methods alike."""
    source, s = "thesis 7.5, figure 7.5", measured.setup
    found = [
        Check("C: share of the time at rest", measured.stuck("C"), 0.0, 0.0, f"{source}: smooth"),
        Check("C: slips", float(len(measured.cycles["C"])), 0.0, 0.0, source),
    ]
    for law in ("CS", "CSS"):
        cycles = measured.cycles[law]
        pull = _mean([c.pull for c in cycles])
        found += [
            Check.true(f"{law}: sticks and slips, more than once", len(cycles) > 1, source),
            Check.true(f"{law}: the pull that breaks loose lies between sliding and static friction",
                       COEFFICIENTS.mu_c < pull < COEFFICIENTS.mu_s, "an elastic sheet gives way from its edge on"),
        ]  # fmt: skip
    every = [_mean(measured.periods(variant)) for variant in ("CSS", OTHER)]
    slips = [_mean([cycle.slip for cycle in measured.cycles[variant]]) for variant in ("CSS", OTHER)]
    periods = measured.periods("CSS")
    spread = float(np.std(periods)) / every[0] if len(periods) > 1 else math.nan
    either = "two contact methods, one law"
    glide = float(measured.runs["C"].pull[measured.steady("C")].mean())
    expected = COEFFICIENTS.mu_c + s.air_damping * s.speed / GRAVITY
    row = s.cell / (0.5 * _lying(s))
    return [
        *found,
        Check("CSS: spread of the period, relative", spread, 0.0, 0.1, f"{source}: periodically"),
        Check("CSS: period with constraints over that with the filter", every[1] / every[0], 1.0, 0.1, either),
        Check("CSS: slip with constraints over that with the filter", slips[1] / slips[0], 1.0, 0.1, either),
        Check("C: mean pull while gliding, over the lying weight", glide, expected, row * expected,
              "μ_c, and the air's share c v/g; to one row of the mesh, of which a part is lifted"),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """C and CSS at four moments, then displacement, velocity and pull."""
    s = measured.setup
    note = (
        f"A cloth of {100 * s.width:.0f} cm × {100 * s.length:.0f} cm; its upper edge moves at {100 * s.speed:g} cm/s. "
        "Size, weight, speed and air damping are chosen; coefficients as in the thesis: μ_c = 0.1, μ_s = 0.4."
    )
    figure = pictures.figure("Figure 7.5: stick–slip", (16.0, 11.0), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.15, 1.0])
    shown = ("C", "CSS")
    states = [state for law in shown for state in measured.runs[law].states]
    images = pictures.tiles(measured.bodies, states, measured.standing, size=(560, 380))
    count = len(measured.moments)
    axes = upper.subplots(len(shown), count)
    for row, law in enumerate(shown):
        for column, moment in enumerate(measured.moments):
            title = law if column == 0 else ""
            pictures.show(axes[row, column], images[row * count + column], title, f"{moment:.1f} s")
    way, velocity, pull = lower.subplots(1, 3)
    pictures.tidy(way, "displacement of the lower part [cm]", "time [s]")
    pictures.tidy(velocity, "its velocity [cm/s]", "time [s]")
    pictures.tidy(pull, "pull over the lying part's weight", "time [s]")
    for law in LAWS:
        run = measured.runs[law]
        style = {"color": COLOURS[law], "linewidth": 1.7}
        way.plot(run.times, 100.0 * run.way, label=law, **style)
        velocity.plot(run.times, 100.0 * run.velocity, **style)
        pull.plot(run.times, run.pull, **style)
    other = measured.runs[OTHER]
    style = {"color": pictures.INK, "linewidth": 1.1, "linestyle": (0, (4, 2)), "zorder": 5}
    way.plot(other.times, 100.0 * other.way, label=OTHER, **style)
    velocity.plot(other.times, 100.0 * other.velocity, **style)
    edge = np.maximum(0.0, measured.runs["C"].times - s.start) * s.speed
    way.plot(measured.runs["C"].times, 100.0 * edge, color=pictures.FAINT, linewidth=1.0, label="held edge")
    for value, name in ((COEFFICIENTS.mu_s, "$μ_s$"), (COEFFICIENTS.mu_c, "$μ_c$")):
        pull.axhline(value, color=pictures.FAINT, linewidth=1.0, linestyle=(0, (4, 3)))
        pull.annotate(name, (0.0, value), xytext=(2, 3), textcoords="offset points", fontsize=9, color=pictures.FAINT)
    pull.set_ylim(0.0, 1.25 * COEFFICIENTS.mu_s)
    way.legend(frameon=False, fontsize=9.5)
    return pictures.png(figure)
