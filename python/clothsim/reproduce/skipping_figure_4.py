"""Figure 4 of Wong 2010: how far a box inside a box may move, and how likely it stays inside, by Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "one million tests with cubes: the expected free movement distance is almost linear in the ratio of side lengths; "
    "the probability of penetration free movement is almost one for small movements, such as 0.0015 of a unit cube, "
    "and higher the higher the ratio"
)

TESTS, QUICK_TESTS = 1_000_000, 40_000
SEED = 2010
RATIOS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)  # L/l
# The inner cube's movement over its side.
MOVEMENTS = (0.0015, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
DRAWN = (1.25, 1.5, 2.0, 3.0, 5.0, 10.0)  # of RATIOS, in the picture
EXAMPLE = 0.0015  # of the paper's text
CERTAIN = 0.99  # "almost one"
# A right program leaves this many standard errors, at any of the 192 numbers, in one run of a million at the most.
ERRORS = 6.0


@dataclass(frozen=True)
class Measured:
    """By ratio: mean free way and its standard error over l; by ratio and movement: share that stays inside."""

    tests: int
    free: Floats
    error: Floats
    inside: Floats


def measure(effort: Effort) -> Measured:
    """Draw places and directions for each ratio."""
    tests = QUICK_TESTS if effort.quick else TESTS
    random = np.random.default_rng(SEED)
    free, error, inside = [], [], []
    with effort.bar(len(RATIOS), "figure 4", "ratio") as bar:
        for ratio in RATIOS:
            ways = free_ways(ratio, tests, random)
            free.append(float(ways.mean()))
            error.append(float(ways.std()) / math.sqrt(tests))
            inside.append([float(np.mean(ways > movement)) for movement in MOVEMENTS])
            bar.update()
    return Measured(tests, np.array(free), np.array(error), np.array(inside))


def free_ways(ratio: float, tests: int, random: np.random.Generator) -> Floats:
    """How far a unit cube, put anywhere into a cube of side ``ratio``, gets in any direction."""
    room = ratio - 1.0
    place = random.uniform(0.0, room, (tests, 3))
    direction = random.normal(size=(tests, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ahead = np.where(direction > 0.0, room - place, place)
    ways: Floats = np.min(ahead / np.maximum(np.abs(direction), 1e-300), axis=1)
    return ways


def probability(movement: float, ratio: float) -> float:
    """Exact probability that the inner cube stays inside, for movements up to L − l.

    With s = movement/(L − l) and a direction ω it is Π(1 − s|ω_j|); means over the sphere are E|ω_j| = 1/2,
    E|ω_i ω_j| = 2/(3π) and E|ω_1 ω_2 ω_3| = 1/(4π).
    """
    s = movement / (ratio - 1.0)
    return 1.0 - 1.5 * s + 2.0 * s**2 / math.pi - s**3 / (4.0 * math.pi)


def mean_way(nodes: int = 48) -> float:
    """Mean way from a point in the unit cube to its surface, over all points and directions.

    The integral of 1/(4π|x − y|²) over x and y in the cube; in the largest coordinate h of y − x and the other two
    over it, a and b, the pole is gone: (12/π) ∫∫∫ (1 − h)(1 − ah)(1 − bh)/(1 + a² + b²) da db dh over b ≤ a ≤ 1, by
    symmetry half of the square.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    h, a, b = np.meshgrid(x, x, x, indexing="ij")
    weight = w[:, None, None] * w[None, :, None] * w[None, None, :]
    density = (1.0 - h) * (1.0 - a * h) * (1.0 - b * h) / (1.0 + a**2 + b**2)
    return float(6.0 / math.pi * np.sum(weight * density))


