"""Skipping sessions against brute force, frame after frame of random motion."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import _core
from fuzz.target import Target, dump_json, load_json
from fuzz.targets.detection import arrays, difference, meshes

__all__ = ["target"]


@st.composite
def _cases(draw: Any) -> dict[str, Any]:
    case: dict[str, Any] = draw(meshes(10))
    case["sheet"] = draw(st.sampled_from([0, 0, 3, 6]))
    case["seed"] = draw(st.integers(0, 2**31))
    case["frames"] = draw(st.integers(1, 8))
    # How far vertices move in a frame, relative to the mesh: coherent motion, jumps, and all between.
    case["motions"] = draw(st.lists(st.sampled_from([0.0, 1e-6, 1e-3, 0.03, 0.3, 3.0]), min_size=8, max_size=8))
    case["thickness"] = draw(st.sampled_from([0.0, 1e-3, 0.05, 0.5]))
    case["modes"] = draw(st.lists(st.sampled_from(["continuous", "continuous", "discrete"]), min_size=8, max_size=8))
    case["options"] = {
        "variant": draw(st.sampled_from(["SwD", "SwD", "nSwD", "R-TRI", "NoDup"])),
        "frames": draw(st.sampled_from([None, 1, 2, 3, 8, 1000])),
        "beta": draw(st.sampled_from([0.0, 0.2, 10.0, 1e6])), "gamma": draw(st.sampled_from([0.0, 0.1, 10.0, 1e6])),
        "low_curvature": draw(st.booleans()),
    }  # fmt: skip
    first, most = draw(st.sampled_from([(8, 64), (1, 1), (1, 8), (2, 1000), (64, 64)]))
    case["options"] |= {"first_frames": first, "most_frames": most}
    case["restart"] = draw(st.sampled_from([None, None, 2]))
    return case


def target() -> Target:
    """Sessions."""
    return Target(
        "sessions", "skipping sessions against brute force", _cases(), check, dump_json, load_json, plant, quick=150
    )


def check(case: dict[str, Any]) -> None:
    """Every frame has the contacts of brute force, to the bit."""
    x, _, triangles, scale = arrays(case)
    rng = np.random.default_rng(case["seed"])
    if case["sheet"]:
        n = case["sheet"]
        sheet = cs.Mesh.grid(2.0, 2.0, n, n)
        x = np.concatenate([sheet.vertices, sheet.vertices + [0.1, 0.05, 0.02]]) * scale
        triangles = np.concatenate([sheet.triangles, sheet.triangles + n * n])
    session = cs.collision.SkippingSession(triangles, threads=1, **case["options"])
    thickness = case["thickness"] * scale
    for frame in range(case["frames"]):
        with np.errstate(over="ignore", under="ignore"):
            speed = case["motions"][frame] * scale
            drift = rng.uniform(-speed, speed, 3) if speed < 1e300 else np.zeros(3)
            own = rng.uniform(-1.0, 1.0, x.shape) * (speed * rng.choice([0.0, 0.1, 1.0]))
            after = x + drift + own
        if not np.isfinite(after).all():
            return
        if frame == case["restart"]:
            session.restart()
        mode = case["modes"][frame]
        expected = cs.collision.detect(x, after, triangles, "brute", mode, thickness, threads=1)
        found = session.detect(x, after, thickness, mode)
        assert (what := difference(expected, found)) is None, f"frame {frame}, {session.stats.get('frame')}: {what}"
        x = after


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A session that forgets a pair of edges in skipping frames."""
    honest = _core.SkippingSession

    class Careless:
        def __init__(self, *arguments: Any) -> None:
            self._session = honest(*arguments)

        def detect(self, *arguments: Any) -> Any:
            (vertex_triangle, time, edge_edge, edge_time), stats = self._session.detect(*arguments)
            if stats["frame"] == "skipping":
                edge_edge, edge_time = edge_edge[1:], edge_time[1:]
            return (vertex_triangle, time, edge_edge, edge_time), stats

        def restart(self) -> None:
            self._session.restart()

    with mock.patch.object(_core, "SkippingSession", Careless):
        yield
