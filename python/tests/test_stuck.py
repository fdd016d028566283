"""Cloth between plates that close: what is said, and what is kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import RunCli

import clothsim as cs

# Two plates meet after 0.2 s with a cloth between them; neither gives way.
PLATES = """
name = "plates"
duration = 0.5
gravity = [0, 0, 0]
[time]
dt = 0.005
max_halvings = 2
[contact]
thickness = 0.004
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 0.2, height = 0.2, nx = 7, ny = 7 }
material = "cotton"
[[collider]]
name = "lower"
shape = { type = "plane", half_size = 0.3 }
keyframes = [{ time = 0.0, position = [0.011, -0.02, 0.007] }, { time = 0.4, position = [0.011, 0.02, 0.007] }]
[[collider]]
name = "upper"
shape = { type = "plane", half_size = 0.3 }
keyframes = [{ time = 0.0, position = [0.0, 0.02, 0.0] }, { time = 0.4, position = [0.0, -0.02, 0.0] }]
[output]
fps = 50
usd = false
film_strip = false
plots = false
"""


def test_stuck_names_time_pairs_and_vertices(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(PLATES)
    sim = cs.Simulation(cs.Scene.load(tmp_path / "scene.toml"), threads=1)
    with pytest.raises(cs.SimulationStuck, match=r"stuck at t = .* pairs still collide .* vertices") as caught:
        sim.advance(0.5)
    error = caught.value
    assert error.time == sim.time
    assert 0.1 < error.time < 0.2, "the plates meet at 0.2 s"
    assert error.count == len(error.pairs) > 0
    total = sum(body.vertex_count for body in sim.bodies)
    named = {vertex for pair in error.pairs for vertex in pair}
    assert set(error.vertices) == named
    assert named <= set(range(total))
    assert any(vertex < len(sim.positions) for vertex in named), "a vertex of the cloth is among them"
    for pair in error.pairs:
        assert len(set(pair)) == 4
        assert str(list(error.pairs[0])) in str(error)
    assert len(sim.intersections()) == 0, "the state is the last good one"
    with pytest.raises(cs.SimulationStuck):
        sim.step()


def test_a_stuck_run_keeps_its_last_good_state(tmp_path: Path, run_cli: RunCli) -> None:
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(PLATES)
    done = run_cli("run", scene, "-o", out, "--quiet")
    assert done.returncode == 1
    assert "stuck at t = " in done.stderr
    assert "Traceback" not in done.stderr
    report = json.loads((out / "report.json").read_text())
    assert report["error"].startswith("SimulationStuck: stuck at t = ")
    assert "last_good.checkpoint" in report["outputs"]
    last = cs.Simulation.resume(out / "last_good.checkpoint")
    assert last.time == report["simulated_seconds"]
    assert f"t = {last.time} s" in report["error"]
    assert len(last.intersections()) == 0
    recorded = np.load(out / "frames.npz")
    assert recorded["times"][-1] <= last.time < recorded["times"][-1] + 1 / 50
    lower, upper = (part[:, 1] for part in np.split(last.collider_positions, 2))
    assert lower.max() < last.positions[:, 1].min() <= last.positions[:, 1].max() < upper.min(), "still between them"
    errors = json.loads(run_cli("run", scene, "-o", tmp_path / "again", "--quiet", "--json").stdout)["error"]
    assert (errors["type"], errors["time"]) == ("SimulationStuck", last.time)
    assert errors["pairs"]
