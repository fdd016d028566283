"""Detection over sequences: the contract of arguments and results, the contacts beside those of single calls."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs

NAMES = ("vertex_triangle", "edge_edge", "time_vertex_triangle", "time_edge_edge")


def layers(frames: int) -> tuple[list[Any], Any]:
    """Positions at the ends of coherent frames of two sheets that sink into each other, and their triangles."""
    sheet = cs.Mesh.grid(1.0, 1.0, 13, 13)
    count = len(sheet.vertices)
    triangles = np.concatenate([sheet.triangles, sheet.triangles + count])
    upper = np.repeat([0.0, 1.0], count)
    x = np.concatenate([sheet.vertices, sheet.vertices + [0.021, 0.0, 0.017]])
    normal = np.argmin(np.ptp(sheet.vertices, axis=0))
    path = []
    for k in range(frames + 1):
        y = x.copy()
        y[:, normal] += upper * (0.012 - 0.001 * k) + 0.01 * np.sin(9 * x[:, (normal + 1) % 3] + 0.05 * k)
        path.append(y)
    return path, triangles


def same(a: cs.collision.Detection, b: cs.collision.Detection) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in NAMES)


@pytest.mark.parametrize("variant", ["NoDup", "R-TRI", "nSwD", "SwD"])
@pytest.mark.parametrize("mode", ["continuous", "discrete"])
def test_every_frame_has_the_contacts_of_a_single_call(variant: str, mode: str) -> None:
    path, triangles = layers(14)
    session = cs.collision.SkippingSession(triangles, variant=variant, threads=1)
    kinds, contacts = [], 0
    for x_t0, x_t1 in pairwise(path):
        d = session.detect(x_t0, x_t1, thickness=0.004, mode=mode)
        assert same(d, cs.collision.detect(x_t0, x_t1, triangles, mode=mode, thickness=0.004))
        assert session.stats["colliding"] == len(d.vertex_triangle) + len(d.edge_edge)
        contacts += session.stats["colliding"]
        kinds.append(session.stats["frame"])
    assert contacts > 100
    assert ("skipping" in kinds) == (variant == "SwD")


def test_a_jump_inside_a_session_loses_nothing() -> None:
    path, triangles = layers(10)
    session = cs.collision.SkippingSession(triangles, frames=10, threads=2)
    for k, (x_t0, regular) in enumerate(pairwise(path)):
        x_t1 = regular[::-1].copy() if k == 7 else regular.copy()
        if k == 4:
            x_t1[7] += 0.4
        d = session.detect(x_t0, x_t1, 0.004)
        assert same(d, cs.collision.detect(x_t0, x_t1, triangles, thickness=0.004)), k
        if k == 4:
            assert session.stats["dangling_vertices"] >= 1


def test_runs_repeat_and_do_not_depend_on_the_threads() -> None:
    path, triangles = layers(20)

    def run(threads: int, first: int = 0) -> list[Any]:
        session = cs.collision.SkippingSession(triangles, threads=threads)
        out = []
        for x_t0, x_t1 in pairwise(path[first:]):
            d = session.detect(x_t0, x_t1, 0.004)
            counts = {name: value for name, value in session.stats.items() if name != "seconds"}
            out.append((d, counts))
        return out

    one, two, later = run(1), run(2), run(1, first=9)
    assert all(same(a, b) and p == q for (a, p), (b, q) in zip(one, two, strict=True))
    assert all(same(a[0], b[0]) for a, b in zip(one[9:], later, strict=True)), "resumed: the same contacts"


def test_bodies_meet_by_their_rules() -> None:
    path, triangles = layers(3)
    count = len(path[0]) // 2
    x_t0, x_t1 = path[1], path[1] - [0.0, 0.0, 0.0]
    everything = cs.collision.SkippingSession(triangles).detect(x_t0, x_t1, 0.03)
    bodies = [(count, True, False), (count, False, False)]
    apart = cs.collision.SkippingSession(triangles, bodies=bodies).detect(x_t0, x_t1, 0.03)
    assert 0 < len(apart.edge_edge) <= len(everything.edge_edge)
    assert ((apart.edge_edge[:, 0] < count) != (apart.edge_edge[:, 2] < count)).all()
    still = cs.collision.SkippingSession(triangles, bodies=[(count, False, True)] * 2).detect(x_t0, x_t1, 0.03)
    assert not ((still.edge_edge[:, 0] < count) != (still.edge_edge[:, 2] < count)).any()


def test_memory_of_a_pair() -> None:
    path, triangles = layers(6)
    session = cs.collision.SkippingSession(triangles, frames=6)
    for x_t0, x_t1 in pairwise(path):
        session.detect(x_t0, x_t1, 0.01)
        assert session.stats["pending"] > 1000
        assert session.stats["pair_bytes"] <= 48 * session.stats["pending"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "fast"}, 'variant: expected one of "NoDup", "R-TRI", "nSwD", "SwD", got "fast"'),
        ({"frames": 0}, "frames: expected a whole number from 1 to 1000, got 0"),
        ({"frames": 1001}, "frames: .*1000, got 1001"),
        ({"frames": 2.5}, "frames: .*2.5"),
        ({"first_frames": 9, "most_frames": 8}, "frames: expected a first number that is not above the largest"),
        ({"frames": 4, "alpha": float("nan")}, "alpha: expected a finite number ≥ 0, got NaN"),
        ({"alpha": 3.0}, "alpha: expected frames beside it"),
        ({"beta": -1.0}, "beta: expected a finite number ≥ 0, got -1"),
        ({"gamma": float("inf")}, "gamma: expected a finite number ≥ 0, got inf"),
        ({"adapt": "luck"}, 'adapt: expected one of "work", "time", got "luck"'),
        ({"bodies": [(3, True)]}, "bodies: expected .vertex count, dynamic, self-collision."),
        ({"threads": 0}, "threads: expected a whole number ≥ 1"),
        ({"rest": [[0.0, 0.0, 0.0]] * 3}, r"triangles: expected indices in 0\.\.3"),
    ],
)
def test_options_out_of_range(options: dict[str, Any], message: str) -> None:
    _, triangles = layers(1)
    with pytest.raises(cs.InvalidInput, match=message):
        cs.collision.SkippingSession(triangles, **options)


def test_bad_frames_are_refused_and_the_session_goes_on() -> None:
    path, triangles = layers(4)
    session = cs.collision.SkippingSession(triangles, frames=4)
    session.detect(path[0], path[1])
    bad = path[1].copy()
    bad[3, 1] = np.nan
    with pytest.raises(cs.InvalidInput, match="x_t1: expected finite coordinates"):
        session.detect(path[1], bad)
    with pytest.raises(cs.InvalidInput, match="x_t0: expected 338 entries, got 337"):
        session.detect(path[1][:-1], path[2][:-1])
    with pytest.raises(cs.InvalidInput, match="thickness: expected a finite length"):
        session.detect(path[1], path[2], -1.0)
    session.detect(path[1], path[2])
    assert session.stats["frame"] == "skipping"
    session.restart()
    session.detect(path[2], path[3])
    assert session.stats["frame"] == "first"


def test_a_simulation_with_sessions_takes_the_same_steps() -> None:
    def run(detector: str) -> Any:
        scene = cs.Scene(duration=0.1, contact={"thickness": 0.005, "detector": detector})
        scene.add_cloth(cs.Mesh.grid(0.6, 0.6, 15, 15), "cotton", position=(0.0, 0.26, 0.0))
        scene.add_collider("ball", shape={"type": "sphere", "radius": 0.25, "tolerance": 0.01})
        simulation = cs.Simulation(scene, device="cpu", threads=1)
        simulation.advance(0.1)
        return simulation.positions

    np.testing.assert_array_equal(run("session"), run("bvh"))


def test_a_simulation_resumed_inside_a_session_takes_the_same_steps(tmp_path: Path) -> None:
    scene = cs.Scene(duration=0.1, contact={"thickness": 0.005, "detector": "session"})
    scene.add_cloth(cs.Mesh.grid(0.6, 0.6, 15, 15), "cotton", position=(0.0, 0.26, 0.0))
    scene.add_collider("ball", shape={"type": "sphere", "radius": 0.25, "tolerance": 0.01})
    whole = cs.Simulation(scene, device="cpu", threads=1)
    whole.advance(0.05)
    whole.save_checkpoint(tmp_path / "half")
    resumed = cs.Simulation.resume(tmp_path / "half", device="cpu", threads=2)
    for simulation in (whole, resumed):
        simulation.advance(0.05)
    assert whole.time == resumed.time == pytest.approx(0.1)
    np.testing.assert_array_equal(whole.positions, resumed.positions)
