"""Cusick's drape test: shadow of a disc of cloth that hangs over a smaller disc."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import clothsim as cs

from . import tables

# Radii of pedestal and specimen [m]: Cusick's (BS 5058, ISO 9073-9) and those of JIS L 1096.
GEOMETRIES = {"30 cm on 18 cm": (0.09, 0.15), "25.4 cm on 12.7 cm": (0.0635, 0.127)}
CUSICK = "30 cm on 18 cm"
# Rings of vertices beyond the clamp line, and vertices on each: nearly equilateral triangles.
COARSE, FINE = (10, 112), (16, 180)
GRAVITY = 9.81  # m/s²
IN_PLANE = {"model": "baraff-witkin", "warp": 1000.0, "weft": 1000.0, "shear": 30.0, "damping": 0.002}  # assumed
SEEDS = (1, 2, 3)
# Velocity of the disturbance [m/s], and how many waves it may have around the disc.
DISTURBANCE, WAVES = 0.05, 12
DT, AIR = 0.01, 1.0  # s, 1/s
# At rest when no vertex is faster than this [m/s]; most seconds.
REST, MOST = 1e-3, 15
# Other shear stiffnesses [N/m], of this fabric.
SHEARED, SHEARS = "wool tropical", (5.0, 100.0)
# Bending lengths of the sweep [m].
SWEEP = (0.010, 0.014, 0.018, 0.022, 0.028, 0.035)
SWEEP_DENSITY = 0.15  # kg/m²; without stretch the shape depends on the bending length alone
PIXEL = 5e-4  # m


class Drape(NamedTuple):
    """Drape coefficient [%], nodes, seconds simulated, speed at the end [m/s], crossing triangles, positions [m]."""

    coefficient: float
    nodes: int
    seconds: int
    speed: float
    crossing: int
    positions: np.ndarray


class Disc(NamedTuple):
    """The cloth outside the pedestal, the radii [m] of both, and how many vertices lie on a ring."""

    mesh: cs.Mesh
    pedestal: float
    specimen: float
    around: int


def disc(geometry: str = CUSICK, cells: tuple[int, int] = COARSE) -> Disc:
    """Make the cloth, its clamp line midway between the two inner rings, which are to be pinned."""
    (pedestal, specimen), (rings, around) = GEOMETRIES[geometry], cells
    cell = (specimen - pedestal) / (rings - 0.5)
    radii = pedestal + (np.arange(rings + 1) - 0.5) * cell
    angles = 2.0 * np.pi * (np.arange(around) + 0.5 * (np.arange(rings + 1)[:, None] % 2)) / around
    x, z = radii[:, None] * np.cos(angles), -radii[:, None] * np.sin(angles)
    points = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    triangles = []
    for ring in range(rings):
        shift = ring % 2
        for k in range(around):
            a, b = ring * around + k, ring * around + (k + 1) % around
            c, d = ((ring + 1) * around + (k + m + shift) % around for m in (0, -1))
            triangles += [[a, c, b], [a, d, c]]
    return Disc(cs.Mesh(points, triangles), pedestal, specimen, around)


def disturbance(cloth: Disc, seed: int) -> np.ndarray:
    """Smooth random velocities [m/s] normal to the cloth, zero on the pedestal."""
    random = np.random.default_rng(seed)
    x, z = cloth.mesh.vertices[:, 0], cloth.mesh.vertices[:, 2]
    angle, out = np.arctan2(z, x), (np.hypot(x, z) - cloth.pedestal) / (cloth.specimen - cloth.pedestal)
    velocity = np.zeros_like(cloth.mesh.vertices)
    for wave in range(1, WAVES + 1):
        amplitude, phase = random.normal(), random.uniform(0.0, 2.0 * np.pi)
        velocity[:, 1] += amplitude * np.cos(wave * angle + phase)
    velocity[:, 1] *= DISTURBANCE * np.clip(out, 0.0, 1.0)
    return velocity


def coefficient(cloth: Disc, positions: np.ndarray) -> float:
    """Drape coefficient (shadow − pedestal)/(specimen − pedestal) [%]; the shadow is counted in pixels."""
    size = int(np.ceil(2.2 * cloth.specimen / PIXEL))
    centres = (np.arange(size) + 0.5) * PIXEL - 1.1 * cloth.specimen
    covered = centres[:, None] ** 2 + centres[None, :] ** 2 <= cloth.pedestal**2
    for corners in positions[:, [0, 2]][cloth.mesh.triangles]:
        low = np.searchsorted(centres, corners.min(axis=0))
        high = np.searchsorted(centres, corners.max(axis=0), side="right")
        if (high > low).all():
            px, py = centres[low[0] : high[0], None], centres[None, low[1] : high[1]]
            (ax, ay), (bx, by), (cx, cy) = corners
            u = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
            v = (cx - bx) * (py - by) - (cy - by) * (px - bx)
            w = (ax - cx) * (py - cy) - (ay - cy) * (px - cx)
            inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
            covered[low[0] : high[0], low[1] : high[1]] |= inside
    pedestal, whole = np.pi * cloth.pedestal**2, np.pi * cloth.specimen**2
    return float(100.0 * (covered.sum() * PIXEL**2 - pedestal) / (whole - pedestal))


def nodes(cloth: Disc, positions: np.ndarray) -> int:
    """Folds around the rim: the times its distance from the axis rises through the middle of its range."""
    rim = positions[-cloth.around :]
    reach = np.hypot(rim[:, 0], rim[:, 2])
    low, high = reach.min(), reach.max()
    band, middle = 0.15 * (high - low), 0.5 * (low + high)
    states = [1 if r > middle + band else -1 for r in reach if abs(r - middle) > band]
    return sum(1 for before, now in zip(states[-1:] + states, states, strict=False) if before < now)


def simulate(
    density: float,
    bending: dict[str, Any],
    seed: int,
    geometry: str = CUSICK,
    cells: tuple[int, int] = COARSE,
    shear: float = IN_PLANE["shear"],
) -> Drape:
    """Let the disc fall from the plane of the pedestal, slightly disturbed, until it hangs still; shear in N/m."""
    cloth = disc(geometry, cells)
    scene = cs.Scene(
        name="drape",
        duration=1e3,
        time={"dt": DT, "integrator": "implicit-euler"},
        solver={"method": "faer-llt"},
        air={"damping": AIR},
    )
    pins = [{"vertices": list(range(2 * cloth.around))}]
    material = cs.Material(density, {**IN_PLANE, "shear": shear}, bending)
    scene.add_cloth(cloth.mesh, material, pins=pins, velocities=disturbance(cloth, seed))
    simulation = cs.Simulation(scene, threads=1)
    seconds, speed = 0, np.inf
    while speed >= REST and seconds < MOST:
        simulation.advance(1.0)
        seconds += 1
        speed = float(np.linalg.norm(simulation.velocities, axis=1).max())
    positions = simulation.positions
    crossing = len(cs.collision.self_intersections(positions, cloth.mesh.triangles))
    return Drape(coefficient(cloth, positions), nodes(cloth, positions), seconds, speed, crossing, positions)


def laws(rigidity: float, coercive_couple: float) -> dict[str, dict[str, Any]]:
    """Bending laws to compare: the rigidity alone, and the whole loop of the measurement."""
    return {
        "hinge": {"model": "hinge", "rigidity": rigidity},
        "hysteresis": {
            "model": "hysteresis",
            "rigidity": rigidity,
            "coercive_couple": coercive_couple,
            "plasticity": 0.0,
            "fatigue": 0.0,
        },
    }


def bending_length(density: float, rigidity: float) -> float:
    """Peirce's bending length (B/(w g))^⅓ [m]."""
    return float((rigidity / (density * GRAVITY)) ** (1.0 / 3.0))


