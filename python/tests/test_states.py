"""Runs that keep full states: on from any of them, to the same bits, or with an edited scene."""

from __future__ import annotations

import json
import logging
import re
import shutil
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE, RunCli

import clothsim as cs
from clothsim._files import whole
from clothsim._run.job import Job, Stopped
from clothsim._run.sealed import read_sealed, write_sealed
from clothsim._run.start import Start
from clothsim._run.states import read_state, states_of

HYSTERESIS = {"fabric": "cotton", "bending": "hysteresis", "plasticity": 0.1, "fatigue": 0.02}
OUTPUT = {
    "fps": 40, "states": 3, "obj": True, "velocities": True, "usd": False, "film_strip": False, "plots": False,
    "checkpoint_interval": 0.05,
}  # fmt: skip
BALL: dict[str, Any] = {
    "name": "ball",
    "shape": {"type": "sphere", "radius": 0.2, "tolerance": 0.01},
    "keyframes": [
        {"time": 0.0, "rotation": {"axis": [0, 1, 0], "angle": 0.0}},
        {"time": 0.5, "rotation": {"axis": [0, 1, 0], "angle": 2.0}},
    ],
}


def falling(
    *, cloth: dict[str, Any] | None = None, ball: dict[str, Any] | None = None, post: bool = False, **keys: Any
) -> cs.Scene:
    """Cloth that falls on a ball that turns: 10 frames and a last one that is shorter."""
    keys = {"duration": 0.26, "time": {"dt": 0.005}, "contact": {"thickness": 0.006, "friction": 0.3}, **keys}
    scene = cs.Scene(name="falling", output={**OUTPUT, **keys.pop("output", {})}, **keys)
    mesh = {"generator": "grid", "width": 0.6, "height": 0.6, "nx": 11, "ny": 11}
    table = {"mesh": mesh, "material": HYSTERESIS, "name": "cloth", "position": (0.02, 0.215, 0.01), **(cloth or {})}
    scene.add_cloth(**table)
    if post:  # far from the cloth, and first
        shape = {"type": "sphere", "radius": 0.02, "tolerance": 0.005}
        scene.add_collider("post", shape=shape, position=(0.0, 2.0, 0.0))
    scene.add_collider(**{**BALL, **(ball or {})})
    return scene


def sewn() -> cs.Scene:
    """Two panels over an animated body: seams that close, a pin that it carries, a material by region."""
    n, panel, body = 7, cs.Mesh.grid(0.5, 0.3, 7, 7), cs.Mesh.sphere(0.15, 2)
    vertices = np.concatenate([panel.vertices + [0, 0.17, -0.17], panel.vertices + [0, 0.17, 0.17]])
    triangles = np.concatenate([panel.triangles, panel.triangles + n * n])
    pairs = [[n * (n - 1) + i, n * n + i] for i in range(n)]
    if np.abs(vertices[pairs[0][0]] - vertices[pairs[0][1]])[2] > 0.1:  # rows run along x, or along z
        pairs = [[i * n + n - 1, n * n + i * n] for i in range(n)]
    scene = cs.Scene(
        name="sewn", duration=0.26, output=OUTPUT, time={"dt": 0.005}, contact={"thickness": 0.006, "friction": 0.3}
    )
    lift = np.linspace(0.0, 0.05, 7)[:, None, None] * np.array([0.0, 1.0, 0.0])
    scene.add_collider("body", sequence=cs.Animation(body.vertices[None] + lift, body.triangles, 20.0))
    scene.add_cloth(
        cs.Mesh(vertices, triangles), "cotton", name="poncho", pins=[{"vertices": [0], "collider": "body"}],
        seams=[{"pairs": pairs, "duration": 0.15}], regions=[{"triangles": [0, 1, 2], "material": "denim"}],
    )  # fmt: skip
    return scene


def resting() -> cs.Scene:
    """A sheet that soon sleeps on a floor, and one that falls on it."""
    scene = cs.Scene(
        name="resting", duration=0.26, output=OUTPUT, time={"dt": 0.005}, contact={"thickness": 0.006},
        effects={"sleep": {"speed": 0.05, "time": 0.02}},
    )  # fmt: skip
    scene.add_cloth(cs.Mesh.grid(0.3, 0.3, 5, 5), HYSTERESIS, name="low", position=(0.0, 0.0061, 0.0))
    scene.add_cloth(cs.Mesh.grid(0.2, 0.2, 5, 5), HYSTERESIS, name="high", position=(0.0, 0.25, 0.0))
    scene.add_collider("floor", shape={"type": "box", "half_extents": [0.5, 0.1, 0.5]}, position=(0.0, -0.1, 0.0))
    return scene


