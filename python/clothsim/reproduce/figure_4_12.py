"""Figure 4.12: a walking figure in a skirt; how much the skirt swings under four bending laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._frames import moving_positions, standing_positions
from clothsim.recording import Body
from clothsim.reproduce import mannequin, pictures, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import Loop
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 3.4, b2 = 2.0, c1 = −0.45 (K0 = 0.5π), λ = 0.15, μ = 0.02: the plastic law swings about as much as the one "
    "without plasticity and hysteresis, as few elements pass the elastic limit; hysteresis gives a more stable waving "
    "and fewer folds"
)

FABRIC = Loop(b1=3.4, b2=2.0, c1=-0.45, plasticity=0.15, fatigue=0.02)
LAWS = ("linear", "nonlinear", "plastic", "hysteresis")
FPS = 100.0
FOLDS = 5  # angular waves of the hem from here on count as folds; fewer are its swing


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    around: int = 64
    rows: int = 14
    length: float = 0.5
    flare: float = 0.2  # how much wider the hem's radius is than the waist's
    areal_density: float = 0.15
    stretch: float = 500.0
    shear: float = 50.0
    in_plane_damping: float = 2e-4
    air_damping: float = 0.05
    friction: float = 0.2
    self_friction: float = 0.2
    thickness: float = 3e-3
    periods: tuple[float, ...] = (0.95, 1.05, 1.15)  # of two steps: a gait each, the second is drawn
    lead: int = 2  # whole periods before the measured ones, after the steps have their full length
    cycles: int = 4  # whole periods that are measured
    dt: float = 3e-3


@dataclass(frozen=True)
class Run:
    """One law in one gait.

    Attributes
    ----------
    motion : (frames,) float64
        Root mean square velocity of the skirt in the pelvis's frame, mass weighted [m/s].
    spectrum, frequencies : (frequencies,) float64
        Power of that velocity, mean over the skirt's mass [m²/s² per Hz], over the measured periods.
    swing : float
        Root mean square of that velocity over the measured periods [m/s].
    unsteady : float
        Root mean square of its part that does not repeat from period to period [m/s].
    folds : float
        Root mean square of the hem's radius in angular waves `FOLDS` and up [m].
    largest : float
        Largest |curvature| of 99 % of the skirt's hinges [1/m].
    states : list of (n, 3) float64
        Positions of what moves, a quarter of a period apart, the last at the end.
    hem : (n, 3) float64
        The hem at the end in the pelvis's frame [m].
    """

    motion: Floats
    spectrum: Floats
    frequencies: Floats
    swing: float
    unsteady: float
    folds: float
    largest: float
    states: list[Floats]
    hem: Floats


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


def measure(effort: Effort) -> Measured:
    """Let the figure walk in four skirts, in each gait."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, around=36, rows=8, periods=(1.0,), lead=1, cycles=2, dt=5e-3)
    jobs = [(law, period) for period in setup.periods for law in LAWS]
    frames = sum(round(_window(setup, period)[1] * FPS) for _, period in jobs)
    with effort.bar(frames, "figure 4.12", "frame") as bar:
        found = effort.each(lambda job: _run(*job, setup, bar.update), jobs, bar)
    simulation = Simulation(_scene("linear", setup, mannequin.Walk(), 0.1), threads=1)
    bodies = simulation.bodies
    standing = standing_positions(bodies, simulation.collider_positions)
    return Measured(setup, dict(zip(jobs, found, strict=True)), bodies, standing)


def _window(setup: Setup, period: float) -> tuple[float, float]:
    """Beginning and end of the measured periods [s]."""
    walk = mannequin.Walk(period=period)
    begin = round(walk.start + walk.rise + setup.lead * period, 2)
    return begin, begin + setup.cycles * period


