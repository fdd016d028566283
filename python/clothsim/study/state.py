"""What a run leaves for metrics: arrays at its start, late in it and at its end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats, Ints

__all__ = ["State", "pinned"]


@dataclass(frozen=True, eq=False)
class State:
    """Arrays of one run.

    Attributes
    ----------
    x_start, x_late, x_end, v_start, v_end : (n, 3) float64
        Positions [m] and velocities [m/s] of the cloth at the start, after three quarters, and at the end.
    triangles : (m, 3) int64
        Of all cloths.
    counts : (cloths,) int64
        Vertices of each cloth.
    masses : (n,) float64
        [kg].
    pinned : (n,) bool
        Vertices with a prescribed motion.
    collider_start, collider_late, collider_end : (k, 3) float64
        Vertices of all colliders [m].
    collider_triangles : (t, 3) int64
        Of all colliders.
    times, energies : (f,), (f, kinds) float64
        Energies over the run [s, J]; their kinds are in ``data``.
    facts : dict
        What the run reported.
    data : dict
        Tables of its scene.
    """

    x_start: Floats
    x_late: Floats
    x_end: Floats
    v_start: Floats
    v_end: Floats
    triangles: Ints
    counts: Ints
    masses: Floats
    pinned: NDArray[np.bool_]
    collider_start: Floats
    collider_late: Floats
    collider_end: Floats
    collider_triangles: Ints
    times: Floats
    energies: Floats
    facts: dict[str, Any]
    data: dict[str, Any]

    @classmethod
    def load(cls, path: Path, facts: dict[str, Any], data: dict[str, Any]) -> State:
        """Read what a worker wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(**dict(arrays), facts=facts, data=data)

    def parts(self) -> list[tuple[slice, Ints]]:
        """Vertices of each cloth, and its triangles with indices of its own."""
        out, first = [], 0
        for count in self.counts.tolist():
            last = first + count
            own = self.triangles[(self.triangles[:, 0] >= first) & (self.triangles[:, 0] < last)] - first
            out.append((slice(first, last), own))
            first = last
        return out

    def energy(self, kind: str) -> Floats:
        """One kind of energy over the run [J]."""
        return np.asarray(self.energies[:, self.facts["energy_kinds"].index(kind)])


def pinned(data: dict[str, Any], cloths: list[Any], x_start: Floats) -> NDArray[np.bool_]:
    """Vertices whose motion is prescribed, by index or by box."""
    out, first = np.zeros(len(x_start), dtype=bool), 0
    for table, body in zip(data["cloth"], cloths, strict=True):
        own = x_start[first : first + body.vertex_count]
        for pin in table.get("pins", []):
            if pin.get("vertices"):
                out[first + np.array(pin["vertices"])] = True
            elif pin.get("box"):
                low, high = np.array(pin["box"]["min"]), np.array(pin["box"]["max"])
                out[first + np.flatnonzero(((own >= low) & (own <= high)).all(axis=1))] = True
        first += body.vertex_count
    return out