SCENES = {
    "hysteresis and friction": falling,
    "stick-slip": lambda: falling(
        contact={
            "thickness": 0.006,
            "friction": {"law": "stribeck", "mu_c": 0.1, "mu_s": 0.3, "v_s": 0.1, "delta_s": 1},
        }
    ),
    "session": lambda: falling(contact={"thickness": 0.006, "self": True, "detector": "session"}),
    "constraints": lambda: falling(contact={"thickness": 0.006, "friction": 0.3, "method": "constraints"}),
    "adaptive": lambda: falling(time={"dt": "auto", "dt_tolerance": 0.01}),
    "history by need": lambda: falling(effects={"history": "auto"}),
    "semi-implicit": lambda: falling(time={"dt": 0.0025, "integrator": "semi-implicit"}),
    "sleep": resting,
    "seams and an animated body": sewn,
}


def frame_files(out: Path, first: int = 0) -> dict[int, list[tuple[str, bytes]]]:
    """OBJ files by frame, counted from ``first``; names without the frame's number."""
    files: dict[int, list[tuple[str, bytes]]] = {}
    for path in sorted((out / "obj").rglob("*.obj")):
        numbers = re.findall(r"\d+", path.name)
        if not numbers:  # of a body that stands still
            continue
        number = numbers[-1]
        files.setdefault(first + int(number), []).append((path.name.replace(number, "N"), path.read_bytes()))
    return files


def assert_same(whole_run: Path, later: Path, frame: int) -> None:
    """Every file of every frame, and all positions and velocities, from ``frame`` on."""
    expected, got = frame_files(whole_run), frame_files(later, frame)
    assert len(got) == len(expected) - frame > 0
    for at, files in got.items():
        assert files == expected[at], f"frame {at}"
    one, two = (cs.Recording.load(out / "frames.npz") for out in (whole_run, later))
    np.testing.assert_array_equal(two.times, one.times[frame:])
    for body in one.cloth:
        for at in range(len(two)):
            np.testing.assert_array_equal(two.velocities(body.name, at), one.velocities(body.name, frame + at))
        expected_rest, rest = one.rest(body.name), two.rest(body.name)
        assert expected_rest is not None
        assert rest is not None
        np.testing.assert_allclose(rest, expected_rest, atol=1e-12)


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("states") / "out"
    Job(falling(), out, progress=False).run()
    return out


@pytest.mark.parametrize("name", SCENES)
def test_from_any_state_a_run_has_the_same_bits(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]()
    report = Job(scene, tmp_path / "whole", threads=1, progress=False).run()
    assert report["states"] == [0, 3, 6, 9, 11]
    assert "states" in report["outputs"]
    if name == "sleep":
        assert json.loads((tmp_path / "whole/report.json").read_bytes())["totals"]["steps"] > 0
        assert something_sleeps(tmp_path / "whole", scene), "something sleeps in a state"
    for frame in (3, 9):
        start = Start.of_run(tmp_path / "whole", scene, frame)
        later = Job(scene, tmp_path / str(frame), threads=2, progress=False, start=start).run()
        assert later["continued"]["edited"] == later["continued"]["anew"] == []
        assert_same(tmp_path / "whole", tmp_path / str(frame), frame)


def something_sleeps(run: Path, scene: cs.Scene) -> bool:
    sim = cs.Simulation.from_frame(scene, run, 6)
    return bool(sim.step()["asleep"])


