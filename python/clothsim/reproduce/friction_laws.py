"""The thesis's four friction laws with its parameters, and the differential equation of a body that slides so."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce import pictures

__all__ = ["COLOURS", "GRAVITY", "LAWS", "NAMES", "TABLE_7_1", "Coefficients", "Slide", "slide"]

LAWS = ("C", "CS", "CSS", "CSSV")
# What a scene calls them.
NAMES = {"C": "coulomb", "CS": "coulomb-stiction", "CSS": "stribeck", "CSSV": "viscous"}
# As in the thesis's figure 7.6.
COLOURS = {
    "C": pictures.LAWS["nonlinear"], "CS": pictures.LAWS["hysteresis"], "CSS": pictures.LAWS["linear"],
    "CSSV": pictures.LAWS["plastic"],
}  # fmt: skip
GRAVITY = 9.81  # m/s²
# Mass that one contact of the thesis stands for [kg]: with its F_v = 6e-5 it leaves F_v/m = 0.6 1/s (papers/notes 7.5).
_CONTACT_MASS = 1e-4


@dataclass(frozen=True)
class Coefficients:
    """A column of Table 7.1.

    Attributes
    ----------
    mu_c, mu_s : float
        Kinetic and static coefficient, cloth on an object.
    self_c, self_s : float
        The same of cloth on itself.
    v_s : float
        Stribeck velocity [m/s].
    delta_s : float
        Stribeck exponent.
    f_v : float
        F_v as printed, for one contact; 0 where the thesis says N/A.
    delta_v : float
        Exponent of the viscous term.
    """

    mu_c: float
    mu_s: float
    self_c: float
    self_s: float
    v_s: float = 0.4
    delta_s: float = 0.2
    f_v: float = 0.0
    delta_v: float = 1.0

    @property
    def rate(self) -> float:
        """F_v over the mass of a contact [1/s]."""
        return self.f_v / _CONTACT_MASS

    def per_area(self, areal_density: float) -> float:
        """F_v of one area of contact [N/m² per m/s], such that a cloth of that areal density [kg/m²] keeps `rate`."""
        return self.rate * areal_density

    def friction(self, law: str, areal_density: float) -> dict[str, Any]:
        """Make the scene's ``friction`` table of a law, cloth on an object."""
        return self._table(law, self.mu_c, self.mu_s, areal_density)

    def self_friction(self, law: str, areal_density: float) -> dict[str, Any]:
        """The same, of cloth on itself."""
        return self._table(law, self.self_c, self.self_s, areal_density)

    def _table(self, law: str, mu_c: float, mu_s: float, areal_density: float) -> dict[str, Any]:
        table: dict[str, Any] = {"law": NAMES[law], "mu_c": mu_c}
        if law != "C":
            table["mu_s"] = mu_s
        if law in ("CSS", "CSSV"):
            table |= {"v_s": self.v_s, "delta_s": self.delta_s}
        if law == "CSSV":
            table |= {"f_v": self.per_area(areal_density), "delta_v": self.delta_v}
        return table

    def acceleration(self, law: str, speed: Floats, pressing: float) -> Floats:
        """(7.7) over the mass, of a body that ``pressing`` [m/s²] presses on what it slides on [m/s²]."""
        speed = np.asarray(speed, dtype=np.float64)
        excess = np.exp(-((speed / self.v_s) ** self.delta_s)) if law in ("CSS", "CSSV") else 0.0
        viscous = self.rate * speed**self.delta_v if law == "CSSV" else 0.0
        return np.asarray((self.mu_c + (self.mu_s - self.mu_c) * excess) * pressing + viscous + 0.0 * speed)

    def static(self, law: str) -> float:
        """Coefficient of what holds a body at rest: that of friction for C."""
        return self.mu_c if law == "C" else self.mu_s

    def named(self) -> dict[str, Any]:
        """The column for the head of a table."""
        return {
            "mu_c (object, self)": f"{self.mu_c:g}, {self.self_c:g}",
            "mu_s (object, self)": f"{self.mu_s:g}, {self.self_s:g}",
            "v_S [m/s]": self.v_s, "delta_S": self.delta_s, "F_v as printed": self.f_v or "N/A",
            **({"F_v over the mass of a contact [1/s]": self.rate, "delta_v": self.delta_v} if self.f_v else {}),
        }  # fmt: skip


