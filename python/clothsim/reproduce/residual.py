"""What bending leaves behind: shared by the figures that compare a law without plasticity with hysteresis."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim._frames import moving_positions, standing_positions
from clothsim.recording import Body
from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Table
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["Run", "checks", "draw", "fabric", "folds", "here", "run", "tables"]

COLOURS = (pictures.LAWS["nonlinear"], pictures.LAWS["plastic"], pictures.LAWS["hysteresis"])


@dataclass(frozen=True)
class Run:
    """One law, from start to end.

    Attributes
    ----------
    bodies : list of Body
        Cloth first.
    states : list of (n, 3) float64
        Positions of what moves at the moments asked for [m]; the last is the end.
    standing : (k, 3) float64
        Positions of what stands still [m].
    rest : (h,) float64
        |rest curvature| of each hinge at the end [1/m]; zeros for a law that leaves none.
    bent : (h,) float64
        Change of each dihedral angle from the start to the end [rad].
    most : float
        Root mean square of that change at the moment of ``states`` at which it is largest [rad].
    speed : float
        Root mean square velocity of the cloth at the end [m/s].
    intersections : int
        Pairs of triangles that pass through each other at the end.
    retries, steps : int
        Of the whole run.
    seconds : float
        Wall-clock time.
    """

    bodies: list[Body]
    states: list[Floats]
    standing: Floats
    rest: Floats
    bent: Floats
    most: float
    speed: float
    intersections: int
    retries: int
    steps: int
    seconds: float

    @property
    def mean(self) -> float:
        """Mean |rest curvature| [1/m]."""
        return float(self.rest.mean())

    @property
    def largest(self) -> float:
        """Largest |rest curvature| [1/m]."""
        return float(self.rest.max())

    @property
    def deviation(self) -> float:
        """Root mean square change of the dihedral angles [rad]."""
        return float(np.sqrt(np.mean(self.bent**2)))

    @property
    def cloth(self) -> Floats:
        """Positions of the cloth at the end [m]."""
        return self.states[-1][: self.bodies[0].vertex_count]


def run(scene: Scene, moments: Sequence[float], tick: Callable[[], Any] | None = None) -> Run:
    """Simulate a scene with one piece of cloth, and keep the states at ``moments`` [s], increasing.

    ``tick()`` is called after each hundredth of a second of simulated time.
    """
    simulation = Simulation(scene, threads=1)
    bodies = simulation.bodies
    hinges = interior_edges(bodies[0].triangles)
    start = dihedrals(simulation.positions, hinges)
    begin = time.perf_counter()
    states, turned = [], []
    done = 0
    for moment in moments:
        for _ in range(round(100.0 * moment) - done):
            simulation.advance(0.01)
            if tick is not None:
                tick()
        done = round(100.0 * moment)
        states.append(moving_positions(bodies, simulation.positions, simulation.collider_positions))
        turned.append(_wrapped(dihedrals(simulation.positions, hinges) - start))
    rest = np.abs(simulation.hinges.rest_curvature)
    totals = simulation.report["totals"]
    return Run(
        bodies, states, standing_positions(bodies, simulation.collider_positions),
        rest if len(rest) else np.zeros(len(hinges)), turned[-1],
        max(float(np.sqrt(np.mean(angles**2))) for angles in turned),
        float(np.sqrt(np.mean(np.sum(simulation.velocities**2, axis=1)))), len(simulation.intersections()),
        int(totals["retries"]), int(totals["steps"]), time.perf_counter() - begin,
    )  # fmt: skip


def fabric(density: float, stretch: float, shear: float, damping: float, bending: Mapping[str, Any]) -> dict[str, Any]:
    """A material: areal density [kg/m²], warp and weft stiffness, shear stiffness [N/m], damping [s], bending."""
    return {
        "areal_density": density,
        "in_plane": {
            "model": "baraff-witkin", "warp": stretch, "weft": stretch, "shear": shear, "damping": damping,
        },
        "bending": dict(bending),
    }  # fmt: skip


# Geometry -------------------------------------------------------------------------------------------------------


def interior_edges(triangles: Ints) -> Ints:
    """The edges that two triangles share, each with the two vertices opposite it: (h, 4), in order of the edges."""
    corners = np.concatenate([triangles[:, [a, b, c]] for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))])
    key = np.sort(corners[:, :2], axis=1)
    order = np.lexsort((corners[:, 0] > corners[:, 1], key[:, 1], key[:, 0]))
    key, corners = key[order], corners[order]
    first = np.flatnonzero(np.all(key[1:] == key[:-1], axis=1))
    return np.column_stack([key[first], corners[first, 2], corners[first + 1, 2]])


def dihedrals(x: Floats, hinges: Ints) -> Floats:
    """Signed dihedral angle of each hinge, flat = 0 [rad]."""
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    edge = b - a
    left, right = np.cross(edge, c - a), np.cross(d - a, edge)
    sine = np.einsum("ij,ij->i", np.cross(left, right), edge) / np.linalg.norm(edge, axis=1)
    angles: Floats = np.arctan2(sine, np.einsum("ij,ij->i", left, right))
    return angles


def _wrapped(angles: Floats) -> Floats:
    turned: Floats = np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi
    return turned


def folds(run_: Run) -> Floats:
    """Mean |rest curvature| of the hinges around each vertex [1/m]."""
    hinges = interior_edges(run_.bodies[0].triangles)
    total, count = np.zeros(run_.bodies[0].vertex_count), np.zeros(run_.bodies[0].vertex_count)
    for k in (0, 1):
        np.add.at(total, hinges[:, k], run_.rest)
        np.add.at(count, hinges[:, k], 1.0)
    mean: Floats = total / np.maximum(count, 1.0)
    return mean


# Shown ----------------------------------------------------------------------------------------------------------


def tables(runs: Mapping[str, Run]) -> dict[str, Table]:
    """One row per law, and the distribution of the rest curvature."""
    columns = (
        "law", "mean rest curvature [1/m]", "largest rest curvature [1/m]", "rms dihedral deviation [rad]",
        "largest rms dihedral deviation before [rad]", "rms velocity at the end [m/s]", "intersections at the end",
        "steps", "retries", "seconds",
    )  # fmt: skip
    rows = [
        (
            name,
            r.mean,
            r.largest,
            r.deviation,
            r.most,
            r.speed,
            r.intersections,
            r.steps,
            r.retries,
            round(r.seconds, 1),
        )
        for name, r in runs.items()
    ]
    shares = np.arange(0, 101)
    spread = [
        (name, int(share), float(rest), float(bent))
        for name, r in runs.items()
        for share, rest, bent in zip(
            shares, np.percentile(r.rest, shares), np.percentile(np.abs(r.bent), shares), strict=True
        )
    ]
    names = ("law", "share of hinges [%]", "rest curvature below [1/m]", "dihedral deviation below [rad]")
    return {"": Table(columns, rows), "distribution": Table(names, spread)}


def here(runs: Mapping[str, Run]) -> str:
    """Residual curvature and dihedral deviation per law."""
    return "residual curvature mean and largest, dihedral deviation from the start: " + "; ".join(
        f"{name} {r.mean:.2f} and {r.largest:.0f} /m, {np.degrees(r.deviation):.1f}°" for name, r in runs.items()
    )


def checks(runs: Mapping[str, Run], source: str, *, rests: bool = True) -> list[Check]:
    """The order that the thesis shows: more is left the larger λ; every run ends without intersections.

    ``runs`` are in the order of λ, the law without plasticity first. Shapes are compared where the cloth
    ``rests`` and what is left in it decides them.
    """
    ordered = list(runs.values())
    means, bent = [r.mean for r in ordered], [r.deviation for r in ordered]
    # Friction alone holds bends too, whatever λ: their order among the hysteresis runs is a matter of chance.
    shape = Check.true("with hysteresis the cloth is left farther from its start", min(bent[1:]) > bent[0], source)
    return [
        Check("rest curvature without plasticity [1/m]", means[0], 0.0, 0.0, "a law that remembers nothing"),
        Check.true("residual curvature grows with λ", means == sorted(set(means)), source),
        *([shape] if rests else []),
        Check("pairs of triangles that intersect at the end", float(sum(r.intersections for r in ordered)), 0.0, 0.0,
              "a step that starts without intersections ends without"),
    ]  # fmt: skip


def _centred(x: Floats) -> Floats:
    """Moved so that its middle stands over the origin."""
    shift = 0.5 * (x.min(axis=0) + x.max(axis=0))
    shift[1] = 0.0
    moved: Floats = x - shift
    return moved


def draw(
    title: str, note: str, runs: Mapping[str, Run], moments: Sequence[str], *, size: tuple[int, int] = (520, 460)
) -> bytes:
    """Film strip of the last law above, the ends of all laws below, and the distributions beside them."""
    count = len(moments)
    last = list(runs.values())[-1]
    figure = pictures.figure(title, (16.0, 8.4), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[0.8, 1.0])
    strip = pictures.tiles(last.bodies, last.states[:count], last.standing, size=size)
    for axis, image, name in zip(upper.subplots(1, count), strip, moments, strict=True):
        pictures.show(axis, image, name)
    ends = pictures.tiles(last.bodies[:1], [_centred(r.cloth) for r in runs.values()], np.zeros((0, 3)), size=size)
    grid = lower.add_gridspec(2, len(runs) + 1, width_ratios=[1.0] * len(runs) + [0.75])
    for column, ((name, r), image) in enumerate(zip(runs.items(), ends, strict=True)):
        axis = lower.add_subplot(grid[:, column])
        words = "no residual curvature" if r.mean == 0.0 else f"residual curvature {r.mean:.1f}/m"
        pictures.show(axis, image, f"end: {name}", f"{words}, dihedral deviation {np.degrees(r.deviation):.1f}°")
    above, below = lower.add_subplot(grid[0, -1]), lower.add_subplot(grid[1, -1])
    pictures.tidy(above, "residual curvature [1/m]", "share of the hinges below [%]")
    pictures.tidy(below, "dihedral deviation [°]", "share of the hinges below [%]")
    shares = np.linspace(50.0, 99.5, 200)
    colours = COLOURS if len(runs) == len(COLOURS) else (COLOURS[0], COLOURS[-1])
    for (name, r), colour in zip(runs.items(), colours, strict=True):
        above.plot(shares, np.percentile(r.rest, shares), color=colour, linewidth=1.8, label=name)
        below.plot(shares, np.degrees(np.percentile(np.abs(r.bent), shares)), color=colour, linewidth=1.8)
    above.legend(frameon=False, fontsize=9)
    return pictures.png(figure)
