"""States and a disk that fills up, a folder of them that is gone, and a mesh that is another one on resuming."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from disks import filled, small_disk
from state_runs import falling

import clothsim as cs
from clothsim._run.job import Job
from clothsim._run.states import StateWriter, read_state, states_of


def every() -> cs.Scene:
    """A state of each of its 12 frames, a checkpoint of every second."""
    return falling(output={"states": 1, "obj": False})


@pytest.fixture(scope="module")
def roomy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("roomy") / "out"
    Job(every(), out, progress=False).run()
    return out


def contents(out: Path) -> dict[str, bytes]:
    """Frames and states."""
    return {str(p.relative_to(out)): p.read_bytes() for p in [out / "frames.npz", *states_of(out).values()]}


def assert_whole(out: Path) -> int:
    """Every state that is there can be read; how many there are."""
    states = states_of(out)
    for frame, path in states.items():
        assert read_state(path)[0]["frame"] == frame
    return len(states)


@contextlib.contextmanager
def stopped_after(states: int) -> Iterator[None]:
    """Ctrl-C in the middle of the run, after so many states."""
    keep, kept = StateWriter.keep, []

    def kept_and_stopped(self: StateWriter, frame: int, core: Any) -> None:
        keep(self, frame, core)
        kept.append(frame)
        if len(kept) == states:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(StateWriter, "keep", kept_and_stopped)
        yield


def test_no_room_for_states(roomy: Path, tmp_path: Path) -> None:
    size = sum(path.stat().st_size for path in states_of(roomy).values())
    reached = set()
    with small_disk(tmp_path / "disk", 8_000_000) as disk:
        for share in (0.0, 0.2, 0.5, 0.8, 1.0):
            out = disk / "out"
            for attempt in range(2):
                with filled(disk, int(share * size)), pytest.raises(cs.OutputError) as caught:
                    Job(every(), out, resume=attempt > 0, progress=False).run()
                assert "no space left" in str(caught.value)
                assert str(out) in str(caught.value)
                reached.add(assert_whole(out))
            Job(every(), out, resume=True, progress=False).run()
            assert contents(out) == contents(roomy)
            assert not list(out.glob(".*"))
            shutil.rmtree(out)
    assert len(reached) > 2, "the disk was full at different states"
    assert max(reached) > 3


def test_states_are_put_in_place_or_stay_where_they_are(
    roomy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There is room for the frames and the states, and none for the report."""
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr("clothsim._run.outputs.write_whole", no_room)
        with pytest.raises(cs.OutputError, match=r"report\.json.*--resume writes what is missing"):
            Job(every(), out, progress=False).run()
    assert assert_whole(out) == len(states_of(roomy))
    Job(every(), out, resume=True, progress=False).run()
    assert contents(out) == contents(roomy)


def no_room(path: Path, _: bytes) -> None:
    raise cs.OutputError(28, f"cannot write {path}: no space left")


def test_states_that_are_deleted_on_the_way(roomy: Path, tmp_path: Path) -> None:
    """What was kept is gone; the run goes on, keeps what comes, and says which frames have a state."""
    out = tmp_path / "out"
    with stopped_after(7):
        Job(every(), out, progress=False).run()
    assert assert_whole(out) == 7
    shutil.rmtree(out / ".clothsim" / "states")
    report = Job(every(), out, resume=True, progress=False).run()
    frames = np.load(roomy / "frames.npz")["positions"]
    np.testing.assert_array_equal(np.load(out / "frames.npz")["positions"], frames)
    assert report["states"] == list(states_of(out)) == list(range(12))[-len(states_of(out)) :]
    for frame, path in states_of(out).items():
        assert path.read_bytes() == states_of(roomy)[frame].read_bytes()
    with pytest.raises(cs.InvalidInput, match="frame: expected a frame with a state, the nearest"):
        cs.Simulation.from_frame(every(), out, 1)


def test_states_that_are_deleted_later(roomy: Path, tmp_path: Path) -> None:
    """A finished run whose folder of states is gone is one without states, and says so."""
    run = tmp_path / "run"
    shutil.copytree(roomy, run)
    shutil.rmtree(run / "states")
    with pytest.raises(
        cs.InvalidInput, match=r"run/states: expected the states that the run's report speaks of.*--no-state"
    ):
        cs.Simulation.from_frame(every(), run, 5)
    sim = cs.Simulation.from_frame(every(), run, 5, state=False)
    np.testing.assert_array_equal(sim.positions, np.load(run / "frames.npz")["positions"][5])


def test_a_mesh_that_is_another_one_on_resuming(tmp_path: Path) -> None:
    cs.Mesh.grid(0.4, 0.4, 7, 7).save(tmp_path / "cloth.obj")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        "duration = 0.2\n[output]\nfps = 40\nstates = 1\ncheckpoint_interval = 0.05\n"
        "usd = false\nfilm_strip = false\nplots = false\n"
        '[[cloth]]\nname = "a"\nmaterial = "cotton"\nmesh = { file = "cloth.obj" }\n'
    )
    with stopped_after(5):
        Job(cs.Scene.load(scene), tmp_path / "out", progress=False).run()
    before = {path: path.read_bytes() for path in tmp_path.glob("out/.clothsim/**/*") if path.is_file()}
    for mesh in (cs.Mesh.grid(0.41, 0.4, 7, 7), cs.Mesh.grid(0.4, 0.4, 8, 7)):
        mesh.save(tmp_path / "cloth.obj")
        with pytest.raises(cs.CheckpointError, match="one of its meshes has changed; --overwrite starts anew"):
            Job(cs.Scene.load(scene), tmp_path / "out", resume=True, progress=False).run()
        assert {path: path.read_bytes() for path in before} == before, "what was there stays"
    cs.Mesh.grid(0.4, 0.4, 7, 7).save(tmp_path / "cloth.obj")
    report = Job(cs.Scene.load(scene), tmp_path / "out", resume=True, progress=False).run()
    assert report["states"] == list(range(9))
