"""The units of Kawabata's Evaluation System, in which the thesis's bending coefficients are read, and its fabrics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

__all__ = ["CURVATURE", "MOMENT", "QUADRATIC", "RIGIDITY", "Loop"]

# What one unit of KES is in SI (papers/notes 4.2, item 18).
RIGIDITY = 9.80665e-5  # gf cm²/cm in N m
MOMENT = 9.80665e-3  # gf cm/cm in N
CURVATURE = 100.0  # 1/cm in 1/m
QUADRATIC = 9.80665e-7  # gf cm³/cm in N m²


@dataclass(frozen=True)
class Loop:
    """Coefficients of a hysteresis loop as the thesis prints them, read in KES units.

    Attributes
    ----------
    b1, b2 : float
        Initial rigidity, and rigidity once friction is overcome [gf cm²/cm].
    c1 : float
        Quadratic coefficient of positive curvatures [gf cm³/cm], < 0.
    plasticity, fatigue : float
        λ and μ.
    """

    b1: float
    b2: float
    c1: float
    plasticity: float = 0.0
    fatigue: float = 0.0

    # Closed forms, KES units (papers/notes 4.1) ----------------------------------------------------------------

    @property
    def k0(self) -> float:
        """K0 = (b1 − b2)/(2 |c1|), the curvature at which friction is overcome [1/cm]."""
        return (self.b1 - self.b2) / (2.0 * abs(self.c1))

    @property
    def m0(self) -> float:
        """M0 = (b1 − b2) K0/2, the frictional moment [gf cm/cm]; half of the coercive couple 2HB."""
        return 0.5 * (self.b1 - self.b2) * self.k0

    @property
    def ma(self) -> float:
        """Ma = M0 + b2 K0, the moment at K0 of the first loading [gf cm/cm]."""
        return self.m0 + self.b2 * self.k0

    def area(self, peak: float) -> float:
        """Area of the full loop between ± ``peak`` [1/cm] ≥ K0: 4 M0 (Km − 2/3 K0) [gf/cm]."""
        return 4.0 * self.m0 * (peak - 2.0 / 3.0 * self.k0)

    def residual(self, cycles: float) -> float:
        """Rest curvature after complete one-sided cycles, λ (M0/b2) (1 − (1−μ)ⁿ)/μ [1/cm]: (4.6) with (4.11) summed."""
        decay = cycles if self.fatigue == 0.0 else (1.0 - math.pow(1.0 - self.fatigue, cycles)) / self.fatigue
        return self.plasticity * self.m0 / self.b2 * decay

    def stiffness(self, cycles: float) -> float:
        """Initial rigidity after complete cycles, b2 + (1−μ)^(n/2) (b1 − b2) [gf cm²/cm]: (4.12) repeated."""
        return self.b2 + math.pow(1.0 - self.fatigue, 0.5 * cycles) * (self.b1 - self.b2)

    def couple(self, cycles: float) -> float:
        """Coercive couple 2 M0 after complete cycles, (1−μ)ⁿ 2 M0 [gf cm/cm]: (4.11) repeated."""
        return math.pow(1.0 - self.fatigue, cycles) * 2.0 * self.m0

    # SI --------------------------------------------------------------------------------------------------------

    def si(self) -> dict[str, float]:
        """b1, b2 [N m], c1 [N m²], plasticity, fatigue: the keys of `clothsim.bending.trace`."""
        return {
            "b1": self.b1 * RIGIDITY, "b2": self.b2 * RIGIDITY, "c1": self.c1 * QUADRATIC,
            "plasticity": self.plasticity, "fatigue": self.fatigue,
        }  # fmt: skip

    def law(self, model: str, **values: float) -> dict[str, Any]:
        """The ``bending`` table of a material: linear (b2), nonlinear, plastic (b2 up to K0) or hysteresis.

        Hinges bend each by itself, as in the thesis.
        """
        si = self.si()
        curve = {key: si[key] for key in ("b1", "b2", "c1")}
        extra: dict[str, Any] = {"hinges": "independent", **values}
        if model == "linear":
            return {"model": "hinge", "rigidity": si["b2"], **extra}
        if model == "plastic":
            return {"model": "plastic", "rigidity": si["b2"], "elastic_limit": self.k0 * CURVATURE, **extra}
        if model == "nonlinear":
            return {"model": "nonlinear", **curve, **extra}
        return {"model": "hysteresis", **si, **extra}

    def named(self) -> dict[str, Any]:
        """The coefficients for the head of a table."""
        return {
            "b1 [gf cm2/cm]": self.b1, "b2 [gf cm2/cm]": self.b2, "c1 [gf cm3/cm]": self.c1,
            "lambda": self.plasticity, "mu": self.fatigue,
            "units": "the thesis prints none; read as KES: 1 gf cm2/cm = 9.80665e-5 N m; 1/cm = 100 1/m; "
            "1 gf cm/cm = 9.80665e-3 N",
        }  # fmt: skip
