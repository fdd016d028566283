"""``cs.collision.detect`` and `self_intersections` against brute force, on meshes with every kind of degeneracy."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import _core
from clothsim.errors import ClothSimError, GpuUnavailable
from fuzz.target import Target, dump_json, load_json

__all__ = ["difference", "meshes", "target"]

_GPU = ("grid", "virtual-subdivision", "octree-single", "octree")

# Coordinates: few values, so that vertices coincide and triangles are coplanar; any value; sizes from tiny to huge.
_GRID = st.integers(-2, 2).map(float)
_ANY = st.floats(-1.0, 1.0, width=32)
_SCALES = [1.0, 1.0, 1.0, 1e-3, 1e3, 1e-9, 1e9, 1e-30, 1e30, 1e-160, 1e160, 1e-310, 1e305]
_OFFSETS = [0.0, 0.0, 0.0, 1.0, -1e3, 1e6, 1e12]


@st.composite
def meshes(draw: Any, most: int = 12) -> dict[str, Any]:
    """Positions at both ends of a step, and triangles."""
    count = draw(st.integers(3, most))
    number = draw(st.sampled_from([_GRID, _ANY, st.one_of(_GRID, _ANY)]))
    point = st.lists(number, min_size=3, max_size=3)
    x_t0 = draw(st.lists(point, min_size=count, max_size=count))
    motion = draw(st.sampled_from(["none", "free", "shared", "grid"]))
    match motion:
        case "none":
            x_t1 = x_t0
        case "free" | "grid":
            x_t1 = draw(st.lists(st.lists(_GRID if motion == "grid" else number, min_size=3, max_size=3),
                                 min_size=count, max_size=count))  # fmt: skip
        case _:
            step = draw(point)
            x_t1 = [[a + b for a, b in zip(row, step, strict=True)] for row in x_t0]
            moved = draw(st.integers(0, count - 1))
            x_t1[moved] = draw(point)
    corner = st.integers(0, count - 1)
    triangle = st.lists(corner, min_size=3, max_size=3, unique=True)
    return {
        "x_t0": x_t0, "x_t1": x_t1, "triangles": draw(st.lists(triangle, min_size=1, max_size=most)),
        "scale": draw(st.sampled_from(_SCALES)), "offset": draw(st.sampled_from(_OFFSETS)),
    }  # fmt: skip


@st.composite
def _cases(draw: Any) -> dict[str, Any]:
    case: dict[str, Any] = draw(meshes())
    # Relative to the scale: thickness zero, small, as large as the mesh.
    case["thickness"] = draw(st.sampled_from([0.0, 0.0, 1e-6, 0.01, 0.1, 1.0, 5.0]))
    case["mode"] = draw(st.sampled_from(["continuous", "continuous", "discrete"]))
    # The GPU here may be a software adapter: seldom.
    case["gpu"] = draw(st.sampled_from([None] * 150 + list(_GPU)))
    return case


def target() -> Target:
    """Detection."""
    return Target(
        "detection", "detect and self_intersections against brute force", _cases(), check, dump_json, load_json, plant,
        quick=250, seconds=60.0,
    )  # fmt: skip


def arrays(case: dict[str, Any]) -> tuple[Any, Any, Any, float]:
    """Positions at both ends [m], triangles, the scale."""
    scale = float(case["scale"])
    offset = case["offset"] * scale if case["offset"] * scale < 1e308 else 0.0
    with np.errstate(under="ignore", over="ignore"):
        ends = [np.array(case[key], dtype=np.float64) * scale + offset for key in ("x_t0", "x_t1")]
    return ends[0], ends[1], np.array(case["triangles"], dtype=np.int64), scale


def difference(a: Any, b: Any) -> str | None:
    """None if two detections are the same to the bit, else what differs."""
    for what in ("vertex_triangle", "edge_edge", "time_vertex_triangle", "time_edge_edge"):
        one, two = getattr(a, what), getattr(b, what)
        if not np.array_equal(one, two):
            return f"{what}: {one.tolist()} and {two.tolist()}"
    return None


@functools.cache
def _gpu() -> bool:
    x = np.eye(3)
    try:
        cs.collision.detect(x, x, [[0, 1, 2]], "grid", device="gpu")
    except GpuUnavailable:
        return False
    return True


def check(case: dict[str, Any]) -> None:
    """Every method finds what testing every pair finds, with any number of threads."""
    x_t0, x_t1, triangles, scale = arrays(case)
    thickness = case["thickness"] * scale
    ask = functools.partial(cs.collision.detect, x_t0, x_t1, triangles, mode=case["mode"], thickness=thickness)
    expected = ask("brute", threads=1)
    for threads in (1, 2):
        found = ask("bvh", threads=threads)
        assert (what := difference(expected, found)) is None, f"brute and bvh, {threads} threads: {what}"
    _sound(expected, triangles)
    if case["mode"] == "continuous" and thickness == 0.0:
        _not_later(case, expected, x_t0, x_t1, triangles)
    through = cs.collision.self_intersections(x_t0, triangles, threads=1)
    assert np.array_equal(through, cs.collision.self_intersections(x_t0, triangles, threads=2))
    assert np.array_equal(through, np.unique(through, axis=0)) and (through[:, 0] < through[:, 1]).all()
    if case["gpu"] and _gpu():
        try:
            found = ask(case["gpu"], device="gpu")
        except ClothSimError as error:
            raise AssertionError(f"{case['gpu']}: {error}") from error
        assert (what := difference(expected, found)) is None, f"brute and {case['gpu']}: {what}"


def _sound(found: Any, triangles: Any) -> None:
    pairs = found.vertex_triangle
    assert np.array_equal(pairs, np.unique(pairs, axis=0)), "pairs are unique and sorted"
    for vertex, triangle in pairs:
        assert vertex not in triangles[triangle], "a pair that shares a vertex"
    for a, b, c, d in found.edge_edge:
        assert len({a, b, c, d}) == 4, "edges that share a vertex"
    for time in (found.time_vertex_triangle, found.time_edge_edge):
        assert ((time >= 0.0) & (time <= 1.0)).all(), "a time outside the step"


def _not_later(case: dict[str, Any], found: Any, x_t0: Any, x_t1: Any, triangles: Any) -> None:
    """What touches exactly at the start is found at time 0: vertices at one place, which needs no engine to see."""
    del x_t1, case
    known = {
        (int(v), int(t)): time for (v, t), time in zip(found.vertex_triangle, found.time_vertex_triangle, strict=True)
    }
    for t, corners in enumerate(triangles):
        for v in range(len(x_t0)):
            used = v in triangles
            if used and v not in corners and any((x_t0[v] == x_t0[c]).all() for c in corners):
                assert known.get((v, t)) == 0.0, f"vertex {v} starts at a corner of triangle {t} and is not found at 0"


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A tree that misses the last of three or more pairs of edges."""
    honest = _core.detect

    def careless(*arguments: Any) -> Any:
        vertex_triangle, time, edge_edge, edge_time, stats, fallback = honest(*arguments)
        if arguments[3] == "bvh" and len(edge_edge) >= 3:
            edge_edge, edge_time = edge_edge[:-1], edge_time[:-1]
        return vertex_triangle, time, edge_edge, edge_time, stats, fallback

    with mock.patch.object(_core, "detect", careless):
        yield
