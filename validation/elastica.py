"""Planar heavy elastica: reference solutions of a strip that bends under its own weight.

A strip of unit width, areal density w [kg/m²] and rigidity B [N m] without stretch. θ(s) is its slope below the
horizontal at the arc length s, L the length that counts, Γ = w g L³/B. With s in units of L:

    θ″ = −n_y cos θ + n_x sin θ,   x′ = cos θ,   y′ = sin θ (down),   n_y = Γ (1 − s)

where (n_x, n_y) is the force in the strip in units of B/L² and the end s = 1 carries no vertical force.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

# Residual of the collocation solver, relative; tests compare with closed forms to better than a hundred times this.
TOLERANCE = 1e-8
# Factor of Γ from one solution to the next start.
CONTINUATION = 3.0
# Angle between the clamp and the tip in the tilted-plane test (ASTM D1388, BS 3356) [degrees].
PEIRCE_ANGLE = 41.5


class Curve(NamedTuple):
    """A solution: coordinates and slope along the strip, in units of its length."""

    s: np.ndarray
    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray

    @property
    def tip(self) -> tuple[float, float]:
        """Reach and droop of the end."""
        return float(self.x[-1]), float(self.y[-1])


def _solve(rhs: Any, ends: Any, s: Any, y: Any, p: Any = None) -> Any:
    solution = solve_bvp(rhs, ends, s, y, p=p, tol=TOLERANCE, max_nodes=200_000)
    if not solution.success:
        raise RuntimeError(f"elastica: {solution.message}")
    return solution


def _samples(solution: Any) -> Curve:
    s = np.linspace(0.0, 1.0, 401)
    values = solution.sol(s)
    return Curve(s, values[2], values[3], values[0])


def _steps(gamma: float) -> list[float]:
    """Values of Γ on the way to the last one."""
    steps = [gamma]
    while steps[0] > 1.0:
        steps.insert(0, steps[0] / CONTINUATION)
    return steps


@lru_cache(maxsize=256)
def cantilever(gamma: float) -> Curve:
    """Strip clamped horizontally at s = 0, free at s = 1: θ″ = −Γ (1 − s) cos θ, θ(0) = 0, θ′(1) = 0.

    Source: Bickley 1934; Peirce 1930.
    """
    s, y = np.linspace(0.0, 1.0, 101), np.zeros((4, 101))
    y[2] = s
    for g in _steps(gamma):

        def rhs(s: Any, y: Any, g: float = g) -> Any:
            return np.array([y[1], -g * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

        solution = _solve(rhs, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), s, y)
        s, y = solution.x, solution.y
    return _samples(solution)


@lru_cache(maxsize=64)
def loop(start: float, gamma: float) -> Curve:
    """Half of a hanging loop from its grip (s = 0) to its lowest point (s = 1), Γ = w g (L/2)³/B.

    θ(0) = ``start``, θ(1) = π and x(1) = 0. The slope at the grip makes the form: 0 the ring, −π/2 the heart,
    π/2 the pear loop. The horizontal force n_x is found with the shape.
    """
    s = np.linspace(0.0, 1.0, 201)
    theta = start + (np.pi - start) * s
    turn = np.pi - start
    x, height = (np.sin(theta) - np.sin(start)) / turn, (np.cos(start) - np.cos(theta)) / turn
    y, p = np.array([theta, np.full_like(s, turn), x, height]), [0.0]
    for g in [0.0, *_steps(gamma)] if gamma > 0.0 else [0.0]:

        def rhs(s: Any, y: Any, p: Any, g: float = g) -> Any:
            bend = p[0] * np.sin(y[0]) - g * (1.0 - s) * np.cos(y[0])
            return np.array([y[1], bend, np.cos(y[0]), np.sin(y[0])])

        def ends(a: Any, b: Any, p: Any) -> Any:
            del p
            return np.array([a[0] - start, b[0] - np.pi, a[2], b[2], a[3]])

        solution = _solve(rhs, ends, s, y, p)
        s, y, p = solution.x, solution.y, solution.p
    return _samples(solution)


def gamma_of_slope(ratio: float) -> float:
    """Γ of the cantilever whose droop is ``ratio`` times its reach."""

    def excess(log_gamma: float) -> float:
        reach, droop = cantilever(float(np.exp(log_gamma))).tip
        return droop / reach - ratio

    return float(np.exp(brentq(excess, np.log(1e-3), np.log(2e3), xtol=1e-9)))


def peirce_factor(angle: float) -> float:
    """Peirce's f(θ) = (cos(θ/2) / (8 tan θ))^⅓, so that the bending length is c = l f(θ).

    ``angle`` [degrees] between the horizontal and the line from the clamp to the tip of an overhang l. Approximate:
    the exact factor is Γ^(−1/3). Source: Peirce 1930.
    """
    theta = np.radians(angle)
    return float((np.cos(theta / 2.0) / (8.0 * np.tan(theta))) ** (1.0 / 3.0))


def peirce_loop(form: str, height: float) -> float:
    """Bending length over strip length by Peirce's loop formulas, from the loop's height over the strip's length.

    With f(θ) = (cos θ / tan θ)^⅓ and d = height − l0: ring l0 = 0.3183, c = 0.133 f(157° d/l0);
    heart l0 = 0.1337, c = l0 f(32.85° d/l0). Approximate. Source: Peirce 1930.
    """
    l0, factor, degrees = {"ring": (0.3183, 0.133, 157.0), "heart": (0.1337, 0.1337, 32.85)}[form]
    theta = np.radians(degrees * (height - l0) / l0)
    return float(factor * (np.cos(theta) / np.tan(theta)) ** (1.0 / 3.0))
