"""Simulations: contract of the public names, bits, threads, interrupts, checkpoints."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from conftest import SCENE

import clothsim as cs


def drop(n: int = 17, **keys: Any) -> cs.Scene:
    """A sheet of n × n vertices over a ball that turns."""
    scene = cs.Scene(duration=0.5, contact={"thickness": 0.006}, **keys)
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, n, n), "cotton", position=(0.02, 0.42, 0.01))
    turn = [{"time": 0.0, "rotation": {"angle": 0.0}}, {"time": 0.5, "rotation": {"angle": 1.0}}]
    scene.add_collider("ball", shape={"type": "sphere", "radius": 0.4, "tolerance": 0.02}, keyframes=turn)
    return scene


def test_the_public_names() -> None:
    sim = cs.Simulation(drop(), threads=1, device="cpu")
    assert sim.time == 0.0
    report = sim.step()
    assert report["step"] == 1
    assert report["converged"] is True
    assert sim.time == pytest.approx(0.005)
    sim.advance(0.02)
    assert sim.time == pytest.approx(0.025)
    assert sim.positions.shape == sim.velocities.shape == (289, 3)
    assert sim.masses.sum() == pytest.approx(cs.materials["cotton"].areal_density)
    assert "contact" in sim.plan.running
    assert "wind" not in sim.plan.running
    assert "cloth vertices" in str(sim.plan)
    assert sim.report["totals"]["steps"] == len(sim.report["steps"]) == 5
    assert sim.energy["total"] == pytest.approx(sum(v for k, v in sim.energy.items() if k != "total"))
    assert [(b.name, b.kind, b.static) for b in sim.bodies] == [("cloth", "cloth", False), ("ball", "collider", False)]
    assert sim.collider_positions.shape == (sim.bodies[1].vertex_count, 3)


def test_every_force_model_has_its_milliseconds() -> None:
    sim = cs.Simulation(drop(9), threads=1)
    before = {effect["name"]: effect["milliseconds"] for effect in sim.report["effects"]}
    assert set(before.values()) == {None}
    sim.advance(0.05)
    report = sim.report
    cost = {effect["name"]: effect["milliseconds"] for effect in report["effects"]}
    for name in ("baraff-witkin", "hinge", "gravity", "integrator", "linear solver", "contact"):
        assert cost[name] > 0.0, name
    assert "spring" not in cost
    assert "wind" not in cost
    stages = sum(seconds for _, seconds in report["totals"]["seconds"])
    timed = [milliseconds for milliseconds in cost.values() if milliseconds is not None]
    assert sum(timed) == pytest.approx(1e3 * stages), "the rows do not overlap and leave no stage out"
    forces = [sum(seconds for _, seconds in step["forces"]) for step in report["steps"]]
    assert 1e3 * sum(forces) == pytest.approx(cost["baraff-witkin"] + cost["hinge"] + cost["gravity"])


def test_positions_are_copies() -> None:
    sim = cs.Simulation(drop(5), threads=1)
    before = sim.positions
    before[:] = 7.0
    assert not (sim.positions == 7.0).any()
    now = sim.positions
    sim.step()
    assert not np.array_equal(now, sim.positions)


def test_run_yields_frames_at_the_right_times() -> None:
    frames = list(cs.Simulation(drop(5), threads=1).run(0.11, fps=20, progress=False))
    assert [f.index for f in frames] == [0, 1, 2, 3]
    np.testing.assert_allclose([f.time for f in frames], [0.0, 0.05, 0.1, 0.11])
    assert [len(list(cs.Simulation(drop(5)).run(s, 60, False))) for s in (0.0, 1 / 60, 0.1)] == [1, 2, 7]


def test_free_fall_is_that_of_the_scheme() -> None:
    scene = cs.Scene(duration=0.1)
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 4, 4), "cotton")
    sim = cs.Simulation(scene)
    sim.advance(0.1)
    n, dt = 20, 0.005
    tolerance = 1e-4  # that of the linear solver
    np.testing.assert_allclose(sim.positions[:, 1], -9.81 * dt * dt * n * (n + 1) / 2, rtol=tolerance)
    np.testing.assert_allclose(sim.velocities[:, 1], -9.81 * 0.1, rtol=tolerance)


def test_no_frame_intersects_and_the_ball_is_not_entered() -> None:
    sim = cs.Simulation(drop(21))
    triangles = sim.bodies[0].triangles
    for frame in sim.run(progress=False, fps=30):
        assert len(cs.collision.self_intersections(frame.positions, triangles)) == 0, frame.time
        assert len(sim.intersections()) == 0, frame.time


def test_any_number_of_threads_gives_the_same_bits() -> None:
    sims = [cs.Simulation(drop(21), threads=n) for n in (1, 2, 3)]
    for sim in sims:
        sim.advance(0.3)
    for sim in sims[1:]:
        np.testing.assert_array_equal(sims[0].positions, sim.positions)
        np.testing.assert_array_equal(sims[0].velocities, sim.velocities)
    assert sims[1].report["threads"] == 2


def test_a_checkpoint_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    whole = cs.Simulation(drop(), threads=1)
    whole.advance(0.2)
    whole.save_checkpoint(tmp_path / "half")
    whole.advance(0.2)
    resumed = cs.Simulation.resume(tmp_path / "half", threads=2)
    assert resumed.time == pytest.approx(0.2)
    assert len(resumed.report["steps"]) == 40
    resumed.advance(0.2)
    np.testing.assert_array_equal(whole.positions, resumed.positions)
    np.testing.assert_array_equal(whole.velocities, resumed.velocities)
    assert [p.name for p in tmp_path.iterdir()] == ["half"]


def test_a_checkpoint_without_steps_does_not_grow(tmp_path: Path) -> None:
    sim = cs.Simulation(drop(5), threads=1)
    sizes, full = [], []
    for count in (10, 40):
        for _ in range(count):
            sim.step()
        sim.save_checkpoint(tmp_path / "short", steps=False)
        sim.save_checkpoint(tmp_path / "full")
        sizes.append((tmp_path / "short").stat().st_size)
        full.append((tmp_path / "full").stat().st_size)
    assert full[1] > full[0] + 40 * 200, "each step has a table"
    assert abs(sizes[1] - sizes[0]) < 400, "but for the digits of the totals"
    resumed = cs.Simulation.resume(tmp_path / "short")
    assert resumed.report["left_out"] == 50
    assert resumed.report["steps"] == []
    assert resumed.report["totals"] == sim.report["totals"]
    assert resumed.report["effects"] == sim.report["effects"]
    report = resumed.step()
    assert report["step"] == 51
    assert [step["step"] for step in resumed.report["steps"]] == [51]
    sim.step()
    np.testing.assert_array_equal(sim.positions, resumed.positions)
    assert resumed.report["totals"]["linear_iterations"] == sim.report["totals"]["linear_iterations"]
    resumed.save_checkpoint(tmp_path / "again")
    assert cs.Simulation.resume(tmp_path / "again").report["left_out"] == 50


@pytest.mark.parametrize(
    "damage",
    [lambda b: b[:-1], lambda b: b[:100], lambda b: b"", lambda b: b"PK" + b[2:], lambda b: b[:500] + b"!" + b[501:]],
    ids=["cut", "short", "empty", "magic", "flipped"],
)
def test_damaged_checkpoints_are_refused(tmp_path: Path, damage: Any) -> None:
    path = tmp_path / "checkpoint"
    cs.Simulation(drop(5)).save_checkpoint(path)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(cs.CheckpointError, match="checkpoint: expected"):
        cs.Simulation.resume(path)
    with pytest.raises(cs.CheckpointError, match="none: cannot read"):
        cs.Simulation.resume(tmp_path / "none")


def test_other_threads_run_during_a_step() -> None:
    sim = cs.Simulation(drop(61), threads=1)
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    spans = []
    for _ in range(5):
        start = time.perf_counter()
        sim.step()
        spans.append((start, time.perf_counter()))
    done.set()
    other.join()
    longest = max(spans, key=lambda s: s[1] - s[0])
    during = sum(longest[0] < t < longest[1] for t in ticks)
    # With the interpreter held there would be none: the tick after the step comes after its end.
    assert during >= 2, f"{during} ticks in a step of {longest[1] - longest[0]:.3f} s"


def test_two_threads_may_share_a_simulation() -> None:
    sim, alone = cs.Simulation(drop(9), threads=1), cs.Simulation(drop(9), threads=1)
    workers = [threading.Thread(target=lambda: [sim.step() for _ in range(10)]) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for _ in range(20):
        alone.step()
    np.testing.assert_array_equal(sim.positions, alone.positions)


INTERRUPTED = """
import signal, sys, numpy as np, clothsim as cs
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
scene = cs.Scene.load(sys.argv[1])
sim = cs.Simulation(scene, threads=1)
print("ready", flush=True)
try:
    sim.advance(60.0)
