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
# (kind, triangles along, cells across): a strip five times as long as wide at three refinements, and one 1.7 times as
# wide as long that has no room to curve across.
CASES = tuple((kind, n, n // 5) for kind in KINDS for n in (10, 20, 40)) + (("equilateral", 40, 60),)
# Claimed: distance of the tip from the elastica's over the tip's displacement, at 40 triangles along [%].
BOUND = 2.0


class Tip(NamedTuple):
    """Mean reach and droop of the free end and its sideways drift, over the free length, and the run that led there."""

    reach: float
    droop: float
    drift: float
    steps: int
    still: bool


def simulate(kind: str, gamma: float, cells: int, across: int, rigidity: float = 1.0, strain: float = STRAIN) -> Tip:
    """Let a strip of w g L³/B = ``gamma`` come to rest; the material's rigidity is ``rigidity`` times B."""
    scene, cloth = prepare(kind, gamma, cells, across, rigidity, strain)
    found = rest.settle(cs.Simulation(scene, threads=1), LENGTH)
    x, y, z = found.positions[cloth.tip].mean(axis=0) / LENGTH
    return Tip(float(x), float(-y), float(z), found.steps, found.still)


def prepare(
    kind: str, gamma: float, cells: int, across: int, rigidity: float = 1.0, strain: float = STRAIN
) -> tuple[cs.Scene, Any]:
    """Build the scene of `simulate`; also returns its strip."""
    cloth = strip(kind, LENGTH, cells, across)
    weight = DENSITY * GRAVITY * LENGTH
    stiffness = weight / strain
    material = cs.Material(
        DENSITY,
        {"model": "baraff-witkin", "warp": stiffness, "weft": stiffness, "shear": stiffness},
        {"model": "hinge", "rigidity": rigidity * weight * LENGTH**2 / gamma},
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
    jobs = [(kind, gamma, n, across) for kind, n, across in CASES for gamma in GAMMAS]
    tips = tables.spread(simulate, jobs)
    own = {case: linear_rigidity(strip(case[0], LENGTH, *case[1:]), LENGTH) for case in CASES}
    results, rows = [], []
    for (kind, gamma, n, across), tip in zip(jobs, tips, strict=True):
        if not tip.still:
            raise RuntimeError(f"cantilever: {kind}, {n} along, gamma {gamma:g} did not come to rest")
        factor = own[kind, n, across]
        reach, droop = elastica.cantilever(gamma).tip
        plain, of_length = deviation(tip, gamma)
        corrected, _ = deviation(tip, gamma / factor)
        fitted = gamma / elastica.gamma_of_slope(tip.droop / tip.reach)
        rows.append(
            (kind, n, across, gamma, tip.reach, tip.droop, tip.drift, reach, droop, plain, of_length, factor, corrected)
            + (fitted, tip.steps)
        )
        case = f"{kind} {n}x{across}, gamma {gamma:g}"
        claimed = n == 40 and kind in ("union-jack", "equilateral")
        wide = across > n
        for against, ours, percent, bound in (
            ("B", tip.droop, plain, BOUND if wide else None),
            ("f B", tip.droop, corrected, BOUND if claimed else None),
        ):
            target = elastica.cantilever(gamma if against == "B" else gamma / factor).tip[1]
            measure = f"tip distance / tip displacement, elastica with {against}, f = {factor:.4f}"
            results.append(
                tables.Result("cantilever", case, f"droop/L against {against}", "-", ours, target, percent, measure, bound)
            )
    names = (
        "kind,along,across,gamma,reach,droop,drift,elastica_reach,elastica_droop,deviation_percent,"
        "deviation_percent_of_length,mesh_rigidity,deviation_percent_mesh_rigidity,fitted_rigidity,steps"
    )
    tables.write(tables.FOLDER / "cantilever.csv", names.split(","), rows)
    plot(rows, tables.FOLDER / "cantilever.png")
    return results


def plot(rows: list[tuple[Any, ...]], path: Path) -> None:
    """Draw the strips' shapes in the elastica's, the rigidity they show, and convergence."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (shapes, rigidity, refined) = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
    for gamma in GAMMAS:
        curve = elastica.cantilever(gamma)
        shapes.plot(curve.x, -curve.y, color="0.75", lw=1.2, zorder=0)
        shapes.annotate(f"{gamma:g}", (curve.x[-1], -curve.y[-1]), fontsize=7, color="0.4", xytext=(4, 3), textcoords="offset points")
    marks = {"union-jack": ("o", "C0"), "equilateral": ("^", "C2"), "equilateral-along": ("v", "C4"), "one-way": ("s", "C3")}
    for kind, (mark, colour) in marks.items():
        own = [r for r in rows if r[0] == kind and r[1] == 40 and r[2] == 8]
        shapes.plot([r[4] for r in own], [-r[5] for r in own], mark, color=colour, mfc="none", ms=7, label=kind)
        rigidity.plot([r[3] for r in own], [r[13] for r in own], mark + "-", color=colour, mfc="none", label=f"{kind} 40×8")
        rigidity.axhline(own[0][11], color=colour, ls=":", lw=1)
        for gamma, style in ((1.0, "--"), (10.0, "-")):
            steps = [r for r in rows if r[0] == kind and r[3] == gamma and r[2] * 5 == r[1]]
            label = kind if gamma == 10.0 else None
            refined.loglog([r[1] for r in steps], [r[12] for r in steps], mark + style, color=colour, mfc="none", label=label)
    wide = [r for r in rows if r[2] > r[1]]
    rigidity.plot([r[3] for r in wide], [r[13] for r in wide], "^--", color="k", mfc="none", label="equilateral 40×60 (wide)")
    shapes.set(title="tips at 40 triangles along; curves: elastica, by Γ", xlabel="x/L", ylabel="y/L", aspect="equal")
    shapes.legend(fontsize=8, loc="lower left")
    rigidity.axhline(1.0, color="0.5", lw=1)
    rigidity.set(xscale="log", title="rigidity that the tip shows (dotted: linear strip)", xlabel="Γ = w g L³/B", ylabel="fitted B / material's B")
    rigidity.legend(fontsize=8, loc="lower right")
    refined.loglog([10, 40], [8, 0.5], color="0.5", lw=1, label="order 2")
    refined.axhline(BOUND, color="0.5", lw=1, ls=":")
    refined.set(title="against the elastica of the mesh's rigidity\n(Γ = 10 solid, Γ = 1 dashed)", xlabel="triangles along", ylabel="tip deviation [% of its displacement]")
    refined.set_xticks([10, 20, 40], ["10", "20", "40"])
    refined.minorticks_off()
    refined.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
