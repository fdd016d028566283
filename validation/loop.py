"""Loop tests: height of a hanging ring, heart and pear loop against the elastica and Peirce's formulas."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import clothsim as cs

from . import elastica, rest, tables
from .strips import strip

# Slope of the strip below the horizontal where it leaves the grip [rad].
FORMS = {"ring": 0.0, "heart": -np.pi / 2.0, "pear": np.pi / 2.0}
# w g L³/B of the whole strip length L.
LOADS = (10.0, 30.0, 100.0, 300.0, 1000.0)
LENGTH = 0.2  # m
DENSITY = 0.15  # kg/m²
GRAVITY = 9.81  # m/s²
STRAIN = 1e-5
# Triangles along and cells across, equilateral: a third as wide as long, so that it hardly curves across.
CELLS, ACROSS = 64, 20
# The grips bring the ends together in this time [s], in so many key poses and steps.
CLOSING, POSES, STEPS = 4.0, 80, 80
# Claimed: height of the loop against the elastica's [%].
BOUND = 1.0


class Loop(NamedTuple):
    """Height of the loop over the strip's length, and its shape [m]."""

    height: float
    shape: np.ndarray


def grips(form: float) -> list[tuple[float, float, float, float]]:
    """Poses (time [s], x [m], y [m], slope) of the right end's clamp line, the left one mirrored.

    The strip bends through circular arcs until its ends have turned by ``form`` less than a half turn each (a ring at
    most), then the grips move straight to the middle while they turn to ``form``.
    """
    poses = []
    turn = np.pi - form
    share = 0.8
    for k in range(1, POSES + 1):
        part = k / POSES
        angle = min(turn, np.pi) * min(1.0, part / share)
        x = LENGTH * np.sin(angle) / (2.0 * angle)
        late = max(0.0, (part - share) / (1.0 - share))
        poses.append((CLOSING * part, x * (1.0 - late), 0.0, angle + (turn - angle) * late))
    return poses


def simulate(form: str, load: float) -> Loop:
    """Bend a flat strip into the loop and let it come to rest."""
    cell = LENGTH / CELLS
    mesh = strip("equilateral", LENGTH + 0.5 * cell, CELLS, ACROSS).mesh  # clamp lines at 0 and at LENGTH
    x = mesh.vertices[:, 0]
    middle = 0.5 * (x.min() + x.max())
    rounding = 1e-6 * LENGTH
    ends = {+1: np.flatnonzero(x > x.max() - cell - rounding), -1: np.flatnonzero(x < x.min() + cell + rounding)}
    pins = []
    for side, vertices in ends.items():
        frames = [{"time": 0.0}]
        for time, reach, height, angle in grips(FORMS[form]):
            place = [side * (reach - LENGTH / 2.0), height, 0.0]
            frames.append({"time": time, "position": place, "rotation": {"axis": [0, 0, 1], "angle": side * angle}})
        pivot = [middle + side * LENGTH / 2.0, 0.0, 0.0]
        pins.append({"vertices": vertices.tolist(), "keyframes": frames, "pivot": pivot})
    weight = DENSITY * GRAVITY * LENGTH
    stiffness = weight / STRAIN
    material = cs.Material(
        DENSITY,
        {"model": "baraff-witkin", "warp": stiffness, "weft": stiffness, "shear": stiffness},
        {"model": "hinge", "rigidity": weight * LENGTH**2 / load},
    )
    scene = cs.Scene(name=f"{form} loop", duration=1e6, **rest.stepping())
    scene.add_cloth(mesh, material, pins=pins)
    simulation = cs.Simulation(scene, threads=1)
    for _ in range(STEPS):
        simulation.advance(CLOSING / STEPS)
    found = rest.settle(simulation, LENGTH)
    if not found.still:
        raise RuntimeError(f"loop: {form}, load {load:g} did not come to rest")
    line = np.flatnonzero(np.abs(mesh.vertices[:, 2]) < 0.6 * cell)
    line = line[np.argsort(mesh.vertices[line, 0], kind="stable")]
    shape = found.positions[line, :2] - [middle, 0.0]
    return Loop(float(-shape[:, 1].min() / LENGTH), shape)


def run() -> list[tables.Result]:
    """Run all forms and loads; writes loop.csv and loop.png."""
    jobs = [(form, load) for form in FORMS for load in LOADS]
    loops = tables.spread(simulate, jobs)
    results, rows = [], []
    for (form, load), found in zip(jobs, loops, strict=True):
        target = float(elastica.loop(FORMS[form], load / 8.0).y[-1] / 2.0)
        length = load ** (-1.0 / 3.0)  # bending length over strip length
        textbook = elastica.peirce_loop(form, found.height) if form != "pear" else None
        rows.append((form, load, found.height, target, length, textbook))
        case = f"{form}, w g L^3/B {load:g}"
        error = 100.0 * abs(found.height / target - 1.0)
        results.append(tables.Result("loop", case, "height/L", "-", found.height, target, error, "relative", BOUND))
        if textbook is not None:
            error = 100.0 * abs(textbook / length - 1.0)
            note = "what the formula makes of our height: the formula is an approximation"
            results.append(
                tables.Result("loop", case, "c/L by Peirce 1930", "-", textbook, length, error, "relative", None, note)
            )
    tables.write(
        tables.FOLDER / "loop.csv",
        ("form", "load", "height", "elastica", "bending_length", "peirce_bending_length"),
        rows,
    )
    plot(jobs, loops, tables.FOLDER / "loop.png")
    return results


def plot(jobs: list[tuple[str, float]], loops: list[Loop], path: Path) -> None:
    """Draw the loops over the elastica's, and their heights over the load."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 4, figsize=(14, 4.4), layout="constrained", width_ratios=[1, 1, 1, 1.3])
    for axis, form in zip(axes, FORMS, strict=False):
        for (name, load), found in zip(jobs, loops, strict=True):
            if name == form:
                colour = f"C{LOADS.index(load)}"
                curve = elastica.loop(FORMS[form], load / 8.0)
                xs, ys = np.concatenate([curve.x, -curve.x[::-1]]) / 2, -np.concatenate([curve.y, curve.y[::-1]]) / 2
                axis.plot(xs, ys, color=colour, lw=1)
                axis.plot(*(found.shape[::4] / LENGTH).T, ".", ms=4, color=colour, label=f"{load:g}")
        axis.set(title=f"{form} loop", xlabel="x/L", aspect="equal")
    axes[0].set_ylabel("y/L")
    axes[0].legend(title="w g L³/B", fontsize=7, loc="center")
    fine = np.geomspace(LOADS[0], LOADS[-1], 40)
    for form, mark in zip(FORMS, "o^s", strict=True):
        curve = [elastica.loop(FORMS[form], float(q) / 8.0).y[-1] / 2.0 for q in fine]
        (line,) = axes[3].semilogx(fine, curve)
        heights = [found.height for (name, _), found in zip(jobs, loops, strict=True) if name == form]
        axes[3].semilogx(LOADS, heights, mark, color=line.get_color(), mfc="none", label=form)
    axes[3].set(title="height (curves: elastica)", xlabel="w g L³/B", ylabel="height/L")
    axes[3].legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
