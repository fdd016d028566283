"""Full and read-only disks: what was there stays, path and cause are said, and what is missing can be made later."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import SCENE
from disks import filled, read_only, small_disk

import clothsim as cs
from clothsim._cli import main
from clothsim._run.job import Job
from clothsim._run.outputs import Outputs

BARE = SCENE.replace("duration = 0.5", "duration = 0.1").replace("fps = 30", "fps = 60")
# The film strip is written as the plots are, and takes far longer to draw.
FORMATS = ["npz", "obj", "ply", "pc2", "vtk", "gltf", "usd", "plots"]
NEEDS = {"vtk": "pyvista", "usd": "pxr", "plots": "matplotlib"}
CLOCKS = {"plots.png"}


def scene_with(folder: Path, *formats: str) -> cs.Scene:
    asked = "".join(f"{key} = {str(key in formats).lower()}\n" for key in FORMATS)
    text = BARE.replace("usd = false\nfilm_strip = false\nplots = false\n", asked + "film_strip = false\n")
    (folder / "scene.toml").write_text(text)
    return cs.Scene.load(folder / "scene.toml")


def contents(folder: Path) -> dict[str, bytes]:
    """Every file but the report, whose clocks differ, and what is unfinished."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and ".clothsim" not in p.parts)
    return {str(p.relative_to(folder)): p.read_bytes() for p in files if p.name not in {"report.json", *CLOCKS}}


@pytest.mark.parametrize("key", FORMATS)
def test_an_output_for_which_there_is_no_room(tmp_path: Path, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each output fails near its start, in its middle and near its end."""
    if key in NEEDS:
        pytest.importorskip(NEEDS[key])
    scene = scene_with(tmp_path, key)
    Job(scene, tmp_path / "roomy", progress=False).run()
    before = contents(tmp_path / "roomy")
    with small_disk(tmp_path / "disk", 8_000_000) as disk:
        out = disk / "out"
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(Outputs, "write", interrupted)
            Job(scene, out, progress=False).run()
        files = [p for p in (tmp_path / "roomy").rglob("*") if p.is_file() and p.name != "report.json"]
        size = sum(p.stat().st_size for p in files)
        # A picture of clocks has another size each time: near its end it might fit, and the report not.
        for share in (0.0, 0.1, 0.3, 0.5, 0.8, *(() if key == "plots" else (0.95,))):
            with filled(disk, int(share * size)), pytest.raises(cs.OutputError) as caught:
                Job(scene, out, resume=True, progress=False).run()
            assert "no space left" in str(caught.value)
            assert re.search(rf"{re.escape(str(out))}(/report\.json)?: ", str(caught.value))
            assert "--resume writes what is missing" in str(caught.value)
            assert [p.name for p in out.iterdir()] == [".clothsim"], "nothing is half written"
        Job(scene, out, resume=True, progress=False).run()
        assert contents(out) == before
        assert not list(out.glob(".*"))


def interrupted(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("free", [0, 20_000, 60_000, 150_000])
def test_no_room_while_simulating(tmp_path: Path, free: int) -> None:
    scene = scene_with(tmp_path, "npz")
    Job(scene, tmp_path / "roomy", progress=False).run()
    with small_disk(tmp_path / "disk", 8_000_000) as disk:
        out = disk / "out"
        for attempt in range(2):
            with filled(disk, free), pytest.raises(cs.OutputError, match=f"cannot write {out}.*no space left"):
                Job(scene, out, resume=attempt > 0, progress=False).run()
            assert [p.name for p in out.glob("*")] in ([], [".clothsim"])
        Job(scene, out, resume=True, progress=False).run()
        assert contents(out) == contents(tmp_path / "roomy")


# One command each, with what makes it quick; OUT is the folder it writes.
COMMANDS = {
    "run": "run SCENE -o OUT --overwrite --quiet",
    "export": "export OUT --format obj --overwrite",
    "study": "study SCENE --set duration=0.02 --vary dt=0.005,0.01 --repeats 1 -o OUT --overwrite --quiet",
    "stability": "stability empty --quick -o OUT --overwrite --quiet",
    "sweep": "sweep SWEEP -o OUT --overwrite --quiet",
}
SWEEP = """
scene = "scene.toml"
timeout = 100.0
[vary]
"contact.friction" = [0.1, 0.2]
"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    scene_with(tmp_path, "npz")
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path


def call(command: str, files: Path, out: Path) -> int:
    names = {"SCENE": str(files / "scene.toml"), "SWEEP": str(files / "sweep.toml"), "OUT": str(out)}
    return main([names.get(word, word) for word in COMMANDS[command].split()])


@pytest.mark.parametrize("command", COMMANDS)
def test_no_room_for_a_command(command: str, files: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What a folder has from before is there afterwards, and once there is room the command goes through."""
    if command == "sweep":
        pytest.importorskip("distributed")
    with small_disk(files / "disk", 16_000_000) as disk:
        out = disk / "out"
        if command == "export":
            assert call("run", files, out) == 0
        assert call(command, files, out) == 0
        before = everything(out)
        capfd.readouterr()
        with filled(disk, 0):
            assert call(command, files, out) == 1
            errors = capfd.readouterr().err
        assert "no space left" in errors
        assert f"cannot write {out}" in errors or f"{out}: " in errors
        assert "Traceback" not in errors
        assert {path: everything(out).get(path) for path in before} == before
        assert call(command, files, out) == 0
        assert everything(out).keys() == before.keys()


def everything(out: Path) -> dict[str, bytes]:
    files = [p for p in out.rglob("*") if p.is_file() and ".clothsim" not in p.parts]
    return {str(p.relative_to(out)): p.read_bytes() for p in files}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_read_only_folder(command: str, files: Path, capfd: pytest.CaptureFixture[str]) -> None:
    if command == "sweep":
        pytest.importorskip("distributed")
    out = files / "there" / "out"
    out.mkdir(parents=True)
    (out / "notes.txt").write_text("mine")
    if command == "export":
        assert call("run", files, out) == 0
    before = everything(out)
    with read_only(files / "there"):
        capfd.readouterr()
        assert call(command, files, out) == 1
        errors = capfd.readouterr().err
    assert f"cannot write {out}" in errors
    assert "Read-only file system" in errors
    assert "Traceback" not in errors
    assert everything(out) == before


def test_inputs_on_a_read_only_disk_are_enough(files: Path) -> None:
    (files / "inputs").mkdir()
    (files / "inputs" / "scene.toml").write_text((files / "scene.toml").read_text())
    with read_only(files / "inputs"):
        assert main(["run", str(files / "inputs" / "scene.toml"), "-o", str(files / "out"), "--quiet"]) == 0


def test_a_checkpoint_and_a_scene_of_ones_own(tmp_path: Path) -> None:
    """The API's files: a full disk leaves the old one."""
    scene = scene_with(tmp_path)
    sim = cs.Simulation(scene)
    with small_disk(tmp_path / "disk", 4_000_000) as disk:
        sim.save_checkpoint(disk / "state")
        scene.save(disk / "copy.toml")
        before = everything(disk)
        sim.advance(0.01)
        with filled(disk, 0):
            with pytest.raises(cs.OutputError, match="no space left"):
                sim.save_checkpoint(disk / "state")
            with pytest.raises(cs.OutputError, match="no space left"):
                scene.save(disk / "copy.toml")
        assert everything(disk) == before


def test_standard_output_that_cannot_be_written() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "clothsim", "schema"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
