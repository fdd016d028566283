"""Figure 4.9: a closed body of cloth, squeezed by a shrinking box and let go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import accumulate
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.reproduce import residual
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.figure_4_8 import FABRICS
from clothsim.reproduce.residual import Run
from clothsim.scene import Scene

__all__ = ["TAKES_MESH", "THESIS", "body", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 4.64, b2 = 1.40, c1 = −2.15, μ = 0.02: without plasticity the squeezed body returns to its original bending "
    "configuration but for gravity, with λ = 0.08 and 0.25 residual wrinkles and folds stay, more with the larger"
)

TAKES_MESH = True

MOMENTS = ("start", "box closing", "squeezed", "box opening", "recovered")


@dataclass(frozen=True)
class Setup:
    """What the thesis leaves open. SI units."""

    height: float = 0.24  # of the body, whatever mesh it has
    subdivisions: int = 4  # of the generated body: 20·4ⁿ triangles
    areal_density: float = 0.12
    stretch: float = 400.0
    shear: float = 100.0
    in_plane_damping: float = 1e-3
    air_damping: float = 2.0
    friction: float = 0.2
    self_friction: float = 0.2
    thickness: float = 2e-3
    clearance: float = 0.005  # of the box at the start
    shrink: float = 0.72  # smallest size of the box over the body's, along each axis
    closing: float = 1.6  # s
    held: float = 0.1
    opening: float = 1.2
    resting: float = 2.2  # it still hops on the floor at the end
    dt: float = 3e-3

    @property
    def times(self) -> list[float]:
        """Ends of closing, holding, opening, resting [s]."""
        return list(accumulate((self.closing, self.held, self.opening, self.resting)))


@dataclass(frozen=True)
class Measured:
    """The three runs."""

    setup: Setup
    mesh: Mesh
    file: str
    runs: dict[str, Run]


def body(subdivisions: int) -> Mesh:
    """A closed body with a round belly, a head and two ears: a sphere whose radius depends on the direction."""
    sphere = Mesh.sphere(1.0, subdivisions)
    d = np.array(sphere.vertices) / np.linalg.norm(sphere.vertices, axis=1)[:, None]

    def bump(direction: tuple[float, float, float], width: float) -> Floats:
        unit = np.array(direction) / np.linalg.norm(direction)
        angle = np.arccos(np.clip(d @ unit, -1.0, 1.0))
        bell: Floats = np.exp(-((angle / width) ** 2))
        return bell

    radius = 1.0 + 0.45 * bump((0.0, 1.0, 0.12), 0.55)
    for side in (-1.0, 1.0):
        radius += 0.75 * bump((side * 0.38, 1.0, 0.0), 0.2)
        radius += 0.22 * bump((side * 0.55, -0.75, 0.75), 0.3)
        radius += 0.16 * bump((side * 0.7, 0.05, 0.65), 0.24)
    radius += 0.25 * bump((0.0, -0.55, -1.0), 0.22)
    return Mesh(d * radius[:, None] * np.array([1.0, 1.0, 0.92]), sphere.triangles)


def measure(effort: Effort) -> Measured:
    """Squeeze the three bodies."""
    setup = Setup()
    if effort.quick:
        setup = replace(setup, subdivisions=2, thickness=4e-3, closing=0.5, opening=0.4, resting=0.4, dt=5e-3)
    mesh = _placed(body(setup.subdivisions) if effort.mesh is None else Mesh.load(effort.mesh), setup)
    closed, held, opened, end = setup.times
    moments = [round(t, 2) for t in (0.0, 0.6 * closed, closed, held + 0.5 * (opened - held), end)]
    with effort.bar(round(100 * end) * len(FABRICS), "figure 4.9", "frame") as bar:
        names = list(FABRICS)
        runs = effort.each(lambda name: residual.run(_scene(name, mesh, setup), moments, bar.update), names, bar)
    return Measured(
        setup, mesh, "generated" if effort.mesh is None else str(effort.mesh), dict(zip(names, runs, strict=True))
    )


def _placed(mesh: Mesh, setup: Setup) -> Mesh:
    """The mesh scaled to its height, standing over the origin with room below it."""
    low, high = mesh.bounds
    scale = setup.height / float(high[1] - low[1])
    foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
    x = (mesh.vertices - foot) * scale + np.array([0.0, setup.clearance, 0.0])
    return Mesh(x, mesh.triangles)


def _scene(name: str, mesh: Mesh, setup: Setup) -> Scene:
    s = setup
    closed, held, opened, end = s.times
    scene = Scene(
        name=name,
        duration=end,
        time={"dt": s.dt},
        air={"damping": s.air_damping},
        contact={"thickness": s.thickness, "friction": s.friction, "self_friction": s.self_friction},
    )
    low, high = mesh.bounds
    size = high - low
    wall = 0.01  # half the thickness of the box's walls
    reach = 0.75 * float(size.max()) + 0.05
    for axis, name_of in enumerate("xyz"):
        half = [reach, reach, reach]
        half[axis] = wall
        squeeze = 0.5 * (1.0 - s.shrink) * float(size[axis])
        for sign, side in ((-1.0, "low"), (1.0, "high")):
            still = name_of == "y" and side == "low"  # the floor
            way = 0.0 if still else (2.0 if name_of == "y" else 1.0) * squeeze + s.clearance
            start = np.zeros(3)
            start[1] = 0.5 * (low[1] + high[1])
            start[axis] = (low[axis] if sign < 0 else high[axis]) + sign * (s.clearance + wall)
            inward = np.zeros(3)
            inward[axis] = -sign * way
            apart = np.zeros(3)
            apart[axis] = sign * 0.5 * float(size[axis])
            places = ((0.0, start), (closed, start + inward), (held, start + inward), (opened, start + 0.2 * apart))
            keyframes = [{"time": t, "position": p.tolist()} for t, p in places]
            scene.add_collider(
                f"{name_of} {side}",
                shape={"type": "box", "half_extents": half},
                **({"position": start.tolist()} if still else {"keyframes": keyframes}),
            )
    law = "hysteresis" if FABRICS[name].plasticity else "nonlinear"
    scene.add_cloth(
        mesh, residual.fabric(s.areal_density, s.stretch, s.shear, s.in_plane_damping, FABRICS[name].law(law))
    )
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The thesis's coefficients, and what is chosen."""
    return {
        **FABRICS["λ = 0.25"].named(), "lambda": "0.08 (low), 0.25 (high)",
        **{f"{key} [SI]": value for key, value in asdict(measured.setup).items()},
        "mesh": measured.file, "triangles": len(measured.mesh.triangles),
        "no plasticity": "the non-linear law of the same b1, b2, c1", "bending damping": 0.0,
        "integrator": "implicit Euler",
        "chosen": "all but b1, b2, c1, lambda, mu: the thesis does not state them; its mesh is not published",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per law, and the distribution of the rest curvature."""
    return residual.tables(measured.runs)


def here(measured: Measured) -> str:
    """Residual curvature and dihedral deviation per law."""
    return residual.here(measured.runs)


def checks(measured: Measured) -> Sequence[Check]:
    """The thesis's order."""
    # The body hops on the floor and is dented where it lands: its shape at one moment says nothing of the order.
    return residual.checks(measured.runs, "thesis 4.5.2, figure 4.9", rests=False)


def draw(measured: Measured) -> bytes:
    """Film strip with the larger λ, the three bodies after it, and what is left in them."""
    s = measured.setup
    note = (
        f"A hollow body of cloth, {100 * s.height:.0f} cm tall, {len(measured.mesh.triangles):,} triangles; a box "
        f"shrinks to {100 * s.shrink:.0f} % of its size along each axis and opens again (its walls are not drawn). "
        "Sizes, density and stretch are chosen; bending coefficients as in the thesis, in KES units."
    )
    runs = {
        name: replace(r, bodies=r.bodies[:1], states=_alone(r), standing=np.zeros((0, 3)))
        for name, r in measured.runs.items()
    }
    return residual.draw("Figure 4.9: squeezed by a shrinking box, then let go", note, runs, MOMENTS)


def _alone(run: Run) -> list[Floats]:
    count = run.bodies[0].vertex_count
    return [state[:count] for state in run.states]
