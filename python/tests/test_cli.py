"""The command line: outputs, bits, interruptions, bad input."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, SCENE, RunCli, cli_command

import clothsim as cs
from clothsim._run.folder import RunFolder
from clothsim._run.job import Job, Stopped


def frames(out: Path) -> bytes:
    return (out / "frames.npz").read_bytes()


def visible(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


# Bits -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "scene.toml").write_text(SCENE)
    done = subprocess.run(
        cli_command("run", folder / "scene.toml", "-o", folder / "out", "--quiet"),
        check=True,
        capture_output=True,
        text=True,
    )
    assert "16 frames, 0.5 s simulated" in done.stdout
    return folder / "out"


@pytest.mark.parametrize("threads", ["1", "2"])
def test_equal_runs_give_equal_bytes(
    tmp_path: Path, scene_file: Path, run_cli: RunCli, reference: Path, threads: str
) -> None:
    done = run_cli("run", scene_file, "-o", tmp_path / "out", "--threads", threads, "--device", "cpu", "--quiet")
    assert done.returncode == 0, done.stderr
    assert frames(tmp_path / "out") == frames(reference)
    assert visible(tmp_path / "out") == ["frames.npz", "report.json"], "no work folder is left"
    assert json.loads((tmp_path / "out" / "report.json").read_text())["threads"] == int(threads)


def untimed(report: dict[str, Any]) -> dict[str, Any]:
    """Return what does not depend on clocks, threads and the memory that contact happened to hold."""
    frames = [
        {key: value for key, value in frame.items() if key not in ("seconds", "effects")} for frame in report["frames"]
    ]
    totals = {key: value for key, value in report["totals"].items() if "seconds" not in key}
    effects = [(effect["name"], effect["elements"]) for effect in report["effects"]]
    kept = ("scene", "scene_digest", "error", "simulated_seconds", "frame_count", "fps", "bodies", "outputs")
    return {key: report[key] for key in kept} | {"frames": frames, "totals": totals, "effects": effects}


def wait_for(condition: Any, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 120
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.002)


SLOW = SCENE.replace("nx = 17, ny = 17", "nx = 41, ny = 41").replace("fps = 30", "fps = 60")


@pytest.fixture(scope="module")
def slow_reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("slow")
    (folder / "scene.toml").write_text(SLOW)
    subprocess.run(
        cli_command("run", folder / "scene.toml", "-o", folder / "out", "--quiet"), check=True, capture_output=True
    )
    return folder


def test_a_killed_run_resumes_to_the_same_bytes(tmp_path: Path, run_cli: RunCli, slow_reference: Path) -> None:
    scene, out = slow_reference / "scene.toml", tmp_path / "out"
    work = out / ".clothsim"
    # Killed twice: after a checkpoint, and on the way on from there.
    for attempt, extra in enumerate([[], ["--resume", "--threads", "1"]]):
        process = subprocess.Popen(
            cli_command("run", scene, "-o", out, "--quiet", *extra), stderr=subprocess.PIPE, text=True
        )
        before = (work / "checkpoint").stat().st_mtime_ns if attempt else 0
        wait_for(
            lambda b=before: (work / "checkpoint").exists() and (work / "checkpoint").stat().st_mtime_ns > b, process
        )
        process.kill()
        process.communicate()
        assert not (out / "frames.npz").exists(), "killed too late to test anything"
    # Rows behind the checkpoint, half of one included, are cut off.
    with (work / "frames.bin").open("ab") as file:
        file.write(b"half a row")
    refused = run_cli("run", scene, "-o", out)
    assert refused.returncode == 2
    assert "holds an unfinished run; --resume goes on with it" in refused.stderr
    done = run_cli("run", scene, "-o", out, "--resume", "--quiet")
    assert done.returncode == 0, done.stderr
    assert frames(out) == frames(slow_reference / "out")
    assert visible(out) == ["frames.npz", "report.json"]
    ours, whole = (untimed(json.loads((o / "report.json").read_text())) for o in (out, slow_reference / "out"))
    assert ours == whole, "the report is complete"
    assert ours["totals"]["steps"] == sum(frame["steps"] for frame in ours["frames"]) > 50
    again = run_cli("run", scene, "-o", out, "--resume", "--json")
    assert json.loads(again.stdout)["resumed"] == "complete already"


def test_checkpoints_of_a_run_do_not_grow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.toml").write_text(SCENE.replace("checkpoint_interval = 0.1", "checkpoint_interval = 0.0333"))
    sizes: list[int] = []
    save = RunFolder.save_checkpoint

    def recorded(self: RunFolder, header: dict[str, Any], engine: bytes) -> None:
        sizes.append(len(engine))
        save(self, header, engine)

    monkeypatch.setattr(RunFolder, "save_checkpoint", recorded)
    Job(cs.Scene.load(tmp_path / "scene.toml"), tmp_path / "out", progress=False).run()
    assert len(sizes) > 10
    # A step's table has some 500 bytes; between two frames there are seven steps. The sides of near pairs, 19 bytes
    # each, grow with the contacts, to some 5 kB.
    tables = 500 * 7 * (len(sizes) - 4)
    assert abs(sizes[-1] - sizes[3]) < min(10_000, tables / 3), sizes


@pytest.mark.parametrize(
    ("signum", "code", "seen"), [(signal.SIGINT, 130, 1), (signal.SIGINT, 130, 9), (signal.SIGTERM, 143, 4)]
)
def test_ctrl_c_saves_a_checkpoint_and_says_how_to_go_on(
    tmp_path: Path, run_cli: RunCli, slow_reference: Path, signum: int, code: int, seen: int
) -> None:
    scene, out = slow_reference / "scene.toml", tmp_path / "out"
    process = subprocess.Popen(cli_command("run", scene, "-o", out), stderr=subprocess.PIPE, text=True)
    lines = out / ".clothsim" / "frames.jsonl"
    wait_for(lambda: lines.exists() and lines.read_bytes().count(b"\n") >= seen, process)
    process.send_signal(signum)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert f"clothsim run {scene} -o {out} --resume" in errors
    done = run_cli("run", scene, "-o", out, "--resume", "--quiet")
    assert done.returncode == 0, done.stderr
    assert frames(out) == frames(slow_reference / "out")
    ours, whole = (untimed(json.loads((o / "report.json").read_text())) for o in (out, slow_reference / "out"))
    assert ours == whole, "steps within the frame that was cut short are in the report"


def test_a_signal_in_a_frames_last_step_loses_no_frame(
    tmp_path: Path, slow_reference: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then the interpreter raises after the engine has finished the frame."""
    scene, out = cs.Scene.load(slow_reference / "scene.toml"), tmp_path / "out"
    advance, calls = cs.Simulation.advance, []

    def interrupted(self: cs.Simulation, seconds: float) -> None:
        advance(self, seconds)
        calls.append(seconds)
        if len(calls) == 5:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(cs.Simulation, "advance", interrupted)
    with pytest.raises(Stopped) as caught:
        Job(scene, out, progress=False).run()
    assert caught.value.frames == 6
    Job(scene, out, resume=True, progress=False).run()
    assert frames(out) == frames(slow_reference / "out")