except KeyboardInterrupt:
    assert 0.0 < sim.time < 60.0
    assert np.isfinite(sim.positions).all()
    sim.save_checkpoint(sys.argv[2])
    print("stopped", sim.time, flush=True)
"""


def test_ctrl_c_stops_between_two_steps(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(INTERRUPTED), tmp_path / "scene.toml", tmp_path / "checkpoint"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert out.startswith("stopped")
    resumed = cs.Simulation.resume(tmp_path / "checkpoint")
    assert resumed.time == float(out.split()[1])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda sim: sim.advance(-1.0), r"seconds: expected a finite number ≥ 0 \[s\], got -1"),
        (lambda sim: sim.advance(float("nan")), "seconds: "),
        (lambda sim: next(sim.run(1.0, fps=0.0)), "fps: expected a finite number > 0"),
        (lambda sim: next(sim.run(-1.0)), "seconds: "),
        (lambda sim: cs.Simulation(drop(5), threads=0), "threads: expected a whole number ≥ 1"),
        (lambda sim: cs.Simulation(drop(5), threads=cast(int, 1.5)), "threads: "),
        (lambda sim: cs.Simulation(drop(5), device="tpu"), 'device: expected one of "auto", "cpu", "gpu"'),
    ],
)
def test_bad_arguments(call: Any, message: str) -> None:
    with pytest.raises(cs.InvalidInput, match=message):
        call(cs.Simulation(drop(5)))
    no_scenes: list[Any] = [None, {}, "scene.toml"]
    for wrong in no_scenes:
        with pytest.raises(TypeError, match=r"scene: expected a clothsim\.Scene, got (NoneType|dict|str)"):
            cs.Simulation(wrong)


def test_what_diverges_stops_with_the_last_good_state() -> None:
    stiff = {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 1e9}}
    scene = cs.Scene(duration=1.0, time={"dt": 0.05, "integrator": "explicit-euler", "max_halvings": 1})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 7, 7), stiff, pins=[{"vertices": [0]}])
    sim = cs.Simulation(scene)
    assert sim.plan["warnings"], "a step beyond the stable one is worth a warning"
    with pytest.raises(cs.SimulationDiverged, match=r"diverged at t = .* vertices") as caught:
        sim.advance(1.0)
    assert caught.value.time == sim.time
    assert len(caught.value.vertices) > 0
    assert np.isfinite(sim.positions).all()


def test_a_solver_that_breaks_down_names_vertices() -> None:
    """Exact Hessians of a sheet pressed together are indefinite at any step that is tried."""
    stiff = {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 1e9}}
    scene = cs.Scene(duration=1.0, time={"dt": 0.05, "indefinite": "raw", "max_halvings": 1})
    mesh = cs.Mesh.grid(1.0, 1.0, 7, 7)
    squeezed = mesh.vertices * [0.1, 1.0, 0.1]
    scene.add_cloth(cs.Mesh(squeezed, mesh.triangles, mesh.uv), stiff, rest="uv")
    sim = cs.Simulation(scene)
    with pytest.raises(cs.SimulationDiverged, match=r"linear solver: .*; vertices \d") as caught:
        sim.step()
    assert 0 < len(caught.value.vertices) <= 49
    assert all(0 <= vertex < 49 for vertex in caught.value.vertices)


def test_a_disk_that_is_full_leaves_the_old_checkpoint(tmp_path: Path) -> None:
    code = """
    import resource, signal, sys, clothsim as cs
    sim = cs.Simulation(cs.Scene.load(sys.argv[1]), threads=1)
    sim.save_checkpoint(sys.argv[2])
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
    sim.step()
    try:
        sim.save_checkpoint(sys.argv[2])
    except cs.OutputError as error:
        print(error)
    """
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "out").mkdir()
    out = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), tmp_path / "scene.toml", tmp_path / "out" / "checkpoint"],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONWARNINGS": "error"},
    )  # fmt: skip
    assert "no space left" in out.stdout
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["checkpoint"]
    assert cs.Simulation.resume(tmp_path / "out" / "checkpoint").time == 0.0