def run() -> list[tables.Result]:
    """Run all fabrics, the sweep and the finer mesh; writes drape.csv and drape.png."""
    fabrics = tables.targets("drape")
    jobs, keys = [], []
    for row in fabrics:
        density, rigidity, couple = (float(row[k]) for k in ("density", "rigidity", "coercive_couple"))
        for law, bending in laws(rigidity, couple).items():
            cases = [(CUSICK, COARSE)]
            if law == "hinge":
                cases += [(CUSICK, FINE), ("25.4 cm on 12.7 cm", COARSE)]
            for geometry, cells in cases:
                for seed in SEEDS if cells == COARSE else SEEDS[:1]:
                    jobs.append((density, bending, seed, geometry, cells))
                    keys.append((row["case"], law, geometry, cells))
        if row["case"] == SHEARED:
            for shear in SHEARS:
                for seed in SEEDS:
                    jobs.append((density, laws(rigidity, couple)["hinge"], seed, CUSICK, COARSE, shear))
                    keys.append((row["case"], f"hinge with shear {shear:g} N/m", CUSICK, COARSE))
    for length in SWEEP:
        for seed in SEEDS:
            jobs.append((SWEEP_DENSITY, {"model": "hinge", "rigidity": SWEEP_DENSITY * GRAVITY * length**3}, seed))
            keys.append((f"c = {1e3 * length:g} mm", "hinge", CUSICK, COARSE))
    drapes: dict[tuple[Any, ...], list[Drape]] = {}
    for key, drape in zip(keys, tables.spread(simulate, jobs), strict=True):
        drapes.setdefault(key, []).append(drape)

    rows, results = [], []
    measured = {row["case"]: row for row in fabrics}
    for (case, law, geometry, cells), found in drapes.items():
        values = [d.coefficient for d in found]
        mean, low, high = float(np.mean(values)), min(values), max(values)
        folds = " ".join(str(d.nodes) for d in found)
        target = measured.get(case)
        crossing, speed = max(d.crossing for d in found), max(d.speed for d in found)
        rows.append(
            (case, law, geometry, f"{cells[0]}x{cells[1]}", len(found), mean, low, high, folds, crossing, speed)
            + ((float(target["target"]), target["nodes"]) if target else (None, None))
        )
        if target:
            results.append(
                tables.Result(
                    "drape",
                    f"{case}, {law}, {geometry}, {cells[0]}x{cells[1]}",
                    "drape coefficient",
                    "%",
                    mean,
                    float(target["target"]),
                    abs(mean - float(target["target"])),
                    "percentage points",
                    None,
                    f"{len(found)} seeds, {low:.1f} to {high:.1f}; nodes {folds}, measured {target['nodes']}",
                )
            )
    names = "case,law,geometry,mesh,seeds,mean,lowest,highest,nodes,crossing_triangles,speed,measured,measured_nodes"
    tables.write(tables.FOLDER / "drape.csv", names.split(","), rows)
    plot(drapes, fabrics, tables.FOLDER / "drape.png")
    return results


