"""The result of detection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clothsim._arrays import Floats, Ints

__all__ = ["THICKNESS", "Detection"]

THICKNESS = "a finite length ≥ 0 m"


@dataclass(frozen=True, eq=False)
class Detection:
    """Every pair in contact, each once and sorted.

    Attributes
    ----------
    vertex_triangle : (k, 2) int64
        Vertex, triangle.
    time_vertex_triangle : (k,) float64
        When they first are in contact, as a fraction of the step in [0, 1], never later than the true time.
    edge_edge : (k, 4) int64
        The vertices of the one edge, then of the other.
    time_edge_edge : (k,) float64
        As above.
    stats : dict
        ``method`` and ``device`` that found them (``"cpu"``, or the GPU with its driver), counts
        (``broad_phase_tests``, ``candidates_vertex_triangle``, …) and ``seconds`` per stage. The methods of a GPU also
        count ``registrations`` of triangles in cells, the ``parts`` these come to (octrees: ``leaves``,
        ``coarsest_level``, ``finest_level``), and the ``bytes`` on the device.
    """

    vertex_triangle: Ints
    time_vertex_triangle: Floats
    edge_edge: Ints
    time_edge_edge: Floats
    stats: dict[str, Any]

    def __repr__(self) -> str:
        return f"Detection({len(self.vertex_triangle)} vertex-triangle, {len(self.edge_edge)} edge-edge)"
