"""Runs that keep full states: on from any of them, to the same bits, or with an edited scene."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENE, RunCli
from state_runs import HYSTERESIS, OUTPUT, falling

import clothsim as cs
from clothsim._run.job import Job, Stopped
from clothsim._run.start import Start
from clothsim._run.states import read_state, states_of


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