def plot(drapes: dict[tuple[Any, ...], list[Drape]], fabrics: list[dict[str, str]], path: Path) -> None:
    """Draw the fabrics from above and the drape coefficient over the bending length."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(fabrics) + 1, figsize=(15, 4.2), layout="constrained", width_ratios=[1] * 4 + [1.9]
    )
    cloth, chart = disc(), axes[-1]
    for axis, row in zip(axes, fabrics, strict=False):
        drape = drapes[row["case"], "hinge", CUSICK, COARSE][0]
        x, y, z = 1e3 * drape.positions.T
        axis.tripcolor(x, z, cloth.mesh.triangles, y, cmap="viridis", shading="gouraud", vmin=-60, vmax=0)
        turn = np.linspace(0.0, 2.0 * np.pi, 200)
        for radius, line in ((cloth.pedestal, "-"), (cloth.specimen, ":")):
            axis.plot(1e3 * radius * np.cos(turn), 1e3 * radius * np.sin(turn), line, color="k", lw=0.8)
        measured = f"(measured {float(row['target']):.0f} %, {row['nodes']})"
        axis.set(title=f"{row['case']}\n{drape.coefficient:.0f} %, {drape.nodes} nodes\n{measured}")
        axis.set_aspect("equal")
        axis.axis("off")
    sweep = [[d.coefficient for d in drapes[f"c = {1e3 * c:g} mm", "hinge", CUSICK, COARSE]] for c in SWEEP]
    lengths = 1e3 * np.array(SWEEP)
    chart.fill_between(
        lengths, [min(v) for v in sweep], [max(v) for v in sweep], color="0.85", label="hinge law, spread of seeds"
    )
    chart.plot(lengths, [np.mean(v) for v in sweep], color="0.4", label="hinge law, mean")
    for n, row in enumerate(fabrics):
        length = 1e3 * bending_length(float(row["density"]), float(row["rigidity"]))
        for law, mark, face in (("hinge", "o", None), ("hysteresis", "s", "none")):
            values = [d.coefficient for d in drapes[row["case"], law, CUSICK, COARSE]]
            span = [[np.mean(values) - min(values)], [max(values) - np.mean(values)]]
            label = f"ours, {law}" if n == 0 else None
            chart.errorbar(length, np.mean(values), span, fmt=mark, color="C0", mfc=face, capsize=3, label=label)
        chart.plot(length, float(row["target"]), "*", color="C3", ms=11, label="measured" if n == 0 else None)
        chart.annotate(
            row["case"],
            (length, float(row["target"])),
            xytext=(8, -3) if n != 1 else (-30, -14),
            textcoords="offset points",
            fontsize=8,
        )
    chart.set(
        title="drape coefficient, 30 cm on 18 cm",
        xlabel="bending length (B/(w g))^⅓ [mm]",
        ylabel="drape coefficient [%]",
        ylim=(15, 100),
    )
    chart.legend(fontsize=8, loc="lower right")
    figure.savefig(path, dpi=90)
    plt.close(figure)
