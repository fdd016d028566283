"""Peirce's cantilever test: the overhang at which the line from clamp to tip falls 41.5° gives the bending length."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import clothsim as cs

from . import elastica, rest, tables
from .strips import linear_rigidity, strip

# Fabrics by name: areal density [kg/m²] and rigidity [N m]; the range of apparel, not measured ones.
FABRICS = {"soft": (0.06, 2e-6), "medium": (0.15, 1e-5), "stiff": (0.35, 1e-4)}
GRAVITY = 9.81  # m/s²
STRAIN = 1e-5
MESHES = {"equilateral": (40, 16), "union-jack": (40, 16)}
# Search of the overhang: steps of the secant method on log(length), and when it ends.
SEARCH = 8
ANGLE_TOLERANCE = 1e-4  # rad
# Claimed for the rigidity that the test recovers [%].
BOUND = 2.0


class Overhang(NamedTuple):
    """Length of the overhang [m], chord angle [rad], and the strip's shape there [m]."""

    length: float
    angle: float
    shape: np.ndarray


def angle_of(kind: str, length: float, density: float, rigidity: float) -> Overhang:
    """Let a strip with that overhang [m] come to rest."""
    cells, across = MESHES[kind]
    cloth = strip(kind, length, cells, across)
    stiffness = density * GRAVITY * length / STRAIN
    material = cs.Material(
        density,
        {"model": "baraff-witkin", "warp": stiffness, "weft": stiffness, "shear": stiffness},
        {"model": "hinge", "rigidity": rigidity},
    )
    scene = cs.Scene(name="peirce", duration=1e6, **rest.stepping())
    scene.add_cloth(cloth.mesh, material, pins=[{"vertices": cloth.pinned.tolist()}])
    found = rest.settle(cs.Simulation(scene, threads=1), length)
    if not found.still:
        raise RuntimeError(f"peirce: {kind}, overhang {length:g} m did not come to rest")
    x, y, _ = found.positions[cloth.tip].mean(axis=0)
    middle = np.argsort(np.abs(cloth.mesh.vertices[:, 2]), kind="stable")[: 2 * cells]
    shape = found.positions[middle[np.argsort(cloth.mesh.vertices[middle, 0], kind="stable")]]
    return Overhang(length, float(np.arctan2(-y, x)), shape[:, :2])


def search(kind: str, density: float, rigidity: float) -> Overhang:
    """Find the overhang at 41.5°, starting from a tenth less than the elastica's."""
    target = np.radians(elastica.PEIRCE_ANGLE)
    bending_length = (rigidity / (density * GRAVITY)) ** (1.0 / 3.0)
    before = angle_of(kind, 1.8 * bending_length, density, rigidity)
    now = angle_of(kind, 1.9 * bending_length, density, rigidity)
    for _ in range(SEARCH):
        if abs(now.angle - target) < ANGLE_TOLERANCE:
            return now
        slope = (now.angle - before.angle) / np.log(now.length / before.length)
        length = now.length * np.exp((target - now.angle) / slope)
        before, now = now, angle_of(kind, float(length), density, rigidity)
    raise RuntimeError(f"peirce: {kind}: no overhang found, last angle {np.degrees(now.angle):.3f} degrees")


def run() -> list[tables.Result]:
    """Run all fabrics on both meshes; writes peirce.csv and peirce.png."""
    jobs = [(kind, *FABRICS[name]) for kind in MESHES for name in FABRICS]
    names = [name for _ in MESHES for name in FABRICS]
    found = tables.spread(search, jobs)
    exact = elastica.gamma_of_slope(np.tan(np.radians(elastica.PEIRCE_ANGLE))) ** (-1.0 / 3.0)
    peirce = elastica.peirce_factor(elastica.PEIRCE_ANGLE)
    results, rows = [], []
    for (kind, density, rigidity), name, overhang in zip(jobs, names, found, strict=True):
        factor = linear_rigidity(strip(kind, overhang.length, *MESHES[kind]), overhang.length)
        recovered = {label: density * GRAVITY * (f * overhang.length) ** 3 for label, f in
                     (("elastica", exact), ("l/2", 0.5), ("Peirce 1930", peirce))}  # fmt: skip
        rows.append((kind, name, density, rigidity, overhang.length, np.degrees(overhang.angle), factor))
        rows[-1] += tuple(recovered.values())
        for label, value in recovered.items():
            results.append(
                tables.Result(
                    "peirce",
                    f"{kind}, {name}",
                    f"B by {label}",
                    "N m",
                    value,
                    rigidity,
                    100.0 * abs(value / rigidity - 1.0),
                    "relative",
                    BOUND if label != "Peirce 1930" else None,
                    f"overhang {1e3 * overhang.length:.2f} mm; the mesh's rigidity at small deflections {factor:.4f} B",
                )
            )
    columns = "mesh,fabric,density,rigidity,overhang,angle_degrees,mesh_rigidity,by_elastica,by_half,by_peirce"
    tables.write(tables.FOLDER / "peirce.csv", columns.split(","), rows)
    plot(list(zip(jobs, names, found, strict=True)), tables.FOLDER / "peirce.png")
    return results


def plot(found: list[tuple[Any, str, Overhang]], path: Path) -> None:
    """Draw the strips at 41.5° and Peirce's formula beside the elastica."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (shapes, formula) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    reach = max(o.length for _, _, o in found) * 1e3
    slope = np.radians(elastica.PEIRCE_ANGLE)
    shapes.plot([0, reach], [0, -reach * np.tan(slope)], color="0.6", ls=":", label="41.5°")
    for (kind, _, _), name, overhang in found:
        colour = f"C{list(FABRICS).index(name)}"
        line = {"equilateral": "-", "union-jack": "--"}[kind]
        label = f"{name}, {kind}"
        shapes.plot(1e3 * overhang.shape[:, 0], 1e3 * overhang.shape[:, 1], line, color=colour, label=label)
    shapes.set(
        title="overhangs at rest", xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(-2, 50), ylim=(-44, 2)
    )
    shapes.legend(fontsize=8, loc="lower left")
    gammas = np.geomspace(0.1, 1000.0, 60)
    ratios = [float(np.divide(*elastica.cantilever(float(g)).tip[::-1])) for g in gammas]
    degrees = np.degrees(np.arctan(ratios))
    error = [100.0 * (elastica.peirce_factor(float(a)) ** 3 * g - 1.0) for a, g in zip(degrees, gammas, strict=True)]
    formula.plot(degrees, error, label="Peirce's f(θ)")
    formula.plot(
        elastica.PEIRCE_ANGLE, 100.0 * (0.125 * elastica.gamma_of_slope(np.tan(slope)) - 1.0), "ko", label="c = l/2"
    )
    formula.axhline(0.0, color="0.6", lw=1)
    formula.axvline(elastica.PEIRCE_ANGLE, color="0.6", ls=":")
    formula.set(
        title="formula against the elastica", xlabel="angle of the chord [°]", ylabel="error of B [%]", ylim=(-5, 65)
    )
    formula.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
