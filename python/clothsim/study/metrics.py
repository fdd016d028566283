"""What a study measures of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clothsim._arrays import Floats
from clothsim._nearest import hint
from clothsim.errors import InvalidInput
from clothsim.study.state import State
from clothsim.study.surface import hull_area, locate, nearest, sample, shadow_area

__all__ = ["METRICS", "Metric", "metrics"]


@dataclass(frozen=True)
class Metric:
    """A number of a run.

    Attributes
    ----------
    name, unit, meaning : str
        What it is.
    kind : {"distance", "quantity", "drift"}
        A distance compares with the reference; a quantity is the run's own, and its error is its difference from the
        reference's; a drift is an error by itself, zero in the exact answer.
    measure : callable
        ``measure(state, reference)`` for a distance, ``measure(state)`` for the others; None where the scene has no
        such number.
    """

    name: str
    unit: str
    meaning: str
    kind: str
    measure: Callable[..., float | None]

    @property
    def needs_reference(self) -> bool:
        """Whether its error does."""
        return self.kind != "drift"


def _apart(state: State, reference: State) -> Floats:
    """Distance of each vertex of the reference from the same material point of the run, at the end [m]."""
    if state.triangles.shape == reference.triangles.shape and np.array_equal(state.triangles, reference.triangles):
        return np.asarray(np.linalg.norm(state.x_end - reference.x_end, axis=1))
    out = []
    for (own, triangles), (there, _) in zip(state.parts(), reference.parts(), strict=True):
        places = locate(reference.x_start[there], state.x_start[own], triangles)
        out.append(np.linalg.norm(sample(places, state.x_end[own], triangles) - reference.x_end[there], axis=1))
    return np.concatenate(out)


def _rms(state: State, reference: State) -> float:
    return float(np.sqrt(np.mean(_apart(state, reference) ** 2)))


def _max(state: State, reference: State) -> float:
    return float(_apart(state, reference).max())


def _shape(state: State, reference: State) -> float:
    squares = []
    for (own, triangles), (there, others) in zip(state.parts(), reference.parts(), strict=True):
        squares.append(np.mean(nearest(reference.x_end[there], state.x_end[own], triangles)[0] ** 2))
        squares.append(np.mean(nearest(state.x_end[own], reference.x_end[there], others)[0] ** 2))
    return float(np.sqrt(np.mean(squares)))


def _energy(state: State) -> float:
    """Largest change of the total over the largest change of any of its parts."""
    total = state.energy("total")
    parts = [np.ptp(state.energy(kind)) for kind in state.facts["energy_kinds"] if kind != "total"]
    largest = max(parts)
    return float(np.abs(total - total[0]).max() / largest) if largest > 0.0 else 0.0


def _momentum(state: State) -> float | None:
    """|p(T) − p(0) − M g T| over Σ m |v|, where nothing but gravity acts from outside."""
    if not _free(state):
        return None
    seconds = float(state.times[-1])
    gravity = np.array(state.data.get("gravity") or ([0, -9.81, 0] if state.data["up"] == "y" else [0, 0, -9.81]))
    gained = state.masses @ (state.v_end - state.v_start)
    scale = max(float(state.masses @ np.linalg.norm(v, axis=1)) for v in (state.v_start, state.v_end))
    off = float(np.linalg.norm(gained - state.masses.sum() * seconds * gravity))
    return off / scale if scale > 0.0 else 0.0


def _spin(state: State) -> float | None:
    """Change of the angular momentum about the centre of mass over Σ m |r| |v|, where no torque acts from outside."""
    if not _free(state):
        return None
    spins, scales = [], []
    for x, v in ((state.x_start, state.v_start), (state.x_end, state.v_end)):
        m = state.masses / state.masses.sum()
        r, u = x - m @ x, v - m @ v
        spins.append(state.masses @ np.cross(r, u))
        scales.append(float(state.masses @ (np.linalg.norm(r, axis=1) * np.linalg.norm(u, axis=1))))
    return float(np.linalg.norm(spins[1] - spins[0]) / max(scales)) if max(scales) > 0.0 else 0.0


def _free(state: State) -> bool:
    """Whether nothing outside but gravity acts on the cloth."""
    air = state.data.get("air") or {}
    blown = bool(air.get("drag") or air.get("lift") or air.get("damping"))
    return not (state.pinned.any() or blown or (state.data.get("contact") and len(state.collider_start)))


def _drape(state: State) -> float | None:
    """(shadow − pedestal)/(cloth − pedestal), where the pedestal is what pinned vertices span."""
    plane = [0, 2] if state.data["up"] == "y" else [0, 1]
    shadow = shadow_area(state.x_end[:, plane], state.triangles)
    pedestal = hull_area(state.x_end[state.pinned][:, plane]) if state.pinned.any() else 0.0
    corners = state.x_start[state.triangles]
    whole = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    ring = 0.0 if pedestal == 0.0 else float(_spanned(state, plane))
    flat = float(whole) + ring - pedestal
    return (max(shadow, pedestal) - pedestal) / flat if flat > 1e-9 * whole else None


def _spanned(state: State, plane: list[int]) -> float:
    """Area within the cloth that holds none, as in a disc that is cut out where it lies on its pedestal."""
    whole = hull_area(state.x_start[:, plane])
    return max(0.0, whole - shadow_area(state.x_start[:, plane], state.triangles)) if whole > 0.0 else 0.0


def _contact(state: State) -> float | None:
    """By how much [m] cloth vertices at the end are nearer to colliders than the thickness."""
    contact = state.data.get("contact")
    if not contact or not len(state.collider_triangles):
        return None
    distance, _ = nearest(state.x_end[~state.pinned], state.collider_end, state.collider_triangles)
    return float(max(0.0, contact["thickness"] - distance.min())) if len(distance) else 0.0


def _stick(state: State) -> float | None:
    """Fastest way [m/s], over the last quarter, of cloth that lies on colliders that stand."""
    contact = state.data.get("contact")
    if not contact or not len(state.collider_triangles):
        return None
    if not np.array_equal(state.collider_end, state.collider_late):
        return None
    free = ~state.pinned
    distance, _ = nearest(state.x_end[free], state.collider_end, state.collider_triangles)
    lies = distance <= 1.5 * contact["thickness"]
    if not lies.any():
        return None
    way = np.linalg.norm(state.x_end[free] - state.x_late[free], axis=1)[lies]
    late = state.facts.get("late_seconds", 0.25 * float(state.times[-1]))
    return float(way.max() / late)


def _lowest(state: State) -> float:
    return float(state.x_end[:, 1 if state.data["up"] == "y" else 2].min())


def _final_energy(state: State) -> float:
    """Energy that the cloth holds in its deformation at the end."""
    kinds = [k for k in state.facts["energy_kinds"] if k not in ("total", "kinetic", "gravity")]
    return float(sum(state.energy(k)[-1] for k in kinds))


def _kinetic(state: State) -> float:
    return float(state.energy("kinetic")[-1])


_ALL = (
    Metric("rms", "m", "RMS distance of vertices from the same material points of the reference", "distance", _rms),
    Metric("max", "m", "largest distance of a vertex from the same material point of the reference", "distance", _max),
    Metric("shape", "m", "RMS distance between the surfaces; sliding along them does not count", "distance", _shape),
    Metric("energy_drift", "-", "largest change of the total energy over the largest of one kind", "drift", _energy),
    Metric("momentum_drift", "-", "momentum that gravity does not explain, over Σ m |v|", "drift", _momentum),
    Metric("spin_drift", "-", "change of the angular momentum, over Σ m |r| |v|", "drift", _spin),
    Metric("contact_error", "m", "what cloth vertices lack to the contact thickness at the end", "drift", _contact),
    Metric("stick_drift", "m/s", "fastest drift of cloth that lies on standing colliders, late", "drift", _stick),
    Metric("drape", "-", "drape coefficient: the shadow over the flat cloth's, less the pedestal", "quantity", _drape),
    Metric("lowest", "m", "height of the lowest vertex at the end", "quantity", _lowest),
    Metric("strain_energy", "J", "energy of deformation at the end", "quantity", _final_energy),
    Metric("kinetic_energy", "J", "energy of motion at the end", "quantity", _kinetic),
)  # fmt: skip
METRICS = {metric.name: metric for metric in _ALL}


def metrics(names: list[str]) -> list[Metric]:
    """Look metrics up.

    Raises
    ------
    InvalidInput
        One is not known; the nearest is named.
    """
    for name in names:
        if name not in METRICS:
            expected = f"one of {', '.join(METRICS)}"
            raise InvalidInput(
                f'metric: expected {expected}, got "{name}"{hint(name, METRICS, 0.4)}', name="metric", expected=expected
            )
    return [METRICS[name] for name in dict.fromkeys(names)]
