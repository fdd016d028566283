"""Figure 7.4: a walking figure in a skirt, under Coulomb friction and with stiction and Stribeck friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._frames import moving_positions, standing_positions
from clothsim.recording import Body
from clothsim.reproduce import mannequin, pictures, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, GRAVITY, TABLE_7_1
from clothsim.reproduce.wrinkles import Wrinkles
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "μ_c = 0.2, μ_s = 0.4 (self contact 0.1, 0.2): with CSS more and finer wrinkles form in the skirt and hold longer "
    "than with C"
)

COEFFICIENTS = TABLE_7_1["skirt"]
LAWS = ("C", "CSS")
FPS = 50.0
LAST = 0.3  # s at the end, over which what is left is averaged


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    around: int = 72
    rows: int = 18
    length: float = 0.5
    flare: float = 0.03  # how much wider the hem's radius is than the waist's
    areal_density: float = 0.15
    stretch: float = 500.0
    shear: float = 30.0
    in_plane_damping: float = 5e-4
    rigidity: float = 2e-6
    bending_damping: float = 2e-3
    air_damping: float = 0.2
    thickness: float = 3e-3
    periods: tuple[float, ...] = (0.95, 1.0, 1.05, 1.1, 1.15)  # of two steps: a gait each, that in the middle is drawn
    lead: int = 0  # whole periods before the measured ones, after the steps have their full length
    cycles: int = 1  # whole periods that are measured
    halting: float = 0.6  # s in which the figure comes to a stand
    standing: float = 0.7  # s
    dt: float = 4e-3


@dataclass(frozen=True)
class Run:
    """One law in one gait.

    Attributes
    ----------
    folds : (frames,) float64
        Root mean square of the hinges' curvature [1/m].
    mean : float
        Its mean over the measured periods [1/m].
    left : float
        Its mean over the last `LAST` seconds, when the figure has stood still for a while [1/m].
    sharp : float
        Share of the area whose curvature is above `SHARP`, mean over the measured periods.
    states : list of (n, 3) float64
        A quarter of a period apart, the last at the end [m].
    """

    folds: Floats
    mean: float
    left: float
    sharp: float
    states: list[Floats]
    intersections: int


SHARP = 50.0  # 1/m: bent to a radius of 2 cm or less


@dataclass(frozen=True)
class Measured:
    """All runs."""

    setup: Setup
    runs: dict[tuple[str, float], Run]
    bodies: list[Body]
    standing: Floats

    @property
    def shown(self) -> float:
        """The period of the gait that is drawn [s]."""
        return self.setup.periods[len(self.setup.periods) // 2]

    def mean(self, law: str, name: str) -> float:
        """Mean over the gaits of a number of each run."""
        return float(np.mean([getattr(self.runs[law, period], name) for period in self.setup.periods]))

    def difference(self, name: str) -> tuple[float, float]:
        """How much larger a number is with CSS than with C: mean of the gaits and its standard error."""
        each = [getattr(self.runs["CSS", p], name) - getattr(self.runs["C", p], name) for p in self.setup.periods]
        return float(np.mean(each)), float(np.std(each, ddof=1) / np.sqrt(len(each)))


def measure(effort: Effort) -> Measured:
    """Let the figure walk in both skirts, in each gait."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, around=44, rows=11, periods=(1.05,), dt=5e-3)
    jobs = [(law, period) for period in setup.periods for law in LAWS]
    frames = sum(round(_window(setup, period)[2] * FPS) for _, period in jobs)
    with effort.bar(frames, "figure 7.4", "frame") as bar:
        found = effort.each(lambda job: _run(*job, setup, bar.update), jobs, bar)
    simulation = Simulation(_scene("C", setup, setup.periods[0]), threads=1)
    standing = standing_positions(simulation.bodies, simulation.collider_positions)
    return Measured(setup, dict(zip(jobs, found, strict=True)), simulation.bodies, standing)


def _window(setup: Setup, period: float) -> tuple[float, float, float]:
    """Beginning and end of the measured periods, and of the run [s]."""
    walk = mannequin.Walk(period=period)
    begin = round(walk.start + walk.rise + setup.lead * period, 2)
    stop = begin + setup.cycles * period
    return begin, stop, round(stop + setup.halting + setup.standing, 2)