def test_a_changed_scene_is_not_resumed(tmp_path: Path, run_cli: RunCli, slow_reference: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(cli_command("run", slow_reference / "scene.toml", "-o", out, "--quiet"), text=True)
    wait_for((out / ".clothsim" / "checkpoint").exists, process)
    process.kill()
    process.communicate()
    (tmp_path / "other.toml").write_text(SLOW.replace("0.42", "0.43"))
    done = run_cli("run", tmp_path / "other.toml", "-o", out, "--resume")
    assert done.returncode == 2
    assert "is of another scene" in done.stderr
    busy = subprocess.Popen(
        cli_command("run", slow_reference / "scene.toml", "-o", out, "--resume", "--quiet"), text=True
    )
    before = (out / ".clothsim" / "checkpoint").stat().st_mtime_ns
    wait_for(lambda: (out / ".clothsim" / "checkpoint").stat().st_mtime_ns > before, busy)
    second = run_cli("run", slow_reference / "scene.toml", "-o", out, "--resume")
    busy.kill()
    busy.communicate()
    assert second.returncode == 2
    assert "another run is writing here" in second.stderr


# Outputs --------------------------------------------------------------------------------------------------------


def test_everything_that_output_asks_for(tmp_path: Path, run_cli: RunCli) -> None:
    for module in ("pxr", "pyvista", "matplotlib"):
        pytest.importorskip(module)
    scene = tmp_path / "scene.toml"
    wanted = SCENE.replace("= false", "= true") + "obj = true\nply = true\n"
    scene.write_text(wanted.replace("duration = 0.5", "duration = 0.1"))
    out = tmp_path / "out"
    done = run_cli("run", scene, "-o", out)
    assert done.returncode == 0, done.stderr
    assert "100%" in done.stderr, "a progress bar"
    names = ["film_strip.png", "frames.npz", "obj", "plots.png", "ply", "report.json", "scene.usdc"]
    assert visible(out) == names
    report = json.loads((out / "report.json").read_text())
    assert sorted(report["outputs"]) == names
    assert report["frame_count"] == len(report["frames"]) == 4
    assert report["frames"][-1]["energy"]["kinetic"] > 0.0
    assert report["error"] is None and report["refused"] == [] and report["untangled"] is None
    assert report["totals"]["steps"] == sum(f["steps"] for f in report["frames"]) == 21
    assert {e["name"] for e in report["effects"]} == {e["name"] for e in report["plan"]["effects"] if e["on"]}
    recording = cs.Recording.load(out / "frames.npz")
    np.testing.assert_allclose(recording.times, [0, 1 / 30, 2 / 30, 0.1])
    last = cs.Mesh.load(out / "obj" / "cloth_0003.obj")
    np.testing.assert_array_equal(last.vertices, recording.positions("cloth", 3))
    # What is no longer asked for goes when the run is replaced.
    scene.write_text(SCENE)
    done = run_cli("run", scene, "-o", out, "--overwrite", "--frames", "2", "--json")
    assert json.loads(done.stdout)["frame_count"] == 3
    assert done.stderr == ""
    assert visible(out) == ["frames.npz", "report.json"]


def test_warnings_of_the_plan_come_before_the_run(tmp_path: Path, run_cli: RunCli) -> None:
    (tmp_path / "scene.toml").write_text(SCENE.replace("thickness = 0.006", "thickness = 0.1").replace("0.42", "0.6"))
    done = run_cli("run", tmp_path / "scene.toml", "-o", tmp_path / "out", "--frames", "1")
    assert done.returncode == 0, done.stderr
    assert "warning: contact.thickness = 0.1 m is above the edge length" in done.stderr
    quiet = run_cli("run", tmp_path / "scene.toml", "-o", tmp_path / "out", "--frames", "1", "--overwrite", "--quiet")
    assert quiet.stderr == ""


def test_an_output_folder_that_holds_a_run_is_not_touched(tmp_path: Path, scene_file: Path, run_cli: RunCli) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    assert run_cli("run", scene_file, "-o", out, "--frames", "1").returncode == 0
    before = frames(out)
    done = run_cli("run", scene_file, "-o", out, "--frames", "2")
    assert done.returncode == 2
    assert "holds a run already (frames.npz, report.json); --overwrite replaces it" in done.stderr
    assert frames(out) == before
    assert run_cli("run", scene_file, "-o", out, "--frames", "2", "--overwrite").returncode == 0
    assert frames(out) != before
    assert (out / "notes.txt").read_text() == "mine"
    file = tmp_path / "file"
    file.write_text("mine")
    assert run_cli("run", scene_file, "-o", file).returncode == 2
    assert file.read_text() == "mine"


@pytest.mark.parametrize("limit", [20_000, 200_000], ids=["while simulating", "while writing outputs"])
def test_a_full_disk_is_said_and_nothing_is_half_written(
    tmp_path: Path, scene_file: Path, run_cli: RunCli, reference: Path, limit: int
) -> None:
    """A limit on the size of files stands in for a full disk: both fail a write in the middle."""
    out = tmp_path / "out"

    def shrink() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = run_cli("run", scene_file, "-o", out, "--quiet", preexec_fn=shrink)
    assert done.returncode == 1, done.stderr
    assert "no space left" in done.stderr
    assert "Traceback" not in done.stderr
    assert visible(out) == [".clothsim"]
    done = run_cli("run", scene_file, "-o", out, "--resume", "--quiet")
    assert done.returncode == 0, done.stderr
    assert frames(out) == frames(reference)


def test_a_folder_that_cannot_be_made(scene_file: Path, run_cli: RunCli) -> None:
    done = run_cli("run", scene_file, "-o", scene_file / "out")
    assert done.returncode == 1
    assert "cannot write" in done.stderr
    assert "Not a directory" in done.stderr
    assert scene_file.read_text() == SCENE


def test_a_tangled_start_runs_only_with_the_flag(tmp_path: Path, run_cli: RunCli) -> None:
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(SCENE.replace("0.42", "0.3"))
    refused = run_cli("run", scene, "-o", out)
    assert refused.returncode == 2
    assert "pairs of triangles that pass through each other" in refused.stderr
    assert not out.exists()
    assert "pass through each other" in run_cli("plan", scene).stdout
    done = run_cli("run", scene, "-o", out, "--frames", "2", "--allow-intersections", "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads((out / "report.json").read_text())
    counts = [f["intersections"] for f in report["frames"][1:]]
    assert report["max_intersections"] == max(counts) > 0


def test_a_run_that_diverges_keeps_what_it_has(tmp_path: Path, run_cli: RunCli) -> None:
    stiff = 'material = { areal_density = 0.1, in_plane = { model = "spring", stiffness = 1e9 } }'
    text = SCENE.replace('material = "cotton"', f"{stiff}\npins = [{{ vertices = [0] }}]")
    text = text.replace("dt = 0.005", 'dt = 0.005\nintegrator = "explicit-euler"\nmax_halvings = 0')
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(text[: text.index("[contact]")] + text[text.index("[[cloth]]") :])
    done = run_cli("run", scene, "-o", out, "--quiet")
    assert done.returncode == 1
    assert "diverged at t = " in done.stderr
    report = json.loads((out / "report.json").read_text())
    assert report["error"].startswith("SimulationDiverged")
    assert np.isfinite(np.load(out / "frames.npz")["positions"]).all()
    assert np.isfinite(cs.Simulation.resume(out / "last_good.checkpoint").positions).all()


# Other commands, help, errors -----------------------------------------------------------------------------------


def test_plan(scene_file: Path, run_cli: RunCli) -> None:
    done = run_cli("plan", scene_file)
    assert done.returncode == 0
    assert "on   contact" in done.stdout
    assert "off  wind" in done.stdout
    tables = json.loads(run_cli("plan", scene_file, "--json").stdout)
    assert {e["name"]: e["on"] for e in tables["effects"]}["friction"] is True


def test_doctor(run_cli: RunCli) -> None:
    done = run_cli("doctor")
    assert done.returncode == 0
    for word in ("clothsim", "NumPy", "threads", "GPU", "usd-core", "test data"):
        assert word in done.stdout
    facts = json.loads(run_cli("doctor", "--json").stdout)
    assert facts["threads"] >= 1
    assert facts["clothsim"] == cs.__version__


def test_schema(run_cli: RunCli) -> None:
    schema = json.loads(run_cli("schema").stdout)
    assert set(schema["required"]) >= {"duration"}
    assert "contact" in schema["properties"]
    assert json.loads(run_cli("schema", "--json").stdout) == schema


@pytest.mark.parametrize("command", ["run", "plan", "doctor", "schema"])
def test_every_command_has_help_with_an_example_and_json(run_cli: RunCli, command: str) -> None:
    done = run_cli(command, "--help")
    assert done.returncode == 0
    assert f"example: clothsim {command}" in done.stdout
    assert "--json" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["rnu"], 2, "invalid choice: 'rnu' (choose from"),
        ([], 2, "required: COMMAND"),
        (["run", "SCENE"], 2, "required: -o/--out"),
        (["run", "SCENE", "-o", ""], 2, "-o/--out: expected a folder, got ''"),
        (["run", "SCENE", "-o", "OUT", "--thread", "2"], 2, "unrecognized arguments: --thread 2"),
        (["run", "SCENE", "-o", "OUT", "--threads", "0"], 2, "--threads: expected a whole number ≥ 1, got '0'"),
        (["run", "SCENE", "-o", "OUT", "--frames", "few"], 2, "--frames: expected a whole number ≥ 1, got 'few'"),
        (["run", "SCENE", "-o", "OUT", "--resume", "--overwrite"], 2, "not allowed with"),
        (["run", "SCENE", "-o", "OUT", "--device", "tpu"], 2, 'expected one of "auto", "cpu", "gpu"'),
        (["run", "none.toml", "-o", "OUT"], 2, "none.toml: cannot read the scene: No such file"),
        (["plan", "none.toml"], 2, "none.toml: cannot read the scene"),
        (["plan", "BAD"], 2, 'bad.toml:7: contact.thikness: expected one of the keys'),
    ],
)  # fmt: skip
def test_bad_calls(
    tmp_path: Path, scene_file: Path, run_cli: RunCli, arguments: list[str], code: int, message: str
) -> None:
    (tmp_path / "bad.toml").write_text(SCENE.replace("thickness", "thikness"))
    names = {"SCENE": str(scene_file), "OUT": str(tmp_path / "out"), "BAD": str(tmp_path / "bad.toml")}
    done = run_cli(*(names.get(a, a) for a in arguments))
    assert done.returncode == code
    assert message in done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_errors_as_json(run_cli: RunCli) -> None:
    done = run_cli("plan", "none.toml", "--json")
    error = json.loads(done.stdout)["error"]
    assert (done.returncode, error["type"], error["file"]) == (2, "InvalidScene", "none.toml")


