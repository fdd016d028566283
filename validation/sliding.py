"""Accurate solutions of a block that slides and sticks in one dimension under a friction law.

A block of mass m [kg] and contact area A [m²] is pressed by N [N] and pulled by F(t, x) [N] along x. While it
slides with the speed w it feels, against its motion,

    F_k(w) = N (μ_c + (μ_s − μ_c) exp(−(w/v_s)^δ_s)) + A f_v w^δ_v

and while it stands it stays as long as |F| ≤ μ_s N. Source: thesis, 7.1 to 7.7, with the viscous part per area.

No integration crosses the start or the end of a slip: both are events. Where a slip starts out of balance (F = μ_s N)
under a law with an infinite slope at w = 0 (δ_s < 1), its speed grows like t^(1/(1−δ_s)) and w = 0 solves the equation
as well; there s = w^(1−δ_s) is integrated, whose equation is regular and has one solution.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

RTOL, ATOL = 1e-10, 1e-14
# A slip that started in s goes on in w from this share of v_s.
SWITCH = 1e-3
# A block that stands is looked at so often for its next start [1/s].
LOOKS = 2000.0
# Nodes of the quadrature over the speed.
NODES = 200

Pull = Callable[[float, float], float]


class Law(NamedTuple):
    """A friction law by its parameters; v_s [m/s], f_v [N/m² (s/m)^delta_v]."""

    law: str
    mu_c: float
    mu_s: float
    v_s: float = 1.0
    delta_s: float = 1.0
    f_v: float = 0.0
    delta_v: float = 1.0

    @property
    def table(self) -> dict[str, Any]:
        """The law as a scene file has it."""
        names = {
            "coulomb": ("mu_c",),
            "coulomb-stiction": ("mu_c", "mu_s"),
            "stribeck": ("mu_c", "mu_s", "v_s", "delta_s"),
            "viscous": self._fields[1:],
        }
        return {"law": self.law, **{name: getattr(self, name) for name in names[self.law]}}

    def drop(self, speed: Any) -> Any:
        """How far the coefficient has fallen below μ_s at a sliding speed w > 0."""
        gap = self.mu_s - self.mu_c
        return -gap * np.expm1(-((speed / self.v_s) ** self.delta_s)) if self.law in ("stribeck", "viscous") else gap

    def kinetic(self, normal: float, area: float, speed: Any) -> Any:
        """F_k [N] at the sliding speed w ≥ 0 [m/s]."""
        return normal * (self.mu_s - self.drop(speed)) + area * self.f_v * speed**self.delta_v


def coulomb(mu: float) -> Law:
    """Coulomb's law."""
    return Law("coulomb", mu, mu)


def laws(mu_c: float, mu_s: float, v_s: float, delta_s: float, f_v: float, delta_v: float = 1.0) -> dict[str, Law]:
    """The four laws with one set of parameters, by the thesis's names."""
    return {
        "C": coulomb(mu_c),
        "CS": Law("coulomb-stiction", mu_c, mu_s),
        "CSS": Law("stribeck", mu_c, mu_s, v_s, delta_s),
        "CSSV": Law("viscous", mu_c, mu_s, v_s, delta_s, f_v, delta_v),
    }


class Block(NamedTuple):
    """A block: mass [kg], normal force [N], contact area [m²], law."""

    mass: float
    normal: float
    area: float
    law: Law


