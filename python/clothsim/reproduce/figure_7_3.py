"""Figure 7.3: a piece of cloth falls on an inclined plane, under Coulomb friction and with stiction and Stribeck."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._frames import moving_positions, standing_positions
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import mannequin, pictures, residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.friction_laws import COLOURS, GRAVITY, TABLE_7_1
from clothsim.reproduce.wrinkles import Wrinkles
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "Setup", "checks", "draw", "here", "measure", "parameters", "scene", "tables"]

THESIS = (
    "μ_c = 0.2, μ_s = 0.3 (self contact 0.1, 0.15): with CSS the cloth is more likely to stick and meets more friction "
    "while it is slow; it folds more and slides slower than with C"
)

COEFFICIENTS = TABLE_7_1["incline plane"]
LAWS = ("C", "CSS")
FPS = 50.0
FINE = 40  # cells along a side, from which on folds are compared
# Further turns about the vertical [rad]: where a fold goes is a matter of chance, how many there are is less so.
OTHERS = (0.2, 0.3, 0.5)


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open but for the number of triangles. SI units."""

    slope: float = 0.26  # tan α, between μ_c and μ_s
    cells: int = 64
    side: float = 0.9
    areal_density: float = 0.15
    stretch: float = 300.0
    shear: float = 30.0
    in_plane_damping: float = 1e-3
    rigidity: float = 1e-5
    bending_damping: float = 2e-3
    air_damping: float = 0.1
    thickness: float = 4e-3
    drop: float = 0.3  # height of the lowest corner above the plane
    yaw: float = 0.4  # rad: the upright sheet's turn about the vertical, from facing downhill
    plane: tuple[float, float] = (1.4, 2.6)  # across, along
    landing: float = 0.75  # from the plane's upper end
    duration: float = 1.6
    dt: float = 2e-3

    @property
    def angle(self) -> float:
        """α [rad]."""
        return math.atan(self.slope)

    @property
    def down(self) -> Floats:
        """Unit vector downhill."""
        return np.array([0.0, -math.sin(self.angle), math.cos(self.angle)])

    @property
    def normal(self) -> Floats:
        """Unit normal of the plane, which goes through the origin."""
        return np.array([0.0, math.cos(self.angle), math.sin(self.angle)])


@dataclass(frozen=True)
class Run:
    """One law over time: [s], centre of mass along the plane [m], its velocity [m/s], rms curvature [1/m]."""

    times: Floats
    way: Floats
    speed: Floats
    folds: Floats
    covered: Floats  # share of the cloth's area that its shadow on the plane has
    states: list[Floats]


@dataclass(frozen=True)
class Measured:
    """Both runs, and both of each further start."""

    setup: Setup
    runs: dict[str, Run]
    others: dict[float, dict[str, Run]]  # by the turn about the vertical
    moments: list[float]
    bodies: list[Body]
    standing: Floats


def sheet(setup: Setup) -> Mesh:
    """The cloth as it starts: upright, one corner down, flat."""
    grid = Mesh.grid(setup.side, setup.side, setup.cells + 1, setup.cells + 1)
    turn = mannequin._turn(1, setup.yaw) @ mannequin._turn(0, 0.5 * math.pi) @ mannequin._turn(1, 0.25 * math.pi)
    place = (setup.landing - 0.5 * setup.plane[1]) * setup.down
    x = grid.vertices @ turn.T + place
    lift = (setup.drop - float((x @ setup.normal).min())) / setup.normal[1]
    return Mesh(x + [0.0, lift, 0.0], grid.triangles, grid.vertices[:, [0, 2]])