def test_positions_and_velocities_alone_are_not_enough(
    fallen: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The comparison sees what a state has beyond a frame; and what is lost is said."""
    scene = falling()
    start = Start.of_run(fallen, scene, 9, state=False)
    assert "begin anew" not in caplog.text, "asked for"
    Job(scene, tmp_path / "bare", progress=False, start=start).run()
    with pytest.raises(AssertionError):
        assert_same(fallen, tmp_path / "bare", 9)
    cs.Simulation.from_frame(scene, cs.Recording.load(fallen / "frames.npz"), 9)
    assert "what bending remembers and sides and forces of contact begin anew" in caplog.text


def test_an_edited_scene_goes_on_with_the_full_state(
    fallen: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "clothsim")
    # Only what comes later: nothing begins anew, but the account that the scene's energy is measured by.
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
    assert report["continued"]["edited"] == sim.report["continued"]["edited"] or report["continued"]["edited"]


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


def test_frames_without_a_state_name_the_nearest(fallen: Path) -> None:
    scene = falling()
    assert cs.Simulation.from_frame(scene, fallen).time == pytest.approx(0.26)
    assert cs.Simulation.from_frame(scene, fallen, -3).time == pytest.approx(0.225)
    for frame, near in ((4, "3 and 6"), (10, "9 and 11"), (-2, "9 and 11")):
        with pytest.raises(
            cs.InvalidInput, match=f"frame: expected a frame with a state, the nearest {near}, got {frame}"
        ):
            cs.Simulation.from_frame(scene, fallen, frame)
    for frame in (12, -13):
        with pytest.raises(cs.InvalidInput, match=f"0 to 11, got {frame}"):
            cs.Simulation.from_frame(scene, fallen, frame)
    with pytest.raises(
        cs.InvalidInput, match=r"frame: expected a time before the scene's end, duration = 0\.26 s, got"
    ):
        Job(scene, fallen.parent / "no", progress=False, start=Start.of_run(fallen, scene)).run()
    assert not (fallen.parent / "no").exists()


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
        (unpacked, body[:8] + b"\x09\0\0\0" + body[12:], "expected version 1 of the state of a frame, got version 9"),
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


def test_states_cost_nothing_when_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> bytes:
        raise AssertionError("a state was written")

    monkeypatch.setattr("clothsim._run.states.StateWriter.keep", never)
    report = Job(falling(output={"states": 0}), tmp_path / "out", progress=False).run()
    assert report["states"] == []
    assert not (tmp_path / "out/states").exists()
    with pytest.raises(AssertionError, match="a state was written"):
        Job(falling(), tmp_path / "on", progress=False).run()


def test_an_interrupted_run_has_the_same_states(fallen: Path, tmp_path: Path) -> None:
    scene = falling()
    out = tmp_path / "out"
    seen = iter(range(100))
    with pytest.raises(Stopped):
        Job(scene, out, progress=False, should_stop=lambda: "enough" if next(seen) == 7 else None).run()
    # On from a run that is on its way, too.
    assert sorted(states_of(out)) == [0, 3, 6]
    assert cs.Simulation.from_frame(scene, out, 6).time == pytest.approx(0.15)
    (out / ".clothsim/states/000009.state").write_bytes(b"of a step that a crash has undone")
    Job(scene, out, progress=False, resume=True).run()
    assert {f: p.read_bytes() for f, p in states_of(out).items()} == {
        f: p.read_bytes() for f, p in states_of(fallen).items()
    }
    assert not (out / ".clothsim").exists()


def test_states_of_an_earlier_run_stay_until_the_new_ones_are_whole(
    fallen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    shutil.copytree(fallen, out)
    before = {p.name: p.read_bytes() for p in (out / "states").iterdir()}
    scene = falling(time={"dt": 0.0025})
    seen = iter(range(100))
    with pytest.raises(Stopped):
        Job(scene, out, progress=False, overwrite=True, should_stop=lambda: "x" if next(seen) == 7 else None).run()
    assert {p.name: p.read_bytes() for p in (out / "states").iterdir()} == before
    # Killed after the states have come to their place, before the report: they are found there.
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("clothsim._run.outputs.Outputs._report", _interrupt)
        Job(scene, out, progress=False, resume=True).run()
    after = {p.name: p.read_bytes() for p in (out / "states").iterdir()}
    assert after.keys() == before.keys()
    assert after != before
    report = Job(scene, out, progress=False, resume=True).run()
    assert report["states"] == [0, 3, 6, 9, 11]
    assert {p.name: p.read_bytes() for p in (out / "states").iterdir()} == after
    # Without states the next run leaves none.
    Job(falling(output={"states": 0}), out, progress=False, overwrite=True).run()
    assert not (out / "states").exists()


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def test_the_command_goes_on_from_a_state(tmp_path: Path, run_cli: RunCli, scene_file: Path) -> None:
    scene_file.write_text(SCENE + "states = 5\n")
    first = run_cli("run", scene_file, "-o", tmp_path / "first", "--quiet")
    assert first.returncode == 0, first.stderr
    begin: list[str | Path] = ["--from", tmp_path / "first", "--frame"]
    done = run_cli("run", scene_file, "-o", tmp_path / "second", *begin, "10", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["continued"] == {"time": pytest.approx(1 / 3), "edited": [], "anew": []}
    one, two = (cs.Recording.load(tmp_path / name / "frames.npz") for name in ("first", "second"))
    for frame in range(len(two)):
        np.testing.assert_array_equal(two.positions("cloth", frame), one.positions("cloth", 10 + frame))
    # A state of a run that began at one, by its file.
    third = run_cli(
        "run", scene_file, "-o", tmp_path / "third", "--from", tmp_path / "second/states/000000.state", "-q"
    )
    assert third.returncode == 0, third.stderr
    assert (tmp_path / "third/frames.npz").read_bytes() == (tmp_path / "second/frames.npz").read_bytes()
    for arguments, message in (
        ([*begin, "7"], "the nearest 5 and 10, got 7"),
        ([*begin, "99"], "0 to 15, got 99"),
        (["--no-state"], "--no-state: expected --from RUN with it"),
        (
            ["--from", tmp_path / "second/states/000000.state", "--frame", "1"],
            "expected nothing with the file of a state",
        ),
    ):
        failed = run_cli("run", scene_file, "-o", tmp_path / "fourth", *arguments)
        assert failed.returncode == 2, failed.stderr
        assert message in failed.stderr, failed.stderr
        assert not (tmp_path / "fourth").exists()
    damaged = tmp_path / "first/states/000010.state"
    damaged.write_bytes(damaged.read_bytes()[:1000])
    failed = run_cli("run", scene_file, "-o", tmp_path / "fourth", *begin, "10")
    assert failed.returncode == 2
    assert "000010.state: expected" in failed.stderr
    assert "cut off" in failed.stderr
    help_text = run_cli("run", "--help").stdout
    assert "output.states" in help_text


def test_a_state_read_and_written_has_the_same_bytes(fallen: Path) -> None:
    path = states_of(fallen)[6]
    assert cs.Simulation.resume(path, scene=falling())._core.frame_state() == read_state(path)[1]
