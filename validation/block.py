"""A block that a spring pulls at a steady speed: its motion and its stick–slip against the equation of motion.

The block is the free edge of a strip that lies on the floor; its other edge is pinned and moves. The strip is one row
of staggered triangles with half triangles at both ends: without free vertices between its edges it stretches evenly
and is a spring of stiffness Y W/L exactly [N/m], for any stretch. Each free vertex then carries a share of the
spring that is in proportion to its mass: Y s and ρ s L/2 where the edge's vertices are s apart, half of both at the
ends. So all of them go through the same motion, that of a rigid block of mass ρ W L/2. (A card that is pulled
at its front does not: while it sticks it does not deform, and its front lets go when the pull passes the front's own
share of μ_s N.)
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

import clothsim as cs

from . import sliding, tables
from .contact_scenes import DENSITY, GRAVITY, METHODS, START, THICKNESS, scene

# The stick-slip column of the thesis's Table 7.1, with its viscous part of cards.
LAWS = sliding.laws(mu_c=0.1, mu_s=0.4, v_s=0.4, delta_s=0.2, f_v=0.6 * DENSITY)
WIDTH, LENGTH = 0.1, 0.15  # of the strip, across and along the pull [m]
FREQUENCY = 6.0  # √(k/m) [1/s]
SPEED = 0.2  # of the pull [m/s]
SECONDS = 6.0
STIFF = 5.0  # N/m across the pull and in shear; along it, the strip has 0.1
STEPS = (1e-3, 4e-3)
# Vertices of the free edge.
MESHES = {"5 vertices": 5, "12 vertices": 12}
# Slower than this share of the pull, the block sticks.
STILL = 1e-3
# Standing still for less than this counts as sliding [s]: without stiction the speed touches zero once a swing.
SHORTEST = 0.02
# Claimed: largest distance from the equation's motion over the block's way, by step [%]: what implicit steps damp, of
# first order in dt; and the period of stick–slip [%].
BOUND = {1e-3: 1.0, 4e-3: 4.0}
PERIOD = 10.0


class Pulled(NamedTuple):
    """Mean way [m] and speed [m/s] of the block over time, and most by which ways differed within it [m]."""

    t: np.ndarray
    way: np.ndarray
    speed: np.ndarray
    spread: float


def mesh(points: int) -> tuple[cs.Mesh, int]:
    """Make the strip in the xz-plane, the free edge at x = 0 first; and how many vertices that has."""
    apart = 1.0 / (points - 1)
    free = np.arange(points) * apart
    held = np.concatenate([[0.0], free[:-1] + 0.5 * apart, [1.0]])
    across = np.concatenate([free, held]) - 0.5
    x = np.concatenate([np.zeros(points), np.full(points + 1, LENGTH)])
    k = np.arange(points)
    tips = np.column_stack([k, points + k, points + k + 1])
    bases = np.column_stack([k[:-1], points + k[1:], k[1:]])
    triangles = np.vstack([tips, bases])[:, ::-1]
    return cs.Mesh(np.column_stack([x, np.zeros_like(x), WIDTH * across]), triangles.astype(np.int64)), points


def block(law: sliding.Law) -> tuple[sliding.Block, float]:
    """Mass, weight and area of the block, and the spring's stiffness [N/m]."""
    area = 0.5 * WIDTH * LENGTH
    mass = DENSITY * area
    return sliding.Block(mass, mass * GRAVITY, area, law), mass * FREQUENCY**2


def simulate(law: sliding.Law, method: str, dt: float, points: int = 5, seconds: float = SECONDS) -> Pulled:
    """Pull the block from rest with the spring relaxed."""
    made, body = mesh(points)
    ours, stiffness = block(law)
    in_plane = {"model": "baraff-witkin", "warp": stiffness * LENGTH / WIDTH, "weft": STIFF, "shear": STIFF}
    pulled = [{"time": 0.0}, {"time": 100.0, "position": [100.0 * SPEED, 0.0, 0.0]}]
    pins = [{"vertices": list(range(body, len(made.vertices))), "keyframes": pulled}]
    world = scene(law, method, dt)
    material = cs.Material(DENSITY, in_plane, {"model": "hinge", "rigidity": 1e-3})
    world.add_cloth(made, material, warp=[1.0, 0.0, 0.0], pins=pins, position=[0.0, START * THICKNESS, 0.0])
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


def solution(law: sliding.Law, samples: int, seconds: float = SECONDS) -> sliding.Motion:
    """The same by the equation of motion."""
    ours, stiffness = block(law)
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
        ours, stiffness = block(LAWS[name])
        return sliding.stick_slip(ours, stiffness, SPEED).period
    return period(solution(LAWS[name], 2).slips)


def deviation(found: Pulled, exact: sliding.Motion) -> float:
    """Largest distance from the equation's motion over the block's way [%]."""
    return float(100.0 * np.abs(found.way - exact.x).max() / exact.x[-1])


def run() -> list[tables.Result]:
    """Run all laws, methods, steps and meshes; writes block.csv and block.png."""
    jobs = [(n, m, dt, "5 vertices") for n in LAWS for m in METHODS for dt in STEPS]
    jobs += [("CSSV", method, STEPS[0], "12 vertices") for method in METHODS]
    found = tables.spread(simulate, [(LAWS[n], m, dt, MESHES[kind]) for n, m, dt, kind in jobs])
    results, rows = [], []
    for (name, method, dt, kind), ours in zip(jobs, found, strict=True):
        exact = solution(LAWS[name], len(ours.t))
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
        exact = solution(LAWS[name], 4001)
        axes[0, column].plot(exact.t, exact.x, color="0.1", lw=1, label="equation of motion")
        axes[1, column].plot(exact.t, exact.v, color="0.1", lw=1)
        for (law, method, dt, kind), ours in zip(jobs, found, strict=True):
            if law == name and dt == STEPS[0] and kind == "5 vertices":
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