TABLE_7_1 = {
    "incline plane": Coefficients(0.2, 0.3, 0.1, 0.15),
    "skirt": Coefficients(0.2, 0.4, 0.1, 0.2),
    "stick-slip": Coefficients(0.1, 0.4, 0.1, 0.1),
    "card": Coefficients(0.1, 0.2, 0.1, 0.2, f_v=6e-5),
    "sphere": Coefficients(0.2, 0.35, 0.1, 0.15, f_v=6e-5),
}


# A body that slides ---------------------------------------------------------------------------------------------

_STEPS = 2000


@dataclass(frozen=True)
class Slide:
    """Speed [m/s] and way [m] of a sliding body at ``times`` [s]."""

    times: Floats
    speed: Floats
    way: Floats


def slide(coefficients: Coefficients, law: str, times: Floats, *, driving: float, pressing: float) -> Slide:
    """Solve dv/dt = driving − friction(v) from rest, at times ≥ 0 [s]; a body that stiction holds stays where it is.

    With t = τᵖ, p = 1/δ_S, the Stribeck term, whose slope is infinite at v = 0, is smooth in τ: Runge's and Kutta's
    method of order 4 in τ, 2,000 steps, cubic in between; errors below 1e-9 of the end's values.

    Parameters
    ----------
    driving, pressing : float
        Acceleration along the plane and against it [m/s²]: g sin α, g cos α on a slope.
    """
    c, times = coefficients, np.asarray(times, dtype=np.float64)
    if driving <= coefficients.static(law) * pressing:
        return Slide(times, np.zeros_like(times), np.zeros_like(times))
    power = max(1.0, 1.0 / coefficients.delta_s)
    tau = np.linspace(0.0, max(float(times.max()), 1e-300) ** (1.0 / power), _STEPS + 1)

    def rate(at: float, v: float) -> tuple[float, float]:
        stretch = power * at ** (power - 1.0)
        # The same as `Coefficients.acceleration`, of one number.
        excess = math.exp(-((v / c.v_s) ** c.delta_s)) if law in ("CSS", "CSSV") else 0.0
        viscous = c.rate * v**c.delta_v if law == "CSSV" else 0.0
        net = driving - (c.mu_c + (c.mu_s - c.mu_c) * excess) * pressing - viscous
        return stretch * net, stretch * v

    h = float(tau[1])
    knots = tau.tolist()
    path = [(0.0, 0.0)]
    for k in range(_STEPS):
        v, s = path[k]
        v1, s1 = rate(knots[k], v)
        v2, s2 = rate(knots[k] + 0.5 * h, v + 0.5 * h * v1)
        v3, s3 = rate(knots[k] + 0.5 * h, v + 0.5 * h * v2)
        v4, s4 = rate(knots[k] + h, v + h * v3)
        path.append((v + h * (v1 + 2.0 * (v2 + v3) + v4) / 6.0, s + h * (s1 + 2.0 * (s2 + s3) + s4) / 6.0))
    slopes = np.array([rate(t, v) for t, (v, _) in zip(knots, path, strict=True)])
    values = np.array(path)
    speed, way = (_cubic(times ** (1.0 / power), tau, values[:, k], slopes[:, k]) for k in (0, 1))
    return Slide(times, speed, way)


def _cubic(x: Floats, knots: Floats, values: Floats, slopes: Floats) -> Floats:
    """Hermite's cubic between equal knots, by values and slopes."""
    h = knots[1] - knots[0]
    left = np.clip(np.floor(x / h).astype(np.int64), 0, len(knots) - 2)
    s = x / h - left
    a, b, p, q = values[left], values[left + 1], h * slopes[left], h * slopes[left + 1]
    cubic: Floats = a + s * (p + s * (3.0 * (b - a) - 2.0 * p - q + s * (2.0 * (a - b) + p + q)))
    return cubic
