"""Heavy cantilever: where the tip of a clamped strip comes to rest, against the elastica."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import clothsim as cs

from . import elastica, rest, tables
from .strips import KINDS, linear_rigidity, strip

GAMMAS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
LENGTH = 0.2  # m
DENSITY = 0.15  # kg/m²
GRAVITY = 9.81  # m/s²
# Strain of a strip that hangs from its end: small enough to count as inextensible.
STRAIN = 1e-4
# (kind, triangles along, hinges): a strip five times as long as wide at three refinements, and once with hinges that do
# not answer to each other.
CASES = tuple((kind, n, "coupled") for kind in KINDS for n in (10, 20, 40)) + tuple(
    (kind, 40, "independent") for kind in KINDS
)
# Claimed at 40 triangles along: distance of the tip from the elastica's, over the displacement of the elastica's tip
# and over the length [%].
BOUND = 2.0
# Claimed for meshes whose columns are straight: the step from 20 to 40 triangles moves the tip by at most this share of
# the step from 10 to 20 [%]; second order means 25.
REFINEMENT = 40.0
STRAIGHT = ("union-jack", "equilateral", "one-way")


class Tip(NamedTuple):
    """Mean reach and droop of the free end and its sideways drift, over the free length, and the run that led there."""

    reach: float
    droop: float
    drift: float
    steps: int
    still: bool


class Row(NamedTuple):
    """A case with its tip and the rigidity of its mesh over that of the material (`linear_rigidity`)."""

    kind: str
    along: int
    hinges: str
    gamma: float
    tip: Tip
    factor: float

    @property
    def fitted(self) -> float:
        """Rigidity over that of the material with which the elastica's tip lies in the same direction."""
        return self.gamma / elastica.gamma_of_slope(self.tip.droop / self.tip.reach)

    def cells(self) -> tuple[object, ...]:
        """Cells of cantilever.csv."""
        tip, gamma = self.tip, self.gamma
        reference, plain = elastica.cantilever(gamma).tip, deviation(tip, gamma)
        corrected = deviation(tip, gamma / self.factor)[0]
        return (*self[:4], *tip[:3], *reference, *plain, self.factor, corrected, self.fitted, tip.steps)


def simulate(kind: str, gamma: float, cells: int, across: int, rigidity: float = 1.0, hinges: str = "coupled") -> Tip:
    """Let a strip of w g L³/B = ``gamma`` come to rest; the material's rigidity is ``rigidity`` times B."""
    scene, cloth = prepare(kind, gamma, cells, across, rigidity, hinges)
    found = rest.settle(cs.Simulation(scene, threads=1), LENGTH)
    x, y, z = found.positions[cloth.tip].mean(axis=0) / LENGTH
    return Tip(float(x), float(-y), float(z), found.steps, found.still)


def prepare(
    kind: str, gamma: float, cells: int, across: int, rigidity: float = 1.0, hinges: str = "coupled"
) -> tuple[cs.Scene, Any]:
    """Build the scene of `simulate`; also returns its strip."""
    cloth = strip(kind, LENGTH, cells, across)
    weight = DENSITY * GRAVITY * LENGTH
    stiffness = weight / STRAIN
    material = cs.Material(
        DENSITY,
        {"model": "baraff-witkin", "warp": stiffness, "weft": stiffness, "shear": stiffness},
        {"model": "hinge", "rigidity": rigidity * weight * LENGTH**2 / gamma, "hinges": hinges},
    )
    scene = cs.Scene(name="cantilever", duration=1e6, **rest.stepping())
    scene.add_cloth(cloth.mesh, material, pins=[{"vertices": cloth.pinned.tolist()}])
    return scene, cloth


def deviation(tip: Tip, gamma: float) -> tuple[float, float]:
    """Distance of the tip from the elastica's, over the displacement of the elastica's tip and over the length [%]."""
    reach, droop = elastica.cantilever(gamma).tip
    distance = np.hypot(np.hypot(tip.reach - reach, tip.droop - droop), tip.drift)
    return float(100.0 * distance / np.hypot(1.0 - reach, droop)), float(100.0 * distance)


