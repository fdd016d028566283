"""The angle of a slope at which a card starts to slide, and cards that rest below it for a minute."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import clothsim as cs

from . import sliding, tables
from .contact_scenes import METHODS, card_on_slope, down, tilt

COEFFICIENTS = (0.1, 0.2, 0.3, 0.5, 0.8)  # mu_s
# Laws by mu_s; where it is more than mu_c, mu_c is half of it.
LAWS = {
    "C": sliding.coulomb,
    "CS": lambda mu: sliding.Law("coulomb-stiction", 0.5 * mu, mu),
    "CSS": lambda mu: sliding.Law("stribeck", 0.5 * mu, mu, 0.4, 0.2),
    "CSSV": lambda mu: sliding.Law("viscous", 0.5 * mu, mu, 0.4, 0.2, 0.15),
}
DT = 4e-3
# The search by bisection: start ± this [degrees], halvings, and how long a card is watched [s].
AROUND, HALVINGS, WATCH = 2.0, 7, 0.5
# A card slides if it moves so far [m] in the second half of that; 0.03 degrees too steep it would by 5e-4 m under
# Coulomb's law. On the tilting plane: in all, which takes 0.1 s.
MOVED = 5e-5
# A plane that tilts slowly [degrees/s].
RATE = 2.0
# Claimed: the angle against atan mu_s [degrees].
BOUND = 0.5

# Rest: degrees below the angle of sliding, seconds watched, seconds before that, and what is claimed [m/s].
BELOW, REST, SETTLE, DRIFT = 1.0, 60.0, 1.0, 1e-9
REST_MU = 0.3
# Law, method, step [s], mesh.
RESTS = (
    *[("CSSV", method, dt, kind) for method in METHODS for dt, kind in ((4e-3, "grid 5x5"), (4e-3, "irregular"))],
    *[("C", method, 16e-3, "grid 5x5") for method in METHODS],
    *[("C", method, 2e-3, "grid 5x5") for method in METHODS],
)


def slides(law: sliding.Law, method: str, angle: float) -> bool:
    """Whether a card laid on a slope of ``angle`` [degrees] starts to slide."""
    radians = float(np.radians(angle))
    simulation = cs.Simulation(card_on_slope(law, method, DT, "grid 5x5", radians), threads=1)
    simulation.advance(0.5 * WATCH)
    start = simulation.positions
    simulation.advance(0.5 * WATCH)
    return bool(np.mean((simulation.positions - start) @ down(radians)) > MOVED)


def by_bisection(name: str, method: str, mu: float) -> float:
    """Angle at which a card laid on a slope starts to slide [degrees]; NaN if it is not within `AROUND` of atan μ_s."""
    law, middle = LAWS[name](mu), float(np.degrees(np.arctan(mu)))
    low, high = middle - AROUND, middle + AROUND
    if slides(law, method, low) or not slides(law, method, high):
        return float("nan")
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if slides(law, method, middle) else (middle, high)
    return 0.5 * (low + high)


def by_tilting(name: str, method: str, mu: float) -> float:
    """Angle of a slowly tilting plane at which the card on it starts to slide [degrees]."""
    law = LAWS[name](mu)
    start = float(np.degrees(np.arctan(mu))) - AROUND
    seconds = 2.0 * AROUND / RATE
    turned = [
        {"time": 0.0, "rotation": tilt(float(np.radians(start)))},
        {"time": seconds, "rotation": tilt(float(np.radians(start + RATE * seconds)))},
    ]
    plane = {"shape": {"type": "plane", "half_size": 0.3}, "keyframes": turned}
    scene = card_on_slope(law, method, DT, "grid 5x5", float(np.radians(start)), plane)
    simulation = cs.Simulation(scene, threads=1)
    first = float((simulation.positions @ down(np.radians(start))).mean())
    while simulation.time < seconds - 0.5 * DT:
        simulation.step()
        angle = start + RATE * simulation.time
        if (simulation.positions @ down(np.radians(angle))).mean() - first > MOVED:
            return angle
    return float("nan")


def rest(name: str, method: str, dt: float, kind: str) -> tuple[float, float]:
    """Drift of a card at rest [m/s]: fastest vertex's way over a minute; and its greatest speed at the end [m/s]."""
    angle = float(np.arctan(REST_MU) - np.radians(BELOW))
    simulation = cs.Simulation(card_on_slope(LAWS[name](REST_MU), method, dt, kind, angle), threads=1)
    simulation.advance(SETTLE)
    start = simulation.positions
    simulation.advance(REST - SETTLE)
    way = np.linalg.norm(simulation.positions - start, axis=1).max()
    return float(way / (REST - SETTLE)), float(np.linalg.norm(simulation.velocities, axis=1).max())


