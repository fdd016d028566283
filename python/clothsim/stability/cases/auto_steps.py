"""Steps that the engine chooses by their error, in the hardest scenes of the other cases."""

from __future__ import annotations

from typing import Any

from clothsim.stability.case import Axis, Case, Setup
from clothsim.stability.cases import extremes, impacts, masses, meshes, piles, squeezed, stiffness, tangles
from clothsim.study.axes import variant

__all__ = ["CASES"]

# A scene in words: the case that builds it, and that case's other parameter.
_SCENES: dict[str, tuple[str, Any]] = {
    "stiff springs": ("stretch", 1e7),
    "stiff bending": ("bending", 1.0),
    "silk under 1 kg": ("silk-under-weight", 1e3),
    "a tonne": ("mass-ratio", 1e6),
    "slivers": ("slivers", 1e2),
    "100 m/s": ("fast-sphere", 100.0),
    "a jump": ("jump", 0.3),
    "plates": ("plates", 0.5),
    "a fold": ("fold", 0.1),
    "three turns": ("twist", 3.0),
    "spikes": ("spikes", 30.0),
    "10⁶ m away": ("far", 1e6),
}
_GROUPS = (stiffness, masses, meshes, impacts, squeezed, tangles, piles, extremes)
_BUILDS = {case.name: case.build for group in _GROUPS for case in group.CASES}


def _chosen(tolerance: float, name: str) -> Setup:
    """A scene with ``time.dt = "auto"``; its duration is that of the case at 5 ms."""
    case, value = _SCENES[name]
    setup = _BUILDS[case](5e-3, value)
    data = setup.scene.to_dict()
    data["time"].update(dt="auto", dt_tolerance=tolerance)
    return Setup(variant(setup.scene, data), setup.sides)


CASES = (
    Case(
        "auto-step",
        "Steps chosen by their error",
        'The hardest scenes of other cases with dt = "auto": a step that goes wrong has to show as an error, be made '
        "again smaller, and end the run if none is small enough. At a tolerance of a third of the sheet's side the "
        "error hardly limits a step, and stiff cloth may swing higher than it fell.",
        Axis("tolerance", (1e-4, 1e-3, 1e-2, 1e-1), (1e-2,), "m", "tolerance of the time step"),
        Axis("scene", tuple(_SCENES), ("stiff springs", "100 m/s", "plates"), "", "scene"),
        _chosen,
    ),
)