def run() -> list[tables.Result]:
    """Run all cases; writes cantilever.csv and cantilever.png."""
    jobs = [(kind, gamma, n, n // 5, 1.0, hinges) for kind, n, hinges in CASES for gamma in GAMMAS]
    tips = tables.spread(simulate, jobs)
    own = {case: linear_rigidity(strip(case[0], LENGTH, case[1], case[1] // 5), LENGTH, case[2]) for case in CASES}
    results, rows = [], []
    for (kind, gamma, n, across, _, hinges), tip in zip(jobs, tips, strict=True):
        case = f"{kind} {n}x{across}, {hinges} hinges, gamma {gamma:g}"
        if not tip.still:
            raise RuntimeError(f"cantilever: {case} did not come to rest")
        row = Row(kind, n, hinges, gamma, tip, own[kind, n, hinges])
        rows.append(row)
        bound = BOUND if n == 40 and hinges == "coupled" else None
        target = elastica.cantilever(gamma).tip[1]
        for off, over in zip(deviation(tip, gamma), ("the displacement", "L"), strict=True):
            quantity, measure = f"droop/L, tip over {over}", f"distance of the tips / {over}, elastica with B"
            results.append(tables.Result("cantilever", case, quantity, "-", tip.droop, target, off, measure, bound))
        if hinges == "independent":
            measure = f"distance of the tips / the displacement, elastica with {row.factor:.4f} B"
            target, off = elastica.cantilever(gamma / row.factor).tip[1], deviation(tip, gamma / row.factor)[0]
            quantity = "droop/L against the mesh's rigidity"
            results.append(tables.Result("cantilever", case, quantity, "-", tip.droop, target, off, measure))
    results += refinement(rows)
    names = (
        "kind,along,hinges,gamma,reach,droop,drift,elastica_reach,elastica_droop,deviation_percent,"
        "deviation_percent_of_length,mesh_rigidity,deviation_percent_mesh_rigidity,fitted_rigidity,steps"
    )
    tables.write(tables.FOLDER / "cantilever.csv", names.split(","), [row.cells() for row in rows])
    plot(rows, tables.FOLDER / "cantilever.png")
    return results


def refinement(rows: list[Row]) -> list[tables.Result]:
    """How much less the tip moves from 20 to 40 triangles along than from 10 to 20."""
    tips = {(r.kind, r.along, r.gamma): np.array(r.tip[:3]) for r in rows if r.hinges == "coupled"}
    results = []
    for kind in KINDS:
        for gamma in GAMMAS:
            coarse, middle, fine = (tips[kind, n, gamma] for n in (10, 20, 40))
            first, last = float(np.linalg.norm(middle - coarse)), float(np.linalg.norm(fine - middle))
            results.append(
                tables.Result(
                    "cantilever",
                    f"{kind}, gamma {gamma:g}",
                    "change of the tip/L, 20 to 40",
                    "-",
                    last,
                    first,
                    100.0 * last / first,
                    "over the change from 10 to 20",
                    REFINEMENT if kind in STRAIGHT else None,
                )
            )
    return results


MARKS = {
    "union-jack": ("o", "C0"),
    "equilateral": ("^", "C2"),
    "equilateral-along": ("v", "C4"),
    "one-way": ("s", "C3"),
}


def plot(rows: list[Row], path: Path) -> None:
    """Draw the strips' shapes in the elastica's, the rigidity they show, and convergence."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (shapes, rigidity, refined) = plt.subplots(1, 3, figsize=(15, 4.8), layout="constrained")
    for gamma in GAMMAS:
        curve = elastica.cantilever(gamma)
        shapes.plot(curve.x, -curve.y, color="0.75", lw=1.2, zorder=0)
        if gamma <= 100.0:
            label = {"xytext": (7, -3), "textcoords": "offset points", "fontsize": 8, "color": "0.35"}
            shapes.annotate(f"{gamma:g}", (curve.x[-1], -curve.y[-1]), **label)
    for kind, (mark, colour) in MARKS.items():
        own = [r for r in rows if r.kind == kind and r.along == 40 and r.hinges == "coupled"]
        alone = [r for r in rows if r.kind == kind and r.hinges == "independent"]
        style = {"color": colour, "mfc": "none"}
        shapes.plot([r.tip.reach for r in own], [-r.tip.droop for r in own], mark, ms=7, label=kind, **style)
        rigidity.plot([r.gamma for r in own], [r.fitted for r in own], mark + "-", label=kind, **style)
        rigidity.plot([r.gamma for r in alone], [r.fitted for r in alone], mark + ":", ms=4, lw=1, **style)
        for gamma, line in ((1.0, "--"), (10.0, "-")):
            at = [r for r in rows if r.kind == kind and r.gamma == gamma and r.hinges == "coupled"]
            tips = {r.along: np.array(r.tip[:3]) for r in at}
            moved = [100.0 * np.linalg.norm(tips[n] - tips[n // 2]) for n in (20, 40)]
            refined.loglog([20, 40], moved, mark + line, label=f"{kind}, Γ = {gamma:g}", **style)
    shapes.set(title="tips at 40 triangles along; curves: elastica, by Γ", xlabel="x/L", ylabel="y/L", aspect="equal")
    shapes.legend(fontsize=8, loc="lower right")
    rigidity.axhline(1.0, color="0.5", lw=1)
    rigidity.set(title="rigidity that the tip shows, 40×8 cells\n(dotted: independent hinges)")
    rigidity.set(xscale="log", ylim=(0.6, 1.2), xlabel="Γ = w g L³/B", ylabel="fitted B / material's B")
    rigidity.legend(fontsize=8, loc="lower right")
    refined.loglog([20, 40], [0.4, 0.1], color="0.5", lw=1, label="order 2")
    refined.loglog([20, 40], [0.4, 0.2], color="0.5", lw=1, ls=":", label="order 1")
    refined.set(title="refinement", xlabel="triangles along, n", ylabel="|tip(n) − tip(n/2)| [% of L]", xlim=(18, 75))
    refined.set_xticks([20, 40], ["20", "40"])
    refined.minorticks_off()
    refined.legend(fontsize=7, loc="right")
    figure.savefig(path, dpi=90)
    plt.close(figure)