def test_a_closed_pipe_is_no_error() -> None:
    process = subprocess.Popen(cli_command("schema"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)
    assert process.stdout is not None
    process.stdout.read(1)
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(timeout=60) == 0


@pytest.mark.parametrize("package", ["pyvista", "pxr", "matplotlib"])
def test_a_missing_package_is_said_before_the_simulation(tmp_path: Path, run_cli: RunCli, package: str) -> None:
    key = {"pyvista": "film_strip", "pxr": "usd", "matplotlib": "plots"}[package]
    (tmp_path / "scene.toml").write_text(SCENE.replace(f"{key} = false", f"{key} = true"))
    hide = tmp_path / "hide"
    hide.mkdir()
    (hide / "sitecustomize.py").write_text(
        "import importlib.util as u\n_find = u.find_spec\n"
        f"u.find_spec = lambda name, package=None: None if name == {package!r} else _find(name, package)\n"
    )
    done = run_cli("run", tmp_path / "scene.toml", "-o", tmp_path / "out", env={**os.environ, "PYTHONPATH": str(hide)})
    assert done.returncode == 2
    assert f"output.{key} needs the package {package}: pip install" in done.stderr
    assert not (tmp_path / "out").exists()


# A finished run is resumed only where it is what is asked for -------------------------------------------------------


def test_a_finished_run_of_another_scene_is_not_taken_for_this_one(
    tmp_path: Path, scene_file: Path, run_cli: RunCli
) -> None:
    out = tmp_path / "out"
    assert run_cli("run", scene_file, "-o", out, "--frames", "1", "--quiet").returncode == 0
    again = run_cli("run", scene_file, "-o", out, "--frames", "1", "--resume", "--quiet")
    assert "complete already" in again.stdout
    fewer = run_cli("run", scene_file, "-o", out, "--resume", "--quiet")
    assert (fewer.returncode, "has 2 of 16 frames" in fewer.stderr) == (2, True), fewer.stderr
    other = tmp_path / "other.toml"
    other.write_text(SCENE.replace("duration = 0.5", "duration = 0.25"))
    changed = run_cli("run", other, "-o", out, "--frames", "1", "--resume", "--quiet")
    assert (changed.returncode, "has changed" in changed.stderr) == (2, True), changed.stderr


@pytest.mark.parametrize("content", ['{"a":', "[]", "{}"])
def test_a_damaged_report_is_named(tmp_path: Path, scene_file: Path, run_cli: RunCli, content: str) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.json").write_text(content)
    done = run_cli("run", scene_file, "-o", tmp_path / "out", "--resume", "--quiet")
    assert (done.returncode, "report.json is damaged" in done.stderr) == (2, True), done.stderr