def _run(law: str, period: float, setup: Setup, tick: Callable[[], Any]) -> Run:
    walk, window = mannequin.Walk(period=period), _window(setup, period)
    simulation = Simulation(_scene(law, setup, walk, window[1]), threads=1)
    bodies, masses = simulation.bodies, simulation.masses
    hinges = residual.interior_edges(bodies[0].triangles)
    frames = round(window[1] * FPS)
    shown = [frames - round(k * 0.25 * period * FPS) for k in (3, 2, 1, 0)]
    local = [_in_pelvis(simulation.positions, walk, 0.0)]
    states, bent = [], []
    flat = residual.dihedrals(simulation.positions, hinges)
    heights = _heights(simulation.positions, hinges)
    for frame in range(1, frames + 1):
        simulation.advance(1.0 / FPS)
        local.append(_in_pelvis(simulation.positions, walk, simulation.time))
        if frame % 10 == 0:
            angles = np.abs(residual.dihedrals(simulation.positions, hinges) - flat) / heights
            bent.append(float(np.percentile(angles, 99)))
        if frame in shown:
            states.append(moving_positions(bodies, simulation.positions, simulation.collider_positions))
        tick()
    path = np.array(local)
    velocity = np.gradient(path, 1.0 / FPS, axis=0)
    weights = masses / masses.sum()
    motion = np.sqrt(np.einsum("fvk,v->f", velocity**2, weights))
    first, count = round(window[0] * FPS), round((window[1] - window[0]) * FPS)
    inside = velocity[first : first + count]
    lines = np.abs(np.fft.rfft(inside, axis=0)) ** 2 / count / FPS
    lines[1:] *= 2.0
    return Run(
        motion=motion,
        spectrum=np.einsum("fvk,v->f", lines, weights),
        frequencies=np.asarray(np.fft.rfftfreq(count, 1.0 / FPS), dtype=np.float64),
        swing=float(np.sqrt(np.mean(motion[first : first + count] ** 2))),
        unsteady=_unsteady(inside, setup.cycles, weights),
        folds=_folds(path[first : first + count, -setup.around :]),
        largest=max(bent),
        states=states,
        hem=path[-1, -setup.around :],
    )


def _heights(x: Floats, hinges: Ints) -> Floats:
    """h̄: mean of the two heights over each edge [m]."""
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    edge = b - a
    areas = np.linalg.norm(np.cross(edge, c - a), axis=1) + np.linalg.norm(np.cross(edge, d - a), axis=1)
    heights: Floats = 0.5 * areas / np.linalg.norm(edge, axis=1)
    return heights


def _in_pelvis(x: Floats, walk: mannequin.Walk, time: float) -> Floats:
    place, rotation = mannequin.frame(walk(time))
    local: Floats = (x - place) @ rotation
    return local


def _unsteady(velocity: Floats, cycles: int, weights: Floats) -> float:
    """What is left of the velocity (frames, n, 3) when its mean over the periods is taken away [m/s]."""
    frames = len(velocity) // cycles
    by_period = velocity[: frames * cycles].reshape(cycles, frames, *velocity.shape[1:])
    left = by_period - by_period.mean(axis=0)
    # Degrees of freedom: the mean itself is made of these periods.
    return float(np.sqrt(np.einsum("cfvk,v->", left**2, weights) / (frames * (cycles - 1))))


def _folds(hem: Floats) -> float:
    """Root mean square of the radius in waves `FOLDS` and up around the hem, (frames, n, 3) [m]."""
    radius = np.hypot(hem[:, :, 0], hem[:, :, 2])
    waves = np.abs(np.fft.rfft(radius, axis=1)) / radius.shape[1]
    return float(np.sqrt(2.0 * np.mean(np.sum(waves[:, FOLDS:] ** 2, axis=1))))