class Motion(NamedTuple):
    """Samples of a motion, and when it slipped: (start, end) [s] of each slip; one that goes on ends at infinity."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    slips: list[tuple[float, float]]


def _stays_until(pull: Pull, x: float, limit: float, t: float, end: float) -> float:
    """When |F| exceeds the limit at the place x; ``end`` if it does not before."""

    def excess(time: float) -> float:
        return abs(pull(time, x)) - limit

    looks = np.linspace(t, end, max(2, int(np.ceil((end - t) * LOOKS)) + 1))
    for a, b in pairwise(looks):
        if excess(b) > 0.0:
            return float(brentq(excess, a, b, xtol=1e-15, rtol=1e-14)) if excess(a) < 0.0 else float(a)
    return end


def _slip_from_balance(block: Block, pull: Pull, sign: float, t: float, x: float, end: float) -> Any:
    """A slip that starts where F = μ_s N under a law of infinite slope: in s = w^(1−δ), until w = SWITCH v_s."""
    law, power = block.law, 1.0 - block.law.delta_s
    slope = block.normal * (law.mu_s - law.mu_c) / law.v_s**law.delta_s

    def rate(time: float, y: Any) -> list[float]:
        s = max(float(y[1]), 0.0)
        w = s ** (1.0 / power)
        if s == 0.0:
            return [0.0, power * slope / block.mass]
        excess = sign * pull(time, float(y[0])) - block.law.mu_s * block.normal
        viscous = block.area * law.f_v * w**law.delta_v
        return [sign * w, power * (block.normal * law.drop(w) + excess - viscous) / (block.mass * w**law.delta_s)]

    def fast(_: float, y: Any) -> float:
        return float(y[1]) - (SWITCH * law.v_s) ** power

    fast.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rate, (t, end), [x, 0.0], "DOP853", events=fast, rtol=RTOL, atol=[ATOL, 1e-12], dense_output=True)
    return found, power


def solve(block: Block, pull: Pull, end: float, x: float = 0.0, v: float = 0.0, samples: int = 2001) -> Motion:
    """The motion from x [m] with the velocity v [m/s] at t = 0 until ``end`` [s]."""
    law = block.law
    limit = law.mu_s * block.normal
    singular = law.law in ("stribeck", "viscous") and law.delta_s < 1.0 and law.mu_s > law.mu_c
    times = np.linspace(0.0, end, samples)
    xs, vs = np.full(samples, x), np.zeros(samples)
    slips: list[tuple[float, float]] = []
    t = 0.0

    def write(found: Any, t0: float, t1: float, sign: float, power: float | None = None) -> None:
        inside = (times >= t0) & (times <= t1)
        if not inside.any():
            return
        y = found.sol(times[inside])
        xs[inside] = y[0]
        vs[inside] = sign * (y[1] if power is None else np.maximum(y[1], 0.0) ** (1.0 / power))

    while t < end:
        w, sign = abs(v), float(np.sign(v))
        if w == 0.0:
            start = _stays_until(pull, x, limit, t, end)
            xs[times >= t], vs[times >= t] = x, 0.0
            if start >= end:
                break
            t, sign = start, float(np.sign(pull(start, x)))
        slips.append((t, np.inf))
        begin = t
        if w == 0.0 and singular and abs(pull(t, x)) <= limit * (1.0 + 1e-9):
            found, power = _slip_from_balance(block, pull, sign, t, x, end)
            write(found, t, float(found.t[-1]), sign, power)
            t, x, w = float(found.t[-1]), float(found.y[0, -1]), float(found.y[1, -1]) ** (1.0 / power)

        def rate(time: float, y: Any, sign: float = sign) -> list[float]:
            w = max(float(y[1]), 0.0)
            force = sign * pull(time, float(y[0])) - law.kinetic(block.normal, block.area, w)
            return [sign * float(y[1]), float(force) / block.mass]

        def stops(time: float, y: Any, begin: float = begin) -> float:
            return float(y[1]) if time > begin else 1.0

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        if t >= end:
            break
        found = solve_ivp(rate, (t, end), [x, w], "DOP853", events=stops, rtol=RTOL, atol=ATOL, dense_output=True)
        write(found, t, float(found.t[-1]), sign)
        t, x, v = float(found.t[-1]), float(found.y[0, -1]), 0.0
        if found.status == 1:
            slips[-1] = (begin, t)
    return Motion(times, xs, vs, slips)


def slope(law: Law, angle: float, density: float, gravity: float, seconds: float) -> float:
    """Displacement [m] of a card on a slope after a time from rest; ``angle`` [rad], ``density`` [kg/m²]."""
    block = Block(density, density * gravity * np.cos(angle), 1.0, law)
    weight = density * gravity * np.sin(angle)
    return float(solve(block, lambda _t, _x: weight, seconds, samples=2).x[-1])


def slope_by_quadrature(law: Law, angle: float, density: float, gravity: float, seconds: float) -> float:
    """The same by quadrature over the speed: t = ∫ dw/a(w), x = ∫ w dw/a(w). For cards that slide."""
    normal = gravity * np.cos(angle)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    def acceleration(w: Any) -> Any:
        return gravity * np.sin(angle) - law.kinetic(normal, 1.0 / density, w)

    def integral(f: Callable[[Any], Any], end: float) -> float:
        # In u = w^(1/5): the integrands are smooth where w^0.2 is not.
        u = 0.5 * (nodes + 1.0) * end**0.2
        return float(0.5 * end**0.2 * (weights * f(u**5) * 5.0 * u**4).sum())

    if law.f_v > 0.0:
        # The speed at which the acceleration ends.
        top = brentq(acceleration, 1e-12, gravity * np.sin(angle) * density / law.f_v + 1.0) * (1.0 - 1e-9)
    else:
        top = gravity * seconds
    speed = brentq(lambda end: integral(lambda w: 1.0 / acceleration(w), end) - seconds, 1e-9, top, xtol=1e-13)
    return integral(lambda w: w / acceleration(w), speed)


class StickSlip(NamedTuple):
    """One period of a block pulled at a steady speed: times [s] and the way of a slip [m]."""

    stick: float
    slip: float
    way: float

    @property
    def period(self) -> float:
        """Stick and slip [s]."""
        return self.stick + self.slip


def stick_slip(block: Block, stiffness: float, speed: float) -> StickSlip:
    """Coulomb's law with stiction, exactly: a harmonic slip about the kinetic force, a stick phase until F = μ_s N.

    D = (μ_s − μ_c) N/k, ω = √(k/m): T_stick = 2 D/V, T_slip = (2/ω)(π − atan(D ω/V)), way 2 D + V T_slip.
    """
    gap = (block.law.mu_s - block.law.mu_c) * block.normal / stiffness
    omega = np.sqrt(stiffness / block.mass)
    slip = 2.0 / omega * (np.pi - np.arctan(gap * omega / speed))
    return StickSlip(2.0 * gap / speed, float(slip), float(2.0 * gap + speed * slip))


def capstan(mu: float, wrap: float) -> float:
    """Ratio of the tensions of a belt that slides over a cylinder: exp(μ φ); ``wrap`` [rad]."""
    return float(np.exp(mu * wrap))
