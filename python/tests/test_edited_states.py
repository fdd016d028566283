"""States that go on with an edited scene, and files that are no sound states."""

from __future__ import annotations

import contextlib
import logging
import shutil
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from state_runs import HYSTERESIS, falling

import clothsim as cs
from clothsim._files import whole
from clothsim._run.job import Job
from clothsim._run.sealed import read_sealed, write_sealed
from clothsim._run.start import Start
from clothsim._run.states import frame_count, read_state, states_of


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("states") / "out"
    Job(falling(), out, progress=False).run()
    return out


def test_an_edited_scene_goes_on_with_the_full_state(
    fallen: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "clothsim")
    # Only what comes later.
    turns = ((0.0, 0.0), (0.15, 0.6), (0.5, 9.0))
    later = falling(ball={"keyframes": [{"time": t, "rotation": {"axis": [0, 1, 0], "angle": a}} for t, a in turns]})
    sim = cs.Simulation.from_frame(later, fallen, 6)
    continued = sim.report["continued"]
    assert continued["edited"] == ["collider[0].keyframes"]
    assert continued["time"] == sim.time == pytest.approx(0.15)
    frames = cs.Recording.load(fallen / "frames.npz")
    np.testing.assert_array_equal(sim.positions, frames.positions("cloth", 6))
    sim.advance(0.05)
    assert np.abs(sim.positions - frames.positions("cloth", 8)).max() > 1e-4, "the ball turns faster"
    # Wind, a material, a longer run; hysteresis goes on where the law is the same.
    windy = falling(air={"wind": [3.0, 0.0, 0.0], "density": 1.2, "drag": 1.0}, duration=0.4)
    sim = cs.Simulation.from_frame(windy, fallen, 6)
    assert all(key.startswith("air") for key in sim.report["continued"]["edited"])
    state = cs.Simulation.from_frame(falling(), fallen, 6)
    np.testing.assert_array_equal(sim.hinges.moment, state.hinges.moment)
    other = falling(cloth={"material": {**HYSTERESIS, "plasticity": 0.2}})
    sim = cs.Simulation.from_frame(other, fallen, 6)
    assert any("what bending remembers" in text for text in sim.report["continued"]["anew"])
    assert np.abs(sim.hinges.moment - state.hinges.moment).max() > 1e-3 * np.abs(state.hinges.moment).max()
    report = Job(windy, tmp_path / "windy", progress=False, start=Start.of_run(fallen, windy, 6)).run()
    assert report["frame_count"] == 11
    assert report["continued"]["edited"] == ["air.drag", "air.wind"]


def test_what_may_not_change_is_named(fallen: Path) -> None:
    def refused(match: str, **cloth: Any) -> None:
        scene = falling(cloth=cloth)
        with pytest.raises(cs.InvalidScene, match=match):
            cs.Simulation.from_frame(scene, fallen, 6)

    refused(r'cloth\[0\].name: expected "cloth", cloth number 0 of the state, got "towel"', name="towel")
    grid = {"generator": "grid", "width": 0.6, "height": 0.6}
    refused(r"cloth\[0\].mesh: expected the 121 vertices .* got 144", mesh={**grid, "nx": 12, "ny": 12})
    refused(
        r"cloth\[0\].mesh: expected the triangles .* got other",
        mesh={**grid, "nx": 11, "ny": 11, "diagonals": "one-way"},
    )
    more = falling()
    more.add_cloth(cs.Mesh.grid(0.1, 0.1, 3, 3), "cotton", name="patch", position=(5.0, 0.0, 0.0))
    with pytest.raises(cs.InvalidScene, match=r'cloth: expected the cloths of the state: "cloth", got 2 cloths'):
        cs.Simulation.from_frame(more, fallen, 6)
    inside = falling(ball={"shape": {"type": "sphere", "radius": 0.25, "tolerance": 0.01}})
    with pytest.raises(cs.IntersectingStart):
        cs.Simulation.from_frame(inside, fallen, 6)