def scene(
    setup: Setup,
    mesh: Mesh,
    friction: float | Mapping[str, Any],
    self_friction: float | Mapping[str, Any],
    **cloth: Any,
) -> Scene:
    """The inclined plane and a cloth, undeformed in its UV panel."""
    s = setup
    made = Scene(
        name="incline",
        duration=s.duration,
        gravity=[0.0, -GRAVITY, 0.0],
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": friction, "self_friction": self_friction},
    )
    made.add_cloth(
        mesh,
        residual.fabric(
            s.areal_density, s.stretch, s.shear, s.in_plane_damping,
            {"model": "hinge", "rigidity": s.rigidity, "damping": s.bending_damping},
        ),
        name="cloth",
        rest="uv",
        **cloth,
    )  # fmt: skip
    half = [0.5 * s.plane[0], 0.025, 0.5 * s.plane[1]]
    made.add_collider(
        "plane",
        shape={"type": "box", "half_extents": half},
        position=(-half[1] * s.normal).tolist(),
        rotation={"axis": [1.0, 0.0, 0.0], "angle": s.angle},
    )
    return made


def measure(effort: Effort) -> Measured:
    """Drop the cloth under both laws, from several starts."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, cells=20, dt=4e-3)
    moments = [0.2, 0.4, 0.6, 0.9, 1.2, setup.duration]
    turns = [setup.yaw, *(OTHERS if setup.cells >= FINE else ())]
    jobs = [(turn, law) for turn in turns for law in LAWS]
    with effort.bar(round(setup.duration * FPS) * len(jobs), "figure 7.3", "frame") as bar:
        made = effort.each(lambda job: _run(job[1], replace(setup, yaw=job[0]), moments, bar.update), jobs, bar)
    found = dict(zip(jobs, made, strict=True))
    runs, *others = ({law: found[turn, law] for law in LAWS} for turn in turns)
    simulation = _start("C", setup)
    standing = standing_positions(simulation.bodies, simulation.collider_positions)
    return Measured(setup, runs, dict(zip(turns[1:], others, strict=True)), moments, simulation.bodies, standing)


def _start(law: str, setup: Setup) -> Simulation:
    laws = (make(law, setup.areal_density) for make in (COEFFICIENTS.friction, COEFFICIENTS.self_friction))
    return Simulation(scene(setup, sheet(setup), *laws), threads=1)


def _run(law: str, setup: Setup, moments: Sequence[float], tick: Callable[[], Any]) -> Run:
    simulation = _start(law, setup)
    bodies, weights = simulation.bodies, simulation.masses / simulation.masses.sum()
    wrinkles = Wrinkles(sheet(setup))
    shown = {round(moment * FPS) for moment in moments}
    begin = float(weights @ (simulation.positions @ setup.down))
    rows, states = [], []
    for frame in range(round(setup.duration * FPS) + 1):
        if frame > 0:
            simulation.advance(1.0 / FPS)
            tick()
        x, v = simulation.positions, simulation.velocities
        rows.append((
            frame / FPS, weights @ (x @ setup.down) - begin, weights @ (v @ setup.down),
            wrinkles.rms(wrinkles.curvature(x)), _covered(x, bodies[0].triangles, setup),
        ))  # fmt: skip
        if frame in shown:
            states.append(moving_positions(bodies, x, simulation.collider_positions))
    columns = np.array(rows).T
    return Run(columns[0], columns[1], columns[2], columns[3], columns[4], states)


def _covered(x: Floats, triangles: Any, setup: Setup) -> float:
    """Area of the cloth's shadow along the plane's normal over the cloth's own, by squares of a cell and a half."""
    across = np.column_stack([x[:, 0], x @ setup.down])
    square = 1.5 * setup.side / setup.cells
    corners = across[triangles]
    # Points inside each triangle, closer to each other than the squares are wide.
    mix = np.array([(a, b, 3 - a - b) for a in range(4) for b in range(4 - a)]) / 3.0
    points = np.einsum("pk,tkc->tpc", mix, corners).reshape(-1, 2)
    hit = np.unique(np.floor(points / square).astype(np.int64), axis=0)
    # A flat cloth hits squares that it covers in part: about half of those along its border are too many.
    border = 0.5 * 4.0 * setup.side / square
    return float((len(hit) - border) * square**2 / setup.side**2)


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The column of Table 7.1, and what is chosen."""
    return {
        **COEFFICIENTS.named(), **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "triangles": len(measured.bodies[0].triangles), "frames per second": FPS,
        "covered": "the cloth's shadow along the plane's normal over its area, about 1 for a flat cloth",
        "chosen": "all but the coefficients and 8.1K triangles: the thesis does not state them",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per start, law and frame."""
    columns = (
        "turn [rad]", "law", "time [s]", "displacement [m]", "velocity [m/s]", "rms curvature [1/m]",
        "covered area over the cloth's",
    )  # fmt: skip
    rows = [
        (turn, law, *map(float, row))
        for turn, runs in _starts(measured).items()
        for law, r in runs.items()
        for row in zip(r.times, r.way, r.speed, r.folds, r.covered, strict=True)
    ]
    return {"": Table(columns, rows)}