def weak_bound(movement: float, ratio: float) -> float:
    """The paper's product for a movement in all directions at once, over L − l: a lower bound."""
    return max(0.0, 1.0 - 2.0 * movement / (ratio - 1.0)) ** 3


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was drawn."""
    return {
        "tests per ratio": measured.tests, "seed": SEED, "inner cube": "side l = 1, anywhere inside with equal density",
        "direction": "equal density over the sphere", "delta_d": 0.0,
        "ratio": "L/l; the paper's text says l/L, with which its finding on the probability would be reversed",
        "weak bound": "prod (L - l - 2 d)/(L - l); the paper prints L as denominator, which is not 1 for d = 0",
        "chosen": "ratios, movements, delta_d: the paper's axes are not in its text",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """The expected free movement distance by ratio; the probability by ratio and movement."""
    slope = mean_way()
    ways = [
        (ratio, 1.0 / ratio, float(free), float(error), slope * (ratio - 1.0), float(free) / ratio)
        for ratio, free, error in zip(RATIOS, measured.free, measured.error, strict=True)
    ]
    chances = []
    for ratio, row in zip(RATIOS, measured.inside, strict=True):
        for movement, chance in zip(MOVEMENTS, row, strict=True):
            exact = probability(movement, ratio) if movement <= ratio - 1.0 else ""
            chances.append((ratio, movement, float(chance), exact, weak_bound(movement, ratio)))
    return {
        "": Table(
            ("L/l", "l/L", "expected free movement [l]", "standard error [l]", "exact [l]", "expected [L]"), ways
        ),
        "probability": Table(("L/l", "movement [l]", "probability", "exact", "weak bound"), chances),
    }


def _chance(measured: Measured, ratio: float, movement: float) -> float:
    return float(measured.inside[RATIOS.index(ratio), MOVEMENTS.index(movement)])


def here(measured: Measured) -> str:
    """Slope and the example."""
    slope = float(np.sum(measured.free * (np.array(RATIOS) - 1.0)) / np.sum((np.array(RATIOS) - 1.0) ** 2))
    chances = ", ".join(f"{_chance(measured, ratio, EXAMPLE):.4f}" for ratio in (1.25, 2.0, 10.0))
    tenths = ", ".join(f"{_chance(measured, ratio, 0.1):.3f}" for ratio in (1.25, 2.0, 10.0))
    return (
        f"{measured.tests:,} tests per ratio: exactly linear, {slope:.4f} (L − l), {mean_way():.4f} by quadrature; "
        f"a movement of {EXAMPLE:g} stays inside with probability {chances} at L/l = 1.25, 2, 10, one of 0.1 with "
        f"{tenths}"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """Against closed forms, within what chance allows, and the paper's findings."""
    slope = mean_way()
    far = np.abs(measured.free - slope * (np.array(RATIOS) - 1.0)) / measured.error
    off = []
    for ratio, row in zip(RATIOS, measured.inside, strict=True):
        for movement, chance in zip(MOVEMENTS, row, strict=True):
            if movement <= ratio - 1.0:
                exact = probability(movement, ratio)
                off.append(abs(chance - exact) / math.sqrt(max(exact * (1.0 - exact), 1e-9) / measured.tests))
    small, clear = MOVEMENTS.index(EXAMPLE), [MOVEMENTS.index(0.1), MOVEMENTS.index(0.2)]
    grows = bool(np.all(np.diff(measured.inside[:, clear], axis=0) > 0.0))
    bound = all(
        chance >= weak_bound(movement, ratio)
        for ratio, row in zip(RATIOS, measured.inside, strict=True)
        for movement, chance in zip(MOVEMENTS, row, strict=True)
    )
    return [
        Check("expected free movement: largest difference [standard errors]", float(far.max()), 0.0, ERRORS,
              "the mean way to the surface of a cube of side L − l, by quadrature: linear in L/l"),
        Check("probability: largest difference [standard errors]", float(max(off)), 0.0, ERRORS,
              "1 − 3s/2 + 2s²/π − s³/(4π), s = movement/(L − l)"),
        Check.true("the probability grows with the ratio", grows,
                   "the paper's finding; movements of 0.1 and 0.2, where chance does not blur it"),
        Check.true("a movement of 0.0015 almost never leaves", float(measured.inside[:, small].min()) > CERTAIN,
                   "the paper's example: almost one, here above 0.99 at every ratio"),
        Check.true("the weak condition is a lower bound", bound, "what stays inside in all directions does in one"),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """Both panels: points from the tests, lines from the closed forms."""
    note = (
        f"Points: {measured.tests:,} tests each; lines: exact. Dashed: the paper's weak condition, a movement in all "
        "directions at once."
    )
    figure = pictures.figure("Figure 4: an inner cube of side l that moves in a cube of side L", (11.5, 5.0), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "(a) expected free movement distance", "L/l", "distance / l")
    pictures.tidy(right, "(b) probability of penetration free movement", "movement / l", "probability")
    ratios = np.array(RATIOS)
    left.plot([1.0, ratios[-1]], [0.0, mean_way() * (ratios[-1] - 1.0)], color=pictures.FAINT, linewidth=1.5)
    left.plot(ratios, measured.free, "o", color="#2f5d8c", markersize=5)
    pictures.caption(left, f"{mean_way():.4f} (L − l)")
    colours = ("#9c2f35", "#c08a2e", "#7d8a3c", "#3f7a57", "#2f5d8c", "#5b4a8a")
    fine = np.linspace(0.0, 1.0, 201)
    for ratio, colour in zip(DRAWN, colours, strict=True):
        exact = fine[fine <= ratio - 1.0]
        right.plot(exact, [probability(float(m), ratio) for m in exact], color=colour, linewidth=1.5)
        right.plot(fine, [weak_bound(float(m), ratio) for m in fine], color=colour, linewidth=0.9, linestyle="--")
        right.plot(
            MOVEMENTS, measured.inside[RATIOS.index(ratio)], "o", color=colour, markersize=4, label=f"L/l = {ratio:g}"
        )
    right.legend(frameon=False, fontsize=9.5, loc="upper center", ncols=3)
    right.set_ylim(-0.02, 1.25)
    return pictures.png(figure)
