"""Checkpoints and frames that were damaged or cut off: known as such, and the checkpoint before serves."""

from __future__ import annotations

import json
import logging
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT, SCENE

import clothsim as cs
from clothsim._run.folder import RunFolder
from clothsim._run.job import Job, Stopped
from clothsim._run.sealed import read_sealed as read_checkpoint


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> cs.Scene:
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE.replace("nx = 17, ny = 17", "nx = 9, ny = 9").replace("fps = 30", "fps = 60"))
    return cs.Scene.load(path)


@pytest.fixture(scope="module")
def whole(scene: cs.Scene, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("whole") / "out"
    Job(scene, out, progress=False).run()
    return (out / "frames.npz").read_bytes()


@pytest.fixture
def stopped(scene: cs.Scene, tmp_path: Path) -> Path:
    """A run that was stopped after its second checkpoint and some frames."""
    out = tmp_path / "out"
    seen = iter(range(100))
    with pytest.raises(Stopped):
        Job(scene, out, progress=False, should_stop=lambda: "enough" if next(seen) == 14 else None).run()
    work = out / ".clothsim"
    assert sorted(p.name for p in work.iterdir()) == [
        "checkpoint", "checkpoint.previous", "frames.bin", "frames.jsonl", "lock",
    ]  # fmt: skip
    assert read_checkpoint(work / "checkpoint")[0]["frames"] == 15
    assert read_checkpoint(work / "checkpoint.previous")[0]["frames"] == 12
    return out


def test_every_byte_of_a_checkpoint_counts(stopped: Path) -> None:
    """Cut off after any byte of its head and many others, or with a bit of them turned: never taken for whole."""
    path = stopped / ".clothsim" / "checkpoint"
    content = path.read_bytes()
    chance = random.Random(1)
    places = [*range(400), *chance.sample(range(400, len(content)), 300), len(content) - 1]
    for at in places:
        path.write_bytes(content[:at])
        with pytest.raises(cs.CheckpointError, match=r"checkpoint: (expected|its bytes)"):
            read_checkpoint(path)
        turned = bytearray(content)
        turned[at] ^= 1 << chance.randrange(8)
        path.write_bytes(turned)
        with pytest.raises(cs.CheckpointError, match=r"checkpoint: (expected|its bytes)"):
            read_checkpoint(path)
    path.write_bytes(content + b"x")
    with pytest.raises(cs.CheckpointError, match="cut off, or with a tail"):
        read_checkpoint(path)
    path.write_bytes(content)
    assert read_checkpoint(path)[0]["frames"] == 15


def test_every_byte_of_a_checkpoint_of_ones_own_counts(scene: cs.Scene, tmp_path: Path) -> None:
    """The same for `Simulation.save_checkpoint`, whose bytes the engine checks."""
    sim = cs.Simulation(scene)
    sim.advance(0.02)
    sim.save_checkpoint(tmp_path / "state")
    content = (tmp_path / "state").read_bytes()
    chance = random.Random(2)
    for at in [*range(200), *chance.sample(range(200, len(content)), 300), len(content) - 1]:
        turned = bytearray(content)
        turned[at] ^= 1 << chance.randrange(8)
        for damaged in (content[:at], bytes(turned)):
            (tmp_path / "state").write_bytes(damaged)
            with pytest.raises(cs.CheckpointError):
                cs.Simulation.resume(tmp_path / "state")


@pytest.mark.parametrize("what", ["cut off", "turned", "empty", "missing", "a frame of it"])
def test_the_checkpoint_before_serves(
    scene: cs.Scene, stopped: Path, whole: bytes, what: str, caplog: pytest.LogCaptureFixture
) -> None:
    work = stopped / ".clothsim"
    path = work / "checkpoint"
    content = path.read_bytes()
    if what == "missing":
        path.unlink()
    elif what == "a frame of it":
        rows = work / "frames.bin"
        damaged = bytearray(rows.read_bytes())
        damaged[-1000] ^= 4
        rows.write_bytes(damaged)
    else:
        half = len(content) // 2
        turned = content[:half] + bytes([content[half] ^ 1]) + content[half + 1 :]
        path.write_bytes({"cut off": content[:half], "turned": turned, "empty": b""}[what])
    with caplog.at_level(logging.WARNING):
        Job(scene, stopped, resume=True, progress=False).run()
    assert ("Going on from the checkpoint before, at 0.18" in caplog.text) == (what != "missing"), caplog.text
    assert (stopped / "frames.npz").read_bytes() == whole
    assert sorted(p.name for p in stopped.iterdir()) == ["frames.npz", "report.json"]


def test_without_a_whole_checkpoint_the_run_is_refused_and_kept(scene: cs.Scene, stopped: Path, whole: bytes) -> None:
    work = stopped / ".clothsim"
    for name in ("checkpoint", "checkpoint.previous"):
        (work / name).write_bytes((work / name).read_bytes()[:-1])
    before = {p.name: p.read_bytes() for p in work.iterdir()}
    with pytest.raises(cs.CheckpointError) as caught:
        Job(scene, stopped, resume=True, progress=False).run()
    for part in ("checkpoint: expected ", "checkpoint.previous: expected", "--overwrite starts anew"):
        assert part in str(caught.value)
    assert {p.name: p.read_bytes() for p in work.iterdir()} == before
    Job(scene, stopped, overwrite=True, progress=False).run()
    assert (stopped / "frames.npz").read_bytes() == whole


def test_a_run_killed_while_its_work_folder_goes_is_finished(scene: cs.Scene, stopped: Path, whole: bytes) -> None:
    """Whatever of the work folder is left: the run is complete, and what is left goes with the next command."""
    work, kept = stopped / ".clothsim", stopped.with_name("kept")
    shutil.copytree(work, kept)
    Job(scene, stopped, resume=True, progress=False).run()
    for left in (["done", "frames.bin", "frames.jsonl", "lock"], ["done", "lock"], ["lock"], []):
        work.mkdir(exist_ok=True)
        for name in left:
            shutil.copy(kept / ("checkpoint" if name == "done" else name), work / name)
        if "done" in left:
            again = Job(scene, stopped, resume=True, progress=False).run()
            assert again["resumed"] == "complete already"
            with pytest.raises(cs.OutputExists, match="holds a run already"):
                Job(scene, stopped, progress=False).run()
        else:
            Job(scene, stopped, resume=True, progress=False).run()
        assert (stopped / "frames.npz").read_bytes() == whole
        shutil.rmtree(work, ignore_errors=True)


def test_what_a_killed_process_was_writing_goes(scene: cs.Scene, stopped: Path) -> None:
    (stopped / ".frames.4711.part.npz").write_bytes(b"half")
    (stopped / ".obj.part").mkdir()
    (stopped / ".obj.part" / "cloth_0000.obj").write_text("v")
    (stopped / ".mine").write_text("mine")
    Job(scene, stopped, resume=True, progress=False).run()
    assert sorted(p.name for p in stopped.iterdir()) == [".mine", "frames.npz", "report.json"]


def test_two_checkpoints_are_kept_and_no_more(stopped: Path) -> None:
    folder = RunFolder(stopped)
    for number in range(3):
        folder.save_checkpoint({"frames": number}, bytes([number]))
    found = [read_checkpoint(path) for path in folder.checkpoints()]
    assert found == [({"frames": 2}, b"\x02"), ({"frames": 1}, b"\x01")]


def test_runs_that_are_killed_resume_to_the_same_bytes() -> None:
    """Three kills; `make kills` does a hundred."""
    tool = [sys.executable, str(ROOT / "tools" / "kills.py"), "--json", "--seed", "5"]
    done = subprocess.run([*tool, "--kills", "3"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["same"] == 3
    spoilt = subprocess.run([*tool, "--kills", "1", "--plant-fault"], capture_output=True, text=True, check=False)
    assert len(json.loads(spoilt.stdout)["different"]) == 1, "a bit of a frame that was turned is seen"