def _starts(measured: Measured) -> dict[float, dict[str, Run]]:
    """The runs of every start, by its turn."""
    return {measured.setup.yaw: measured.runs, **measured.others}


def _folds(run: Run) -> float:
    """The mean of the rms curvature over the frames after the fall [1/m]."""
    return float(run.folds[run.times >= 0.6].mean())


def _mean_folds(measured: Measured, law: str) -> float:
    """The mean of that over the starts."""
    return float(np.mean([_folds(runs[law]) for runs in _starts(measured).values()]))


def here(measured: Measured) -> str:
    """Way, speed and folds per law."""
    words = []
    for law, run in measured.runs.items():
        covered = 100.0 * min(1.0, float(run.covered[-1]))
        words.append(
            f"{law} {run.way[-1]:.2f} m, {run.speed[-1]:.2f} m/s, rms curvature {_mean_folds(measured, law):.1f}/m, "
            f"covers {covered:.0f} % of its area at the end"
        )
    count = len(_starts(measured))
    of = f" (mean of {count} starts)" if count > 1 else ""
    return f"slid in {measured.setup.duration:g} s, speed at the end, folds from 0.6 s on{of}: {'; '.join(words)}"


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    source = "thesis 7.5, figure 7.3"
    pairs = [[runs[law] for law in LAWS] for runs in _starts(measured).values()]
    found = [
        Check.true("CSS slides less far", all(css.way[-1] < c.way[-1] for c, css in pairs), source),
        Check.true("CSS slides slower", all(css.speed[-1] < c.speed[-1] for c, css in pairs), source),
    ]
    if measured.setup.cells >= FINE:  # folds of a coarse mesh are a matter of chance
        c, css = (_mean_folds(measured, law) for law in LAWS)
        found.append(Check.true("CSS folds more: rms curvature, mean of the starts", css > c, source))
    return found


def draw(measured: Measured) -> bytes:
    """Both laws at six moments, then displacement, folds and covered area."""
    s = measured.setup
    note = (
        f"A cloth of {100 * s.side:.0f} cm, {len(measured.bodies[0].triangles):,} triangles, falls upright on a plane "
        f"of tan α = {s.slope:g}. Sizes, weight and slope are chosen; coefficients as in the thesis."
    )
    figure = pictures.figure("Figure 7.3: a cloth falls on an inclined plane", (16.0, 10.4), note)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.75, 1.0])
    states = [state for law in LAWS for state in measured.runs[law].states]
    images = pictures.tiles(measured.bodies, states, measured.standing, size=(440, 440))
    count = len(measured.moments)
    axes = upper.subplots(len(LAWS), count)
    for row, law in enumerate(LAWS):
        run = measured.runs[law]
        for column, moment in enumerate(measured.moments):
            words = f"{moment:.1f} s: {100 * run.way[round(moment * FPS)]:.0f} cm"
            pictures.show(axes[row, column], images[row * count + column], law if column == 0 else "", words)
    way, folds, covered = lower.subplots(1, 3)
    pictures.tidy(way, "displacement along the plane [m]", "time [s]")
    pictures.tidy(folds, "folds: rms curvature [1/m]", "time [s]")
    pictures.tidy(covered, "area that the cloth covers, over its own", "time [s]")
    for law, run in measured.runs.items():
        style = {"color": COLOURS[law], "linewidth": 1.9}
        way.plot(run.times, run.way, label=law, **style)
        folds.plot(run.times, run.folds, **style)
        covered.plot(run.times, run.covered, **style)
    way.legend(frameon=False, fontsize=10)
    covered.set_ylim(0.0, 1.1)
    return pictures.png(figure)
