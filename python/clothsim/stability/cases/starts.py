"""Starts that are close to wrong, and wrong."""

from __future__ import annotations

from typing import Any

from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, dt_axis
from clothsim.stability.cases.common import THICKNESS, grid

__all__ = ["CASES"]

_N = 6
_UPRIGHT = {"axis": [1, 0, 0], "angle": 1.5707963267948966}
_STARTS = ("refuse", "allow", "untangle")
_KINDS = ("parallel", "shifted", "beside", "edge on face", "corner on face", "on a floor")


def _pair(dt: float, second: dict[str, Any], start: str = "", **contact: Any) -> Scene:
    """A sheet in y = 0, held at its corners, and a second one."""
    keys: dict[str, Any] = {"start": start} if start else {}
    return Scene(
        duration=max(0.1, 4.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS, **contact}, **keys,
        cloth=[
            {"name": "first", "mesh": grid(0.2, _N), "material": "cotton",
             "pins": [{"vertices": [0, _N - 1, _N * (_N - 1), _N * _N - 1]}]},
            {"name": "second", "mesh": grid(0.2, _N), "material": "cotton", **second},
        ],
    )  # fmt: skip


def _touching(gap: float, kind: str) -> Setup:
    """A second body so near to the first, in thicknesses."""
    away = gap * THICKNESS
    if kind == "on a floor":
        scene = Scene(
            duration=0.1, contact={"thickness": THICKNESS},
            cloth=[{"name": "sheet", "mesh": grid(0.2, _N), "material": "cotton", "position": [0.0, away, 0.0]}],
            collider=[{"name": "floor", "shape": {"type": "plane", "half_size": 0.3}}],
        )  # fmt: skip
        return Setup(scene)
    half, diagonal = 0.1, 0.1 * 2.0**0.5
    kinds: dict[str, dict[str, Any]] = {
        "parallel": {"position": [0.0, away, 0.0]},
        "shifted": {"position": [0.013, away, 0.007]},
        "beside": {"position": [0.2 + away, 0.0, 0.0]},
        "edge on face": {"position": [0.013, half + away, 0.007], "rotation": _UPRIGHT},
        "corner on face": {"position": [0.013, diagonal + away, 0.007]},
    }
    second = kinds[kind]
    if kind == "corner on face":
        second["rotation"] = {"axis": [0, 0, 1], "angle": -1.5707963267948966}  # upright, its first vertex down
        second["mesh"] = {"generator": "disc", "radius": diagonal, "rings": 3}
    return Setup(_pair(5e-3, second))


def _intersecting(depth: float, start: str) -> Setup:
    """An upright sheet reaches so far below the first one."""
    second = {"position": [0.013, 0.1 - depth, 0.007], "rotation": _UPRIGHT}
    if start == "untangle":
        return Setup(_pair(5e-3, second, start))
    return Setup(_pair(5e-3, second, allow_intersections=start == "allow"))


def _dt_of_touching(dt: float, kind: str) -> Setup:
    setup = _touching(1e-3, kind)
    data = setup.scene.to_dict()
    data["time"]["dt"] = dt
    data["duration"] = max(0.1, 4.0 * dt)
    return Setup(Scene(**data))


CASES = (
    Case(
        "touching",
        "Parallel, coplanar and touching starts",
        "Two sheets, or a sheet and a floor, start so close to each other: face to face, edge to edge in one plane, an "
        "edge or a corner on a face. At 0 they touch exactly and have to be parted or refused.",
        Axis("gap", (0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0), (0.0, 1e-3), "", "gap over the thickness"),
        Axis("kind", _KINDS, ("parallel", "edge on face", "on a floor"), "", "how"),
        _touching,
    ),
    Case(
        "near",
        "Nearly touching starts at large steps",
        "The same starts, a thousandth of the thickness apart, over the time step.",
        dt_axis(),
        Axis("kind", _KINDS, ("shifted",), "", "how"),
        _dt_of_touching,
    ),
    Case(
        "intersecting",
        "Starts that intersect",
        "An upright sheet reaches through a level one. The default has to refuse it with the number of pairs; with "
        "intersections allowed none may be added; untangled it has to start without, or be refused with the number.",
        Axis("depth", (1e-9, 1e-6, 1e-3, 0.01, 0.05), (1e-6, 0.05), "m", "depth"),
        Axis("start", _STARTS, _STARTS, "", "what is done about it"),
        _intersecting,
    ),
)