def run() -> list[tables.Result]:
    """Run all coefficients, laws and methods, then the cards at rest; writes slope.csv, rest.csv and slope.png."""
    jobs = [(name, method, mu) for name in LAWS for method in METHODS for mu in COEFFICIENTS]
    laid = tables.spread(by_bisection, jobs)
    tilting = [(name, method, mu) for name, method, mu in jobs if name in ("C", "CS")]
    tilted = tables.spread(by_tilting, tilting)
    results, rows = [], []
    for how, which, angles in (("laid", jobs, laid), ("tilted", tilting, tilted)):
        for (name, method, mu), angle in zip(which, angles, strict=True):
            exact = float(np.degrees(np.arctan(mu)))
            error = abs(angle - exact)
            rows.append((name, method, how, mu, angle, exact, angle - exact))
            case = f"{name}, {method}, mu_s {mu:g}, {how}"
            error = error if np.isfinite(error) else float("inf")
            results.append(tables.Result("slope", case, "angle", "degree", angle, exact, error, "degrees", BOUND))
    tables.write(
        tables.FOLDER / "slope.csv", ("law", "method", "how", "mu_s", "angle", "atan_mu_s", "difference"), rows
    )
    return results + still(rows)


def still(angles: list[tuple[object, ...]]) -> list[tables.Result]:
    """Watch cards at rest; draw them with the angles."""
    drifts = tables.spread(rest, RESTS)
    results, rows = [], []
    for (name, method, dt, kind), (drift, speed) in zip(RESTS, drifts, strict=True):
        rows.append((name, method, dt, kind, drift, speed))
        case = f"{name}, {method}, dt {1e3 * dt:g} ms, {kind}"
        results.append(tables.Result("slope", case, "drift over 60 s", "m/s", drift, 0.0, drift, "m/s", DRIFT))
    tables.write(tables.FOLDER / "standing.csv", ("law", "method", "dt", "mesh", "drift", "speed_at_end"), rows)
    plot(angles, rows, tables.FOLDER / "slope.png")
    return results


def plot(angles: list[tuple[object, ...]], rests: list[tuple[object, ...]], path: Path) -> None:
    """Draw the angles' differences from atan μ_s, and the drifts at rest beside what other engines do."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 4.2), layout="constrained")
    for name, method, how, mu, _, _, difference in angles:
        shift = 0.006 * (list(LAWS).index(str(name)) - 1.5 + 5 * (how == "tilted"))
        mark = "os"[METHODS.index(str(method))]
        axes[0].plot(mu + shift, difference, mark, color=f"C{list(LAWS).index(str(name))}", mfc="none", ms=5)
    axes[0].axhspan(-BOUND, BOUND, color="0.93")
    axes[0].set(xlabel="mu_s", ylabel="angle - atan mu_s [degrees]", title="start of sliding (circle: velocity filter)")
    for k, (name, method, dt, kind, drift, _) in enumerate(rests):
        axes[1].barh(k, max(float(drift), 1e-18), color=f"C{METHODS.index(str(method))}")
        axes[1].text(2e-18, k, f"{name}, {method}, {1e3 * float(dt):g} ms, {kind}", va="center", fontsize=7)
    axes[1].axvline(DRIFT, color="k", lw=1)
    axes[1].set(xscale="log", xlim=(1e-18, 1e-6), yticks=[], xlabel="drift [m/s]", title="cards at rest for a minute")
    figure.savefig(path, dpi=90)
    plt.close(figure)