def _scene(law: str, setup: Setup, walk: mannequin.Walk, duration: float) -> Scene:
    s = setup
    scene = Scene(
        name=law,
        duration=duration,
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self_friction": s.self_friction},
    )
    mannequin.add(scene, walk, duration)
    mesh, waist = mannequin.skirt(s.around, s.rows, length=s.length, flare=s.flare)
    scene.add_cloth(
        mesh,
        residual.fabric(s.areal_density, s.stretch, s.shear, s.in_plane_damping, FABRIC.law(law)),
        name="skirt",
        pins=[{"vertices": waist, "collider": "pelvis"}],
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The thesis's coefficients, and what is chosen."""
    begin, end = _window(measured.setup, measured.shown)
    return {
        **FABRIC.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "integrator": "implicit Euler", "bending damping": 0.0, "linear": "rigidity b2",
        "plastic": f"rigidity b2, elastic limit K0 = {FABRIC.k0:.4f} 1/cm, no hardening",
        "mannequin": "capsules that walk on the spot", "period drawn [s]": measured.shown, "measured from [s]": begin,
        "measured to [s]": end, "frames per second": FPS,
        "chosen": "all but b1, b2, c1, lambda, mu, bending damping: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law and gait; motion over time and spectra of the gait that is drawn."""
    columns = (
        "law", "period [s]", "rms velocity against the pelvis [m/s]", "of it not repeated in each period [m/s]",
        "folds of the hem [m]", "largest curvature of 99 % of the hinges [1/m]",
    )  # fmt: skip
    rows = [(law, period, r.swing, r.unsteady, r.folds, r.largest) for (law, period), r in measured.runs.items()]
    drawn = {law: measured.runs[law, measured.shown] for law in LAWS}
    time = [(law, frame / FPS, float(v)) for law, r in drawn.items() for frame, v in enumerate(r.motion)]
    spectra = [
        (law, float(f), float(p)) for law, r in drawn.items() for f, p in zip(r.frequencies, r.spectrum, strict=True)
    ]
    return {
        "": Table(columns, rows),
        "motion": Table(("law", "time [s]", "rms velocity against the pelvis [m/s]"), time),
        "spectrum": Table(("law", "frequency [Hz]", "power [m2/s2/Hz]"), spectra),
    }


def here(measured: Measured) -> str:
    """Swing, what of it does not repeat, folds per law."""
    count = len(measured.setup.periods)
    gaits = "one gait" if count == 1 else f"means over {count} gaits"
    words = [
        f"{law} {measured.mean(law, 'swing'):.3f} m/s, {measured.mean(law, 'unsteady'):.3f} m/s, "
        f"{1e3 * measured.mean(law, 'folds'):.1f} mm"
        for law in LAWS
    ]
    return (
        "velocity against the pelvis, its part that does not repeat from period to period, folds of the hem, "
        f"{gaits}: " + "; ".join(words)
    )


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    m = {(law, name): measured.mean(law, name) for law in LAWS for name in ("swing", "unsteady", "folds")}
    source = "thesis 4.5.3"
    return [
        Check("plastic over linear: velocity", m["plastic", "swing"] / m["linear", "swing"], 1.0, 0.1,
              f"{source}: similar, as few elements pass the elastic limit"),
        Check.true("the skirt swings less with hysteresis", m["hysteresis", "swing"] < m["linear", "swing"], source),
        Check.true("its waving is steadier", m["hysteresis", "unsteady"] < m["linear", "unsteady"], source),
        Check.true("fewer folds with hysteresis", m["hysteresis", "folds"] < m["linear", "folds"], source),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """The laws at the same moment, a film strip of hysteresis, motion, spectra, the hems, and all gaits."""
    s, period = measured.setup, measured.shown
    note = (
        f"A skirt of {100 * s.length:.0f} cm on a figure that walks on the spot; drawn is {2.0 / period:.1f} steps a "
        "second. No bending damping. Sizes, density, stretch and gaits are chosen; bending coefficients as in the "
        "thesis, in KES units."
    )
    figure = pictures.figure("Figure 4.12: walking in a skirt", (16.0, 12.4), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.65, 1.0])
    drawn = {law: measured.runs[law, period] for law in LAWS}
    states = [*(drawn[law].states[-1] for law in LAWS), *drawn["hysteresis"].states]
    images = pictures.tiles(measured.bodies, states, measured.standing, size=(520, 480))
    axes = upper.subplots(2, len(LAWS))
    end = _window(s, period)[1]
    for column, (law, run) in enumerate(drawn.items()):
        words = f"{run.swing:.3f} m/s, not repeated {run.unsteady:.3f} m/s, folds {1e3 * run.folds:.1f} mm"
        pictures.show(axes[0, column], images[column], law, words)
        title = "hysteresis, a quarter of a period apart" if column == 0 else ""
        pictures.show(axes[1, column], images[len(LAWS) + column], title, f"{end - (3 - column) * 0.25 * period:.2f} s")
    motion, spectrum, hem, gaits = lower.subplots(1, 4)
    pictures.tidy(motion, "velocity against the pelvis [m/s]", "time [s]")
    pictures.tidy(spectrum, "its spectrum [m²/s²/Hz]", "frequency [Hz]")
    pictures.tidy(hem, "the hem from above, at the end [cm]")
    pictures.tidy(gaits, "all gaits: velocity (filled), its part\nthat does not repeat (open) [m/s]", "period [s]")
    for law, run in drawn.items():
        # The plastic law lies on the linear one while it does not flow.
        style = {"color": pictures.LAWS[law], "linewidth": 1.4, "linestyle": (0, (4, 2)) if law == "plastic" else "-"}
        motion.plot(np.arange(len(run.motion)) / FPS, run.motion, label=law, **style)
        spectrum.semilogy(run.frequencies[1:], run.spectrum[1:], **style)
        closed = 100.0 * np.vstack([run.hem, run.hem[:1]])
        hem.plot(closed[:, 0], closed[:, 2], **style)
        each = [measured.runs[law, p] for p in s.periods]
        gaits.plot(s.periods, [r.swing for r in each], marker="o", markersize=6, **style)
        gaits.plot(s.periods, [r.unsteady for r in each], marker="o", markersize=6, markerfacecolor="white", **style)
    motion.axvspan(*_window(s, period), color=pictures.GRID, alpha=0.5, linewidth=0)
    motion.set_ylim(bottom=0.0)
    motion.legend(frameon=False, fontsize=9, loc="lower right", ncols=2)
    spectrum.set_xlim(0.0, 15.0)
    hem.set_aspect("equal")
    hem.invert_yaxis()
    gaits.set_ylim(bottom=0.0)
    return pictures.png(figure)
