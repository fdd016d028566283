"""Cards that a moving floor carries along: a conveyor, and a turntable that spins up until it casts the card off."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import clothsim as cs

from . import cards, sliding, tables
from .contact_scenes import CARD, DENSITY, GRAVITY, METHODS, START, THICKNESS, card, scene

LAWS = cards.LAWS
STEPS = (1e-3, 4e-3)  # s
# The conveyor runs with this speed [m/s] from the start, under a card at rest.
SPEED = 1.5
SECONDS, SAMPLES = 2.0, 100
# The turntable: its angular acceleration [rad/s²], where the card lies [m], that card's side [m] and stiffness [N/m].
# A card that is stiffer for its weight would feel the error of its path along chords as stress.
SPIN, RADIUS, SIDE, SOFT = 0.5, 1.0, 0.04, 10.0
# It slides once it has moved so far on the table [m].
MOVED = 1e-4
# Claimed: way on the conveyor [%]; angular velocity at which the turntable casts off [%].
BOUND, CAST_OFF = 1.0, 2.0


class Ride(NamedTuple):
    """Mean way [m] and speed [m/s] of a card over time."""

    t: np.ndarray
    way: np.ndarray
    speed: np.ndarray


def conveyor(name: str, method: str, dt: float) -> Ride:
    """Lay a card on a running conveyor."""
    world = scene(LAWS[name], method, dt)
    material = cs.Material(DENSITY, CARD["in_plane"], CARD["bending"])
    world.add_cloth(card("irregular"), material, position=[0.0, START * THICKNESS, 0.0])
    frames = [{"time": 0.0}, {"time": 10.0, "position": [10.0 * SPEED, 0.0, 0.0]}]
    world.add_collider("belt", shape={"type": "plane", "half_size": 10.0}, keyframes=frames)
    simulation = cs.Simulation(world, threads=1)
    start, share = simulation.positions[:, 0], simulation.masses / simulation.masses.sum()
    rows = [(0.0, 0.0, 0.0)]
    for _ in range(SAMPLES):
        simulation.advance(SECONDS / SAMPLES)
        way, speed = simulation.positions[:, 0] - start, simulation.velocities[:, 0]
        rows.append((simulation.time, float(share @ way), float(share @ speed)))
    return Ride(*np.array(rows).T)


def solution(name: str, samples: int = SAMPLES + 1) -> Ride:
    """The same by the equation of motion, solved on the conveyor."""
    block = sliding.Block(DENSITY, DENSITY * GRAVITY, 1.0, LAWS[name])
    found = sliding.solve(block, lambda _t, _x: 0.0, SECONDS, v=-SPEED, samples=samples)
    return Ride(found.t, found.x + SPEED * found.t, found.v + SPEED)


def cast_off_speed(name: str) -> float:
    """Angular velocity [rad/s] at which the card is seen to let go: (R A)² + (R ω²)² = (μ_s g)², and a little more.

    Under Coulomb's law the force is in balance with friction when the slip starts, and what is missing grows with time:
    the card has moved by s after (6 s/f)^(1/3), f = R ω² 2 R ω A/(μ g). Under the others it is seen at once.
    """
    friction = LAWS[name].mu_s * GRAVITY
    speed = float(np.sqrt(np.sqrt(friction**2 - (RADIUS * SPIN) ** 2) / RADIUS))
    if LAWS[name].mu_s > LAWS[name].mu_c:
        return speed
    growth = RADIUS * speed**2 * 2.0 * RADIUS * speed * SPIN / friction
    return speed + SPIN * float((6.0 * MOVED / growth) ** (1.0 / 3.0))


def turntable(name: str, method: str, dt: float) -> float:
    """Angular velocity at which a card lets go [rad/s]; NaN if it stays on."""
    law = LAWS[name]
    world = scene(law, method, dt)
    material = cs.Material(DENSITY, {**CARD["in_plane"], "warp": SOFT, "weft": SOFT, "shear": SOFT}, CARD["bending"])
    place = [RADIUS, START * THICKNESS, 0.0]
    world.add_cloth(cs.Mesh.grid(SIDE, SIDE, 5, 5), material, position=place)
    end = 1.3 * cast_off_speed(name) / SPIN
    times = np.arange(round(end / dt) + 1) * dt
    # A key pose for each step, so that the table gains the same angular velocity in all of them.
    turned = [{"time": float(t), "rotation": {"axis": [0, 1, 0], "angle": 0.5 * SPIN * float(t) ** 2}} for t in times]
    world.add_collider("table", shape={"type": "plane", "half_size": 1.5}, keyframes=turned)
    simulation = cs.Simulation(world, threads=1)
    while simulation.time < end - 0.5 * dt:
        simulation.step()
        angle = 0.5 * SPIN * simulation.time**2
        middle = simulation.positions.mean(axis=0)
        on_table = RADIUS * np.array([np.cos(angle), 0.0, -np.sin(angle)])
        if np.hypot(*(middle - on_table)[[0, 2]]) > MOVED:
            return float(SPIN * simulation.time)
    return float("nan")


def run() -> list[tables.Result]:
    """Run conveyor and turntable; writes carried.csv and carried.png."""
    jobs = [(name, method, dt) for name in LAWS for method in METHODS for dt in STEPS]
    rides = tables.spread(conveyor, jobs)
    turns = [job for job in jobs if job[2] == STEPS[0]]
    spins = tables.spread(turntable, turns)
    results, rows = [], []

    def add(what: str, unit: str, job: tuple[str, str, float], ours: float, exact: float, bound: float) -> None:
        name, method, dt = job
        error = 100.0 * abs(ours / exact - 1.0) if np.isfinite(ours) else float("inf")
        case = f"{name}, {method}, dt {1e3 * dt:g} ms"
        results.append(tables.Result("carried", case, what, unit, ours, exact, error, "relative", bound))
        rows.append((what, *job, ours, exact, 100.0 * (ours / exact - 1.0)))

    for job, ride in zip(jobs, rides, strict=True):
        add("way on a conveyor", "m", job, float(ride.way[-1]), float(solution(job[0]).way[-1]), BOUND)
    for job, spin in zip(turns, spins, strict=True):
        add("cast off by a turntable", "rad/s", job, spin, cast_off_speed(job[0]), CAST_OFF)
    names = ("what", "law", "method", "dt", "ours", "exact", "deviation")
    tables.write(tables.FOLDER / "carried.csv", names, rows)
    plot(jobs, rides, tables.FOLDER / "carried.png")
    return results


def plot(jobs: list[tuple[str, str, float]], rides: list[Ride], path: Path) -> None:
    """Draw way and speed of cards on the conveyor against the equation."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for (name, method, dt), ride in zip(jobs, rides, strict=True):
        if dt != STEPS[1]:
            continue
        k, which = METHODS.index(method), list(LAWS).index(name)
        colour = ("C2", "C3", "C0", "C1")[which]
        exact = solution(name, 801)
        every = slice(1 + 2 * k + which, None, 6)
        label = name if k == 0 else None
        for axis, curve, points in zip(axes, (exact.way, exact.speed), (ride.way, ride.speed), strict=True):
            axis.plot(exact.t, curve, color=colour, lw=1)
            axis.plot(ride.t[every], points[every], "os"[k], ms=4, mfc="none", color=colour, label=label)
    axes[1].axhline(SPEED, color="0.6", lw=0.7)
    axes[0].set(xlabel="t [s]", ylabel="way [m]", title="card on a conveyor (curves: equation of motion)")
    axes[1].set(xlabel="t [s]", ylabel="speed [m/s]", title="speed (square: constraints)")
    axes[0].legend()
    figure.savefig(path, dpi=90)
    plt.close(figure)