def test_damaged_and_foreign_states_are_refused(fallen: Path, tmp_path: Path) -> None:
    scene = falling()
    path = tmp_path / "a.state"
    content = states_of(fallen)[6].read_bytes()
    header, body = read_state(states_of(fallen)[6])
    _, packed = read_sealed(states_of(fallen)[6])
    assert len(packed) < 0.8 * len(body)
    unpacked = {key: value for key, value in header.items() if key != "unpacked"}
    cases = [
        (content[: len(content) // 2], "cut off"),
        (content[:20], "cut off|got other bytes"),
        (b"", "expected the state of a frame, got other bytes"),
        (content[:900] + bytes([content[900] ^ 4]) + content[901:], "damaged"),
        (b"99999999999999999 00000000\n" + content, "cut off"),
        (b"\x89PNG\r\n" * 100, "got other bytes"),
        (b"CLOTHSIM" + bytes(100), "version"),
    ]
    for broken, match in cases:
        path.write_bytes(broken)
        with pytest.raises(cs.CheckpointError, match=match):
            cs.Simulation.resume(path, scene=scene)
    for facts, engine, match in (
        (header, packed[:-1], "bytes when unpacked, got others"),
        ({**header, "unpacked": 2**40}, packed, "expected 1099511627776 bytes when unpacked, got others"),
        ({**header, "unpacked": -1}, packed, "when unpacked"),
        ({**header, "unpacked": "many"}, packed, "when unpacked"),
        ({**header, "unpacked": 2**24}, zlib.compress(bytes(2**26), 9), "when unpacked"),
        (unpacked, body[:8] + b"\x09\0\0\0" + body[12:], "expected version 3 of the state of a frame, got version 9"),
        ({"frames": 3}, body, "expected the state of a frame, got another file of a run"),
        (unpacked, cs.Simulation(scene)._core.checkpoint(0), "starts with"),
        (unpacked, body[:-8] + bytes(8), "checksum"),
    ):
        with whole(path) as file:
            write_sealed(file, facts, engine)
        with pytest.raises(cs.CheckpointError, match=match):
            cs.Simulation.resume(path, scene=scene)
    with pytest.raises(cs.CheckpointError, match="cannot read"):
        cs.Simulation.resume(tmp_path / "none.state", scene=scene)
    with pytest.raises(cs.CheckpointError, match="a checkpoint"):
        cs.Simulation.resume(states_of(fallen)[6])


def test_a_checkpoint_goes_on_with_an_edited_scene(tmp_path: Path) -> None:
    scene = falling()
    sim = cs.Simulation(scene)
    sim.advance(0.1)
    sim.save_checkpoint(tmp_path / "a.checkpoint")
    again = cs.Simulation.resume(tmp_path / "a.checkpoint", scene=scene)
    sim.advance(0.05)
    again.advance(0.05)
    np.testing.assert_array_equal(again.positions, sim.positions)
    assert again.report["continued"]["edited"] == []


def test_collider_that_moved_is_met_anew_and_others_are_not(fallen: Path) -> None:
    scene = falling(post=True)
    sim = cs.Simulation.from_frame(scene, fallen, 9)
    assert sim.report["continued"]["anew"][0] == 'contact with "post"'
    assert not any("ball" in text for text in sim.report["continued"]["anew"])
    # Far away, it changes nothing: sides, forces and memory went on, over other numbers of vertices.
    frames = cs.Recording.load(fallen / "frames.npz")
    sim.advance(1 / 40)
    np.testing.assert_allclose(sim.positions, frames.positions("cloth", 10), atol=1e-9)
    bare = cs.Simulation.from_frame(scene, fallen, 9, state=False)
    bare.advance(1 / 40)
    assert np.abs(bare.positions - frames.positions("cloth", 10)).max() > 1e-7


def walking(folder: Path, *, lift: float = 0.0, width: float = 0.6) -> cs.Scene:
    """Cloth from a file on an animated mesh from another, both in place of what was there under the same names."""
    box = cs.Mesh.box((0.2, 0.2, 0.2))
    rise = np.array([0.0, 0.0, 0.0, 0.0, 1.0])[:, None, None] * [0.0, lift, 0.0]
    np.savez(folder / "walk.npz", positions=box.vertices + rise, triangles=box.triangles)
    cs.Mesh.grid(width, 0.6, 7, 7).save(folder / "cloth.obj")
    path = folder / "scene.toml"
    path.write_text(
        "duration = 0.2\n[contact]\nthickness = 0.01\n[output]\nfps = 20\nstates = 1\nvelocities = true\n"
        "usd = false\nfilm_strip = false\nplots = false\n"
        '[[cloth]]\nname = "cloth"\nmaterial = "cotton"\nmesh = { file = "cloth.obj" }\nposition = [0.0, 0.3, 0.0]\n'
        '[[collider]]\nname = "body"\nsequence = { file = "walk.npz", fps = 20 }\n'
    )
    return cs.Scene.load(path)


def test_files_that_changed_under_their_names_are_listed(tmp_path: Path) -> None:
    scene = walking(tmp_path)
    Job(scene, tmp_path / "out", progress=False).run()
    sim = cs.Simulation(scene)
    sim.advance(0.1)
    sim.save_checkpoint(tmp_path / "a.checkpoint")

    def edited(scene: cs.Scene) -> list[str]:
        sims = [
            cs.Simulation.from_frame(scene, tmp_path / "out", 2),
            cs.Simulation.resume(tmp_path / "a.checkpoint", scene=scene),
        ]
        listed: list[list[str]] = [sim.report["continued"]["edited"] for sim in sims]
        assert listed[0] == listed[1]
        return listed[0]

    assert edited(walking(tmp_path)) == []
    assert edited(walking(tmp_path, lift=0.1)) == ["collider[0].sequence"]
    assert edited(walking(tmp_path, lift=0.1, width=0.61)) == ["cloth[0].mesh", "collider[0].sequence"]
    later = walking(tmp_path, lift=0.1)
    report = Job(later, tmp_path / "on", progress=False, start=Start.of_run(tmp_path / "out", later, 2)).run()
    assert report["continued"]["edited"] == ["collider[0].sequence"]


@pytest.mark.parametrize("state", [True, False])
def test_another_mesh_of_the_same_name_is_refused(tmp_path: Path, state: bool) -> None:
    Job(walking(tmp_path), tmp_path / "out", progress=False).run()
    kind, grid = cs.InvalidScene if state else cs.InvalidInput, cs.Mesh.grid(0.6, 0.6, 7, 7)
    for mesh, match in (
        (cs.Mesh.grid(0.6, 0.6, 7, 8), "49 vertices .* got 56"),
        (cs.Mesh(grid.vertices, grid.triangles[::-1]), "triangles .* got other"),
    ):
        scene = walking(tmp_path)
        mesh.save(tmp_path / "cloth.obj")
        scene = cs.Scene.load(tmp_path / "scene.toml")
        with pytest.raises(kind, match=f"cloth.*expected the {match}"):
            cs.Simulation.from_frame(scene, tmp_path / "out", 2, state=state)


def test_what_else_lies_beside_states(fallen: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(fallen, run)
    known = states_of(run)
    for name in ("²2.state", "-1.state", "٣٣٣٣٣٣.state", "a.state", "9" * 5000 + ".state"):
        with contextlib.suppress(OSError):  # too long for this file system
            (run / "states" / name).write_bytes(b"")
    assert states_of(run) == known
    assert frame_count(run) == len(cs.Recording.load(run / "frames.npz"))
    for content in ('{"frame_count": 1e999}', '{"frame_count": "3"}', "[]", "[" * 100000, "\xff"):
        (run / "report.json").write_text(content, encoding="latin-1")
        assert frame_count(run) is None
        with pytest.raises(cs.InvalidInput, match="frame: expected"):
            cs.Simulation.from_frame(falling(), run, -1)
