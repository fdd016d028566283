"""``contact.detector = "auto"``: the cheapest detector by measured seconds, and the same bits whatever it is."""

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from conftest import RunCli

import clothsim as cs

# One triangle of cloth over a finely tessellated ball: detection is most of a step, whatever the machine does.
SCENE = """
duration = 0.3
[time]
dt = 0.001
[contact]
thickness = 0.002
detector = "auto"
[[cloth]]
name = "scrap"
mesh = { generator = "grid", width = 0.05, height = 0.05, nx = 3, ny = 3 }
material = "cotton"
position = [0.0, 0.105, 0.0]
[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.1, tolerance = 0.00002 }
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """The scene as a file."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def test_what_is_measured_is_reported_and_changes_no_bit(scene: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Report each choice with its reason and its seconds, log it, and keep the positions of a named detector."""
    sim = cs.Simulation(cs.Scene.load(scene), device="cpu")
    assert 'measured against "session"' in str(sim.plan)
    with caplog.at_level(logging.INFO, "clothsim.simulation"):
        sim.advance(0.1)
    choices = sim.report["choices"]
    assert choices
    for choice in choices:
        seconds = dict(choice["seconds_per_step"])
        assert set(seconds) == {"bvh", "session"} and min(seconds.values()) > 0
        assert choice["detector"] in seconds and choice["device"] == "cpu"
        assert choice["why"].startswith("measured: ")
        assert choice["time"] == pytest.approx(choice["step"] * 0.001)
    assert sim.report["detection"]["why"] == choices[-1]["why"]
    messages = [record.getMessage() for record in caplog.records]
    assert [m for m in messages if m.endswith(choices[-1]["why"])], messages
    for detector in ("bvh", "session"):
        named = scene.with_name(f"{detector}.toml")
        named.write_text(SCENE.replace('"auto"', f'"{detector}"'))
        other = cs.Simulation(cs.Scene.load(named), device="cpu")
        other.advance(0.1)
        assert other.report["choices"] == []
        np.testing.assert_array_equal(other.positions, sim.positions)


def test_a_run_writes_what_was_chosen(scene: Path, tmp_path: Path, run_cli: RunCli) -> None:
    """Keep the choices in ``report.json``."""
    done = run_cli("run", scene, "-o", tmp_path / "out", "--frames", "6", "--device", "cpu", "--quiet")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["choices"] and report["choices"][-1]["why"] == report["detection"]["why"]


def test_what_touches_is_counted(scene: Path) -> None:
    """Count the pairs whose side is remembered."""
    sim = cs.Simulation(cs.Scene.load(scene), device="cpu")
    sim.advance(0.05)
    contact = sim.report["steps"][-1]["contact"]
    assert 0 < contact["remembered"] <= contact["proximities"] and contact["by_side"] == 0