def halt(walk: mannequin.Walk, stop: float, halting: float) -> mannequin.Motion:
    """Walk until ``stop`` [s], and come to a stand within ``halting`` [s]."""

    def pose(time: float) -> mannequin.Pose:
        much = 1.0 - mannequin.smooth((time - stop) / halting)
        walking, standing = walk(time), mannequin.Pose()

        def mix(a: Any, b: Any) -> Any:
            return tuple(map(mix, a, b)) if isinstance(a, tuple) else much * a + (1.0 - much) * b

        names = [field.name for field in fields(mannequin.Pose)]
        return mannequin.Pose(**{name: mix(getattr(walking, name), getattr(standing, name)) for name in names})

    return pose


def _run(law: str, period: float, setup: Setup, tick: Callable[[], Any]) -> Run:
    begin, stop, end = _window(setup, period)
    simulation = Simulation(_scene(law, setup, period), threads=1)
    bodies = simulation.bodies
    wrinkles = Wrinkles(mannequin.skirt(setup.around, setup.rows, length=setup.length, flare=setup.flare)[0])
    frames = round(end * FPS)
    shown = [round(moment * FPS) for moment in _moments(setup, period)]
    path, states = [wrinkles.curvature(simulation.positions)], []
    for frame in range(1, frames + 1):
        simulation.advance(1.0 / FPS)
        path.append(wrinkles.curvature(simulation.positions))
        if frame in shown:
            states.append(moving_positions(bodies, simulation.positions, simulation.collider_positions))
        tick()
    curvature = np.array(path)
    folds = np.array([wrinkles.rms(k) for k in curvature])
    inside = slice(round(begin * FPS), round(stop * FPS) + 1)
    measured = curvature[inside]
    sharp = float(np.mean((np.abs(measured) > SHARP) @ wrinkles.weights))
    return Run(
        folds,
        float(folds[inside].mean()),
        float(folds[-round(LAST * FPS) :].mean()),
        sharp,
        states,
        len(simulation.intersections()),
    )


def _moments(setup: Setup, period: float) -> list[float]:
    """What is drawn: three moments of the last period, a third apart, and the end [s]."""
    _, stop, end = _window(setup, period)
    return [stop - period * part for part in (0.75, 0.5, 0.25)] + [end]


def _scene(law: str, setup: Setup, period: float) -> Scene:
    s = setup
    _, stop, duration = _window(setup, period)
    scene = Scene(
        name=law,
        duration=duration,
        gravity=[0.0, -GRAVITY, 0.0],
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={
            "thickness": s.thickness, "friction": COEFFICIENTS.friction(law, s.areal_density),
            "self_friction": COEFFICIENTS.self_friction(law, s.areal_density),
        },
    )  # fmt: skip
    mannequin.add(scene, halt(mannequin.Walk(period=period), stop, s.halting), duration)
    mesh, waist = mannequin.skirt(s.around, s.rows, length=s.length, flare=s.flare)
    scene.add_cloth(
        mesh,
        residual.fabric(
            s.areal_density, s.stretch, s.shear, s.in_plane_damping,
            {"model": "hinge", "rigidity": s.rigidity, "damping": s.bending_damping},
        ),
        name="skirt",
        pins=[{"vertices": waist, "collider": "pelvis"}],
    )  # fmt: skip
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    begin, stop, end = _window(measured.setup, measured.shown)
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "triangles": len(measured.bodies[0].triangles), "mannequin": "capsules that walk on the spot",
        "period drawn [s]": measured.shown, "measured from [s]": begin, "measured to [s]": stop, "end [s]": end,
        "frames per second": FPS, "chosen": "all but the coefficients: the thesis does not state them",
    }  # fmt: skip


