"""Whether a run made energy from nothing.

The account is that of a passive system: while nothing is moved from outside, the mechanical energy E of the cloth
(kinetic, elastic and in the field of gravity) may only fall. Over a stretch of the run in which pins and colliders
stand still,

    growth = max over t₁ < t₂ of E(t₂) − E(t₁),    relative to what was available,

    available = E(start of the stretch) − lowest energy in the field of gravity.

What contact may do anyway, as it rests at a distance, is no growth, and no less than that is available: lifting all the
cloth by the thickness h in standard gravity, M g h. Kinetic energy and gravity come from positions, velocities and
masses here; elastic energy is the engine's. While pins or colliders move, the work that they do is not known from
positions alone: the account rests, and starts anew when they stand.

A step that is too large for what it meets shows as growth that is taken away again by an implicit integrator. A run
that has not come back from it in its last quarter has run away: ``left`` is the growth since the start of the last
stretch that is there all the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats

__all__ = ["Entry", "Growth", "external", "growth"]


@dataclass(frozen=True)
class Entry:
    """The account at one moment.

    Attributes
    ----------
    kinetic, elastic, gravity : float
        Energies [J].
    driven : bool
        Whether pins or colliders have moved since the entry before.
    """

    kinetic: float
    elastic: float
    gravity: float
    driven: bool

    @property
    def total(self) -> float:
        """E [J]."""
        return self.kinetic + self.elastic + self.gravity


def external(masses: Floats, x: Floats, v: Floats, gravity: Floats, origin: Floats) -> tuple[float, float]:
    """Kinetic energy ½ Σ m v² and energy in the field of gravity −Σ m g·(x − origin) [J]."""
    kinetic = 0.5 * float(masses @ np.einsum("ij,ij->i", v, v))
    return kinetic, -float(masses @ ((x - origin) @ gravity))


@dataclass(frozen=True)
class Growth:
    """Energy from nothing, relative to what was available.

    Attributes
    ----------
    most : float
        The largest growth between any two moments.
    left : float
        The least excess over the start in the last quarter of the moments.
    """

    most: float
    left: float


def growth(entries: Sequence[Entry], allowed: float = 0.0) -> Growth:
    """Growth of the energy; the worst of the stretches between motions from outside.

    Parameters
    ----------
    entries : sequence of Entry
        In the order of time.
    allowed : float
        What contact may add [J]; the rounding of E counts as that anyway.
    """
    most, left, first = 0.0, 0.0, 0
    for k in range(1, len(entries) + 1):
        if k == len(entries) or entries[k].driven:
            own = _stretch(entries[first:k], allowed)
            most, first = max(most, own.most), k
            left = own.left  # of the last stretch
    return Growth(most, left)


def _stretch(entries: Sequence[Entry], allowed: float) -> Growth:
    own = np.array([e.total for e in entries])
    if not np.isfinite(own).all():
        return Growth(float("inf"), float("inf"))
    start = entries[0]
    available = start.total - min(e.gravity for e in entries)
    # Sums of terms of this size are not known any better.
    rounding = 1e-12 * (abs(start.kinetic) + abs(start.elastic) + abs(start.gravity))
    allowed = max(allowed, rounding, np.finfo(float).tiny)
    available = max(available, allowed)
    risen = float(np.max(own - np.minimum.accumulate(own))) - allowed
    stays = float(np.min(own[-max(1, len(own) // 4) :] - own[0])) - allowed
    return Growth(max(0.0, risen) / available, max(0.0, stays) / available)
