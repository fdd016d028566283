"""A block that a spring pulls at a steady speed: its motion and its stick–slip against the equation of motion.

The block is a card with stiff yarns along the pull. One row of cells joins its front to pinned vertices that move:
the same cloth, turned by a quarter in its panel, so that its soft yarns (warp) lie along the pull. A row of cells
without free vertices stretches evenly and carries no bending, so it is a spring of stiffness Y W/L exactly [N/m], for
any stretch; half of its mass belongs to the card's front, where it is pressed down and rubs like the rest.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

import clothsim as cs

from . import sliding, tables
from .contact_scenes import DENSITY, GRAVITY, METHODS, SIZE, START, THICKNESS, scene

# The stick-slip column of the thesis's Table 7.1, with its viscous part of cards.
LAWS = sliding.laws(mu_c=0.1, mu_s=0.4, v_s=0.4, delta_s=0.2, f_v=0.6 * DENSITY)
LENGTH = 0.15  # of the spring [m]
FREQUENCY = 6.0  # √(k/m) [1/s]
SPEED = 0.2  # of the pull [m/s]
SECONDS = 6.0
STIFF = 100.0  # N/m along the block's pull and in shear; the spring has 0.25
STEPS = (1e-3, 4e-3)
# Points along a side of the card.
MESHES = {"card 5x5": 5, "card 9x9": 9}
# Slower than this share of the pull, the block sticks.
STILL = 1e-3
# Standing still for less than this counts as sliding [s]: without stiction the speed touches zero once a swing.
SHORTEST = 0.02
# Claimed: largest distance from the equation's motion over the block's way, by step [%]; period of stick–slip [%].
BOUND = {1e-3: 1.0, 4e-3: 3.0}
PERIOD = 10.0


class Pulled(NamedTuple):
    """Mean way [m] and speed [m/s] of the block over time, and most by which ways differed within it [m]."""

    t: np.ndarray
    way: np.ndarray
    speed: np.ndarray
    spread: float


def mesh(points: int) -> tuple[cs.Mesh, int]:
    """Make card and spring in the xz-plane with their panels; and how many vertices the card has."""
    grid = cs.Mesh.grid(SIZE, SIZE, points, points)
    body = grid.vertices - [0.5 * SIZE, 0.0, 0.0]
    front = np.flatnonzero(body[:, 0] > -1e-9 * SIZE)
    front = front[np.argsort(body[front, 2])]
    vertices = np.vstack([body, body[front] + [LENGTH, 0.0, 0.0]])
    held = len(body) + np.arange(points)
    near, far = np.stack([front[:-1], front[1:]]), np.stack([held[:-1], held[1:]])
    cells = np.vstack([np.column_stack([near[0], near[1], far[0]]), np.column_stack([near[1], far[1], far[0]])])
    triangles = np.vstack([grid.triangles, cells])
    # Panels: (u, v), u along the warp. The card's warp lies across the pull, the spring's along it.
    card_uv = body[grid.triangles][:, :, [2, 0]]
    spring_uv = vertices[cells][:, :, [0, 2]] * [1.0, -1.0] + [1.0, 0.0]
    return cs.Mesh(vertices, triangles, np.concatenate([card_uv, spring_uv])), len(body)


def block(law: sliding.Law, points: int) -> tuple[sliding.Block, float]:
    """Mass, weight and area of the block by lumping, and the spring's stiffness [N/m]."""
    made, body = mesh(points)
    corners = made.vertices[made.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    area = float((areas[:, None] * (made.triangles < body)).sum() / 3.0)
    mass = DENSITY * area
    return sliding.Block(mass, mass * GRAVITY, area, law), mass * FREQUENCY**2


def simulate(law: sliding.Law, method: str, dt: float, points: int = 5, seconds: float = SECONDS) -> Pulled:
    """Pull the block from rest with a relaxed spring."""
    made, body = mesh(points)
    ours, stiffness = block(law, points)
    in_plane = {"model": "baraff-witkin", "warp": stiffness * LENGTH / SIZE, "weft": STIFF, "shear": STIFF}
    pulled = [{"time": 0.0}, {"time": 100.0, "position": [100.0 * SPEED, 0.0, 0.0]}]
    pins = [{"vertices": list(range(body, len(made.vertices))), "keyframes": pulled}]
    world = scene(law, method, dt)
    material = cs.Material(DENSITY, in_plane, {"model": "hinge", "rigidity": 1e-3})
    world.add_cloth(made, material, rest="uv", pins=pins, position=[0.0, START * THICKNESS, 0.0])
    world.add_collider("plane", shape={"type": "plane", "half_size": 10.0})
    simulation = cs.Simulation(world, threads=1)
    start, share = simulation.positions[:body, 0], simulation.masses[:body] / ours.mass
    rows, spread = [(0.0, 0.0, 0.0)], 0.0
    for _ in range(round(seconds / dt)):
        simulation.advance(dt)
        ways = simulation.positions[:body, 0] - start
        spread = max(spread, float(np.ptp(ways)))
        rows.append((simulation.time, float(share @ ways), float(share @ simulation.velocities[:body, 0])))
    t, way, speed = np.array(rows).T
    return Pulled(t, way, speed, spread)


def solution(law: sliding.Law, points: int, samples: int, seconds: float = SECONDS) -> sliding.Motion:
    """The same by the equation of motion."""
    ours, stiffness = block(law, points)
    return sliding.solve(ours, lambda t, x: stiffness * (SPEED * t - x), seconds, samples=samples)


def slips(t: np.ndarray, speed: np.ndarray) -> list[tuple[float, float]]:
    """Start and end [s] of each slip; the last may go on."""
    moves = (np.abs(speed) > STILL * SPEED).astype(int)
    changes = np.flatnonzero(np.diff(moves)) + 1
    edges = [0, *changes.tolist(), len(t)]
    found: list[tuple[float, float]] = []
    for a, b in pairwise(edges):
        if not moves[a]:
            continue
        end = float(t[b]) if b < len(t) else np.inf
        if found and t[a] - found[-1][1] < SHORTEST:
            found[-1] = (found[-1][0], end)
        else:
            found.append((float(t[a - 1]), end))
    return found


def period(found: list[tuple[float, float]]) -> float:
    """Mean time from the start of a slip to the next [s]; NaN if there are not two."""
    starts = [a for a, _ in found]
    return float(np.diff(starts).mean()) if len(starts) > 1 else float("nan")


def exact_period(name: str) -> float:
    """Period of stick–slip by the equation of motion, in closed form for stiction alone [s]."""
    if name == "CS":
        ours, stiffness = block(LAWS[name], 5)
        return sliding.stick_slip(ours, stiffness, SPEED).period
    return period(solution(LAWS[name], 5, 2).slips)


def deviation(found: Pulled, exact: sliding.Motion) -> float:
    """Largest distance from the equation's motion over the block's way [%]."""
    return float(100.0 * np.abs(found.way - exact.x).max() / exact.x[-1])


def run() -> list[tables.Result]:
    """Run all laws, methods, steps and meshes; writes block.csv and block.png."""
    jobs = [(n, m, dt, "card 5x5") for n in LAWS for m in METHODS for dt in STEPS]
    jobs += [("CSS", method, STEPS[0], "card 9x9") for method in METHODS]
    found = tables.spread(simulate, [(LAWS[n], m, dt, MESHES[kind]) for n, m, dt, kind in jobs])
    results, rows = [], []
    for (name, method, dt, kind), ours in zip(jobs, found, strict=True):
        exact = solution(LAWS[name], MESHES[kind], len(ours.t))
        case = f"{name}, {method}, dt {1e3 * dt:g} ms, {kind}"
        error, own = deviation(ours, exact), slips(ours.t, ours.speed)
        results.append(
            tables.Result(
                "block", case, f"way in {SECONDS:g} s", "m", float(ours.way[-1]), float(exact.x[-1]), error,
                "largest distance / way", BOUND[dt],
            )
        )  # fmt: skip
        if name == "C":
            ours_period, exact_time = float(len(own) - 1), 0.0
            results.append(
                tables.Result(
                    "block", case, "stick phases after the first", "-", ours_period, 0.0, ours_period, "count", 0.0
                )
            )
        else:
            ours_period, exact_time = period(own), exact_period(name)
            off = 100.0 * abs(ours_period / exact_time - 1.0) if np.isfinite(ours_period) else float("inf")
            results.append(
                tables.Result("block", case, "stick-slip period", "s", ours_period, exact_time, off, "relative", PERIOD)
            )
        rows.append(
            (name, method, dt, kind, ours.way[-1], exact.x[-1], error, len(own), len(exact.slips), ours_period,
             exact_time, ours.spread)
        )  # fmt: skip
    names = ("law", "method", "dt", "mesh", "way", "equation", "largest_distance", "slips", "slips_of_equation")
    tables.write(tables.FOLDER / "block.csv", (*names, "period", "period_of_equation", "spread"), rows)
    plot(jobs, found, tables.FOLDER / "block.png")
    return results


def plot(jobs: list[tuple[str, str, float, str]], found: list[Pulled], path: Path) -> None:
    """Draw way and speed over time against the equation, a panel for each law."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 4, figsize=(16, 6.5), layout="constrained", sharex=True, sharey="row")
    for column, name in enumerate(LAWS):
        exact = solution(LAWS[name], 5, 4001)
        axes[0, column].plot(exact.t, exact.x, color="0.1", lw=1, label="equation of motion")
        axes[1, column].plot(exact.t, exact.v, color="0.1", lw=1)
        for (law, method, dt, kind), ours in zip(jobs, found, strict=True):
            if law == name and dt == STEPS[0] and kind == "card 5x5":
                k = METHODS.index(method)
                every = slice(40 * k, None, 80)
                style = {"color": f"C{k}", "ms": 4, "mfc": "none"}
                axes[0, column].plot(ours.t[every], ours.way[every], "os"[k], label=method, **style)
                axes[1, column].plot(ours.t[every], ours.speed[every], "os"[k], **style)
        axes[0, column].plot(exact.t, SPEED * exact.t, ":", color="0.5", lw=1, label="pull")
        axes[0, column].set(title=name)
        axes[1, column].set(xlabel="t [s]")
    axes[0, 0].set(ylabel="way [m]")
    axes[1, 0].set(ylabel="speed [m/s]")
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
