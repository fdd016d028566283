"""The examples run."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from conftest import ROOT, RunCli, load_module

import clothsim as cs

EXAMPLES = ROOT / "examples"


def load(name: str) -> ModuleType:
    return load_module(EXAMPLES / f"{name}.py")


def test_napkin(tmp_path: Path) -> None:
    for module in ("pxr", "pyvista"):
        pytest.importorskip(module)
    frames = load("napkin").main(tmp_path / "out", seconds=0.1)
    assert len(frames) == 4
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["frames.npz", "napkin.png", "napkin.usdc"]


# A sweep is many scenes: its own tests run it.
SCENES = sorted(p for p in EXAMPLES.glob("*.toml") if p.stem != "sweep")


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_scene_files_can_be_planned_and_started(path: Path) -> None:
    sim = cs.Simulation(cs.Scene.load(path))
    assert sim.plan.running
    sim.step()


def test_friction_laws(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    load("friction_laws").main(tmp_path / "laws.png")
    assert (tmp_path / "laws.png").stat().st_size > 10_000


@pytest.mark.data
def test_detect(ccd_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert load("detect").main(ccd_data.parent, ("cloth-funnel",)) == 0
    assert "0 of 27 truly colliding" in capsys.readouterr().out


@pytest.mark.data
@pytest.mark.slow
def test_cloth_ball_makes_no_intersection_worse(ccd_data: Path) -> None:
    example = load("cloth_ball")
    scene = example.build(ccd_data.parent, 0.1)
    with pytest.raises(cs.IntersectingStart, match="allow_intersections"):
        cs.Simulation(cs.Scene(**{**scene.to_dict(), "contact": {"thickness": 0.001}, "cloth": [
            {"name": "cloth", "mesh": cs.Mesh(*scene.assets()[0]["cloth"]), "material": "cotton"}
        ], "collider": []}))  # fmt: skip
    sim = cs.Simulation(scene)
    assert sum(len(b.triangles) for b in sim.bodies) == 92_230
    before, x = len(sim.intersections()), sim.positions
    assert before > 10_000
    report = sim.step()
    assert report["intersections"] == len(sim.intersections()) <= before
    assert np.abs(sim.positions - x).max() > 1e-3, "nothing moved"


def test_parts_and_rigid_motion_of_the_example() -> None:
    example = load("cloth_ball")
    sheet, ball = cs.Mesh.grid(1.0, 1.0, 9, 9), cs.Mesh.sphere(0.5, 1)
    triangles = np.concatenate([ball.triangles, sheet.triangles + len(ball.vertices)])
    masks = example.parts(len(ball.vertices) + 81, triangles)
    assert [int(m.sum()) for m in masks] == [81, 42]
    angle, axis = 0.3, np.array([0.0, 0.6, 0.8])
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    moved = np.asarray(ball.vertices) @ turn.T + [0.1, 0.2, 0.3]
    found = example.rigid_motion(np.asarray(ball.vertices), moved)
    np.testing.assert_allclose(found[0], axis, atol=1e-12)
    assert found[1] == pytest.approx(angle)
    np.testing.assert_allclose(found[2], [0.1, 0.2, 0.3], atol=1e-12)


def test_the_demo_scene_runs_on_the_command_line(tmp_path: Path, run_cli: RunCli) -> None:
    done = run_cli("run", EXAMPLES / "drape.toml", "-o", tmp_path / "out", "--frames", "2", "--json")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "film_strip.png").stat().st_size > 10_000
