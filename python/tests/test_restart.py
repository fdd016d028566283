"""A run that goes on from a frame of another: same state, edited scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE, RunCli

import clothsim as cs


def hanging(**keys: Any) -> cs.Scene:
    scene = cs.Scene(duration=0.4, **keys)
    material = {"areal_density": 0.2, "in_plane": {"model": "spring", "stiffness": 50.0}}
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 7, 7), material, name="sheet", pins=[{"vertices": [0, 6]}])
    return scene


def test_from_a_frame_with_velocities_the_run_has_the_same_bits() -> None:
    scene = hanging()
    frames = cs.record(cs.Simulation(scene), fps=20, progress=False)
    assert frames.has_velocities
    sim = cs.Simulation.from_frame(scene, frames, 3)
    assert sim.time == frames.times[3]
    np.testing.assert_array_equal(sim.positions, frames.positions("sheet", 3))
    for frame in range(4, len(frames)):
        sim.advance(0.05)
        np.testing.assert_array_equal(sim.positions, frames.positions("sheet", frame))
    later = cs.Simulation.from_frame(scene, frames, 4)
    later.advance(0.05)
    assert not np.array_equal(later.positions, frames.positions("sheet", 4)), "the comparison sees a difference"


def test_without_velocities_they_are_differences(caplog: pytest.LogCaptureFixture) -> None:
    scene = hanging()
    full = cs.record(cs.Simulation(scene), fps=100, progress=False)
    moving = np.stack([full.positions("sheet", f) for f in range(len(full))])
    bare = cs.Recording(full.bodies, full.times, moving, fps=100)
    sim = cs.Simulation.from_frame(scene, bare, 10)
    assert "has no velocities" in caplog.text
    exact = full.velocities("sheet", 10)
    assert exact is not None
    # Second order in the frames' distance: 0.01² / 6 of the third derivative; this sheet swings at 20 rad/s.
    assert 0.0 < np.abs(sim.velocities - exact).max() < 0.02 * np.abs(exact).max() + 0.05


def test_pins_and_colliders_are_where_the_scene_has_them_then() -> None:
    scene = hanging(contact={"thickness": 0.01})
    frames = cs.record(cs.Simulation(scene), fps=20, progress=False)
    edited = hanging(contact={"thickness": 0.01})
    edited.add_collider(
        "ball",
        shape={"type": "sphere", "radius": 0.1, "tolerance": 0.01},
        keyframes=[{"time": 0.0, "position": [0, -3, 0]}, {"time": 0.4, "position": [0, -2, 0]}],
    )
    sim = cs.Simulation.from_frame(edited, frames, 4)
    assert sim.collider_positions[:, 1].mean() == pytest.approx(-2.5, abs=1e-3)
    np.testing.assert_array_equal(sim.positions[[0, 6]], frames.positions("sheet", 0)[[0, 6]])
    inside = hanging(contact={"thickness": 0.01})
    middle = frames.positions("sheet", 4)[24]
    inside.add_collider("ball", shape={"type": "sphere", "radius": 0.1, "tolerance": 0.01}, position=middle.tolist())
    with pytest.raises(cs.IntersectingStart):
        cs.Simulation.from_frame(inside, frames, 4)


def test_frames_and_cloths_that_do_not_fit_are_named() -> None:
    scene = hanging()
    frames = cs.record(cs.Simulation(scene), 0.1, fps=20, progress=False)
    assert cs.Simulation.from_frame(scene, frames).time == pytest.approx(0.1)
    for frame in (3, -4, 10**9):
        with pytest.raises(cs.InvalidInput, match=f"frame: expected a frame of the recording, 0 to 2, got {frame}"):
            cs.Simulation.from_frame(scene, frames, frame)
    other = cs.Scene(duration=1.0)
    other.add_cloth(cs.Mesh.grid(1.0, 1.0, 7, 7), "cotton", name="towel")
    with pytest.raises(cs.InvalidInput, match="expected the scene's cloth 'towel', got 'sheet'"):
        cs.Simulation.from_frame(other, frames)
    finer = cs.Scene(duration=1.0)
    finer.add_cloth(cs.Mesh.grid(1.0, 1.0, 8, 8), "cotton", name="sheet")
    with pytest.raises(cs.InvalidInput, match="cloth 'sheet': expected the 49 vertices that it has.*got 64"):
        cs.Simulation.from_frame(finer, frames)
    broken = np.stack([frames.positions("sheet", f) for f in range(3)])
    broken[2, 5, 1] = np.nan
    with pytest.raises(cs.InvalidInput, match="positions: .*vertex 5"):
        cs.Simulation.from_frame(scene, cs.Recording(frames.bodies, frames.times, broken, fps=20))


def test_the_command_goes_on_with_an_edited_animation(tmp_path: Path, run_cli: RunCli, scene_file: Path) -> None:
    scene_file.write_text(SCENE + "velocities = true\n")
    first = run_cli("run", scene_file, "-o", tmp_path / "first", "--quiet")
    assert first.returncode == 0, first.stderr
    edited = tmp_path / "edited.toml"
    # The same up to frame 9 at 0.3 s, then faster.
    last = "    { time = 0.5, rotation = { axis = [0, 1, 0], angle = 1.0 } },\n"
    assert last in SCENE
    both = last.replace("0.5", "0.3").replace("1.0", "0.6") + last.replace("1.0", "4.0")
    edited.write_text(SCENE.replace(last, both) + "velocities = true\n")
    begin: list[str | Path] = ["--from", tmp_path / "first", "--frame", "9"]
    done = run_cli("run", edited, "-o", tmp_path / "second", *begin, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frame_count"] == 7
    one, two = (cs.Recording.load(tmp_path / name / "frames.npz") for name in ("first", "second"))
    np.testing.assert_allclose(two.times, one.times[9:], rtol=1e-12)
    np.testing.assert_array_equal(two.positions("cloth", 0), one.positions("cloth", 9))
    assert np.abs(two.positions("cloth", 6) - one.positions("cloth", 15)).max() > 1e-3, "the ball turns faster"
    # Where the edit puts the ball through the cloth, that is said.
    elsewhere = tmp_path / "elsewhere.toml"
    elsewhere.write_text(SCENE.replace("radius = 0.4", "radius = 0.5"))
    failed = run_cli("run", elsewhere, "-o", tmp_path / "third", *begin)
    assert failed.returncode == 2
    assert "pass through each other" in failed.stderr
    assert not (tmp_path / "third").exists()
    # Complete already; of another frame; a frame alone; a run that is not there.
    again = run_cli("run", edited, "-o", tmp_path / "second", *begin, "--resume", "--json")
    assert json.loads(again.stdout)["resumed"] == "complete already"
    begin[-1] = "8"
    cases: list[tuple[list[str | Path], str]] = [
        ([*begin, "--resume"], "of another scene"),
        (["--frame", "3", "--overwrite"], "expected --from RUN with it"),
        (["--from", tmp_path / "none", "--overwrite"], "expected the frames of a run, got nothing"),
        (["--from", tmp_path / "first", "--frame", "99", "--overwrite"], "0 to 15, got 99"),
    ]
    for arguments, message in cases:
        failed = run_cli("run", edited, "-o", tmp_path / "second", *arguments)
        assert failed.returncode in (1, 2)
        assert message in failed.stderr, failed.stderr