_COLUMNS = ("rms curvature [1/m]", f"area bent above {SHARP:g}/m, share", "rms curvature left when standing [1/m]")


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law and gait; curvature over time of the gait that is drawn."""
    rows = [(law, period, r.mean, r.sharp, r.left) for (law, period), r in measured.runs.items()]
    time = [
        (law, frame / FPS, float(k)) for law in LAWS for frame, k in enumerate(measured.runs[law, measured.shown].folds)
    ]
    return {
        "": Table(("law", "period [s]", *_COLUMNS), rows),
        "motion": Table(("law", "time [s]", "rms curvature [1/m]"), time),
    }


def here(measured: Measured) -> str:
    """Wrinkles and how long they hold, per law."""
    count = len(measured.setup.periods)
    gaits = "one gait" if count == 1 else f"means over {count} gaits"
    words = [
        f"{law} {measured.mean(law, 'mean'):.1f}/m, {100.0 * measured.mean(law, 'sharp'):.1f} %, "
        f"{measured.mean(law, 'left'):.1f}/m"
        for law in LAWS
    ]
    text = (
        f"rms curvature of the skirt, area bent above {SHARP:g}/m, and rms curvature left when it has stood still, "
        f"{gaits}: {'; '.join(words)}"
    )
    if count > 1:
        more, scatter = measured.difference("mean")
        text += f"; CSS − C {more:+.2f} ± {scatter:.2f}/m while walking (mean and standard error of the gaits)"
    return text


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order, as means over several gaits; no intersections."""
    source = "thesis 7.5, figure 7.4"
    crossing = float(sum(run.intersections for run in measured.runs.values()))
    reason = "a step that starts without intersections ends without"
    found = [Check("pairs of triangles that intersect at the end", crossing, 0.0, 0.0, reason)]
    if len(measured.setup.periods) > 2:  # folds of one gait are a matter of chance
        values = {name: [measured.mean(law, name) for law in LAWS] for name in ("mean", "sharp")}
        found += [
            Check.true("more wrinkles with CSS: rms curvature", values["mean"][1] > values["mean"][0], source),
            Check.true("finer wrinkles with CSS: area bent sharply", values["sharp"][1] > values["sharp"][0], source),
        ]
    return found


def draw(measured: Measured) -> bytes:
    """Both skirts at four moments, then curvature over time and all gaits."""
    s, period = measured.setup, measured.shown
    note = (
        f"A skirt of {100 * s.length:.0f} cm, {len(measured.bodies[0].triangles):,} triangles, on a figure that walks "
        f"on the spot; drawn are {2.0 / period:.1f} steps a second. Sizes, weight, stiffness and gaits are chosen; "
        "coefficients as in the thesis."
    )
    figure = pictures.figure("Figure 7.4: walking in a skirt", (16.0, 12.6), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[2.3, 1.0])
    drawn = {law: measured.runs[law, period] for law in LAWS}
    states = [state for law in LAWS for state in drawn[law].states]
    images = pictures.tiles(measured.bodies, states, measured.standing, size=(560, 520))
    axes = upper.subplots(len(LAWS), 4)
    moments = _moments(s, period)
    for row, law in enumerate(LAWS):
        for column in range(4):
            title = law if column == 0 else ""
            words = f"{moments[column]:.2f} s{'' if column < 3 else ', standing'}"
            pictures.show(axes[row, column], images[4 * row + column], title, words)
    time, gaits, left = lower.subplots(1, 3)
    pictures.tidy(time, "wrinkles: rms curvature [1/m]", "time [s]")
    pictures.tidy(gaits, "all gaits: its mean while walking [1/m]", "period [s]")
    pictures.tidy(left, "all gaits: left when standing [1/m]", "period [s]")
    for law, run in drawn.items():
        style = {"color": COLOURS[law], "linewidth": 1.7}
        time.plot(np.arange(len(run.folds)) / FPS, run.folds, label=law, **style)
        each = [measured.runs[law, p] for p in s.periods]
        gaits.plot(s.periods, [r.mean for r in each], marker="o", markersize=6, **style)
        left.plot(s.periods, [r.left for r in each], marker="o", markersize=6, **style)
    time.axvspan(*_window(s, period)[:2], color=pictures.GRID, alpha=0.5, linewidth=0)
    time.legend(frameon=False, fontsize=9.5, loc="lower right")
    return pictures.png(figure)
