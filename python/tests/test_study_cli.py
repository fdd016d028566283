"""Studies on the command line: folders, interruptions, bad input, tuning, docs and gallery."""

from __future__ import annotations

import csv
import json
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, RunCli, cli_command
from study_scenes import HANGING, load

import clothsim as cs
from clothsim._cli import main
from clothsim.study.job import Request

# Folders and the command line -----------------------------------------------------------------------------------

VARY = ("--vary", "integrator=midpoint,rk4", "--vary", "dt=1e-3,5e-4", "--repeats", "1")


def visible(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


FILES = ["study.csv", "study.json", "study.md", "study.png", "study.svg"]


def test_the_command_writes_tables_and_plots_and_refuses_a_second_study(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    done = run_cli("study", scene, *VARY, "-o", out)
    assert done.returncode == 0, done.stderr
    assert "front of rms over wall-clock time" in done.stdout and "order in dt" in done.stdout
    assert "100%" in done.stderr, "a progress bar"
    assert visible(out) == FILES, "no work folder is left"
    with (out / "study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 and {r["status"] for r in rows} == {"ok"} and any(r["on_front"] == "1" for r in rows)
    facts = json.loads((out / "study.json").read_text())
    assert facts["command"].startswith("clothsim study ") and facts["machine"]["processor"]
    assert [float(r["rms"]) for r in rows] == pytest.approx(
        [r["values"]["rms"]["value"] for r in facts["rows"]], rel=1e-5
    )
    read = cs.study.load(out)
    assert [row.facts() for row in read.rows] == facts["rows"] and [o.facts() for o in read.orders] == facts["orders"]
    with pytest.raises(cs.InvalidInput, match="expected the file of a study"):
        cs.study.load(tmp_path)
    page = (out / "study.md").read_text()
    assert "the reference is the run at rk4, dt 0.000125" in page and "study.png" in page
    before = (out / "study.json").read_bytes()
    again = run_cli("study", scene, *VARY, "-o", out)
    assert again.returncode == 2 and "holds a study already" in again.stderr
    resumed = run_cli("study", scene, *VARY, "-o", out, "--resume", "--json")
    assert json.loads(resumed.stdout)["resumed"] == "complete already"
    other = run_cli("study", scene, "--vary", "dt=1e-3,5e-4", "-o", out, "--resume")
    assert other.returncode == 2 and "is another one; --overwrite starts anew" in other.stderr
    run = run_cli("run", scene, "-o", out, "--frames", "1")
    assert run.returncode == 0, "a run's files have other names"
    mixed = run_cli("study", scene, *VARY, "-o", out, "--overwrite")
    assert mixed.returncode == 2 and "holds a run of a scene" in mixed.stderr
    assert (out / "study.json").read_bytes() == before


def test_a_killed_study_goes_on_where_it_stopped(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING.replace("duration = 0.05", "duration = 1.0"))
    arguments = ("study", scene, "--vary", "dt=4e-3,2e-3,1e-4,5e-5", "--repeats", "1", "--quiet", "-o", out)
    process = subprocess.Popen(cli_command(*arguments, "--processes", "1"), stderr=subprocess.PIPE, text=True)
    work = out / ".clothsim"
    deadline = time.monotonic() + 120
    for results in (1, 2):
        while len(list(work.glob("*.result"))) < results:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        if results == 1:
            second = run_cli(*arguments, "--resume")
            assert second.returncode == 2 and "another run is writing here" in second.stderr
    process.kill()
    process.communicate()
    kept = {p.name: p.stat().st_mtime_ns for p in work.glob("*.result")}
    assert 2 <= len(kept) < 6 and not (out / "study.json").exists()
    refused = run_cli(*arguments)
    assert refused.returncode == 2 and "holds an unfinished study; --resume goes on with it" in refused.stderr
    other = run_cli("study", scene, "--vary", "dt=1e-3,5e-4", "-o", out, "--resume")
    assert other.returncode == 2 and "the unfinished study is another one" in other.stderr
    # Interrupted again by Ctrl-C, which says how to go on.
    process = subprocess.Popen(cli_command(*arguments, "--resume"), stderr=subprocess.PIPE, text=True)
    old = set(work.glob("*.job"))
    while not set(work.glob("*.job")) - old:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "to go on:" in errors and "--resume" in errors and "Traceback" not in errors
    now = {p.name: p.stat().st_mtime_ns for p in work.glob("*.result")}
    assert {name: now[name] for name in kept} == kept, "what had run is not run again"
    assert not (set(work.glob("*.job")) - old), "its runs are stopped"
    done = run_cli(*arguments, "--resume")
    assert done.returncode == 0, done.stderr
    assert visible(out) == FILES
    assert [r["error"] for r in json.loads((out / "study.json").read_text())["rows"]] == [None] * 4


def test_bad_input_on_the_command_line(tmp_path: Path, run_cli: RunCli) -> None:
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    nothing = run_cli("study", scene, "-o", out)
    assert nothing.returncode == 2 and "expected an axis with two values or more" in nothing.stderr
    unknown = run_cli("study", scene, "--vary", "integrater=rk4,midpoint", "-o", out, "--json")
    assert unknown.returncode == 2
    assert 'did you mean "integrator"?' in json.loads(unknown.stdout)["error"]["message"]
    alone = run_cli("study", scene, "--vary", "integrator=rk5", "-o", out)
    assert alone.returncode == 2 and 'got "rk5" (did you mean "rk4"?)' in alone.stderr, "named before all else"
    both = run_cli("tune", scene, "--error", "1mm", "--budget", "1ms", "-o", out)
    assert both.returncode == 2 and "not allowed with" in both.stderr
    physical = run_cli("tune", scene, "--error", "1mm", "--vary", "friction=0.1,0.2", "-o", out)
    assert physical.returncode == 2 and "axes that do not change what is asked" in physical.stderr
    run = run_cli("tune", scene, "--error", "1mm", "--vary", "precision=f64,f32", "-o", out)
    assert run.returncode == 2 and "got precision, which is no part of one" in run.stderr
    assert not out.exists(), "bad input leaves no folder behind"
    out.mkdir()
    (out / "stability.json").write_text("{}")
    other = run_cli("study", scene, "--vary", "dt=0.01,0.005", "-o", out, "--overwrite")
    assert other.returncode == 2 and "holds an atlas; choose another folder" in other.stderr
    (out / "stability.json").rename(out / "study.json")
    other = run_cli("stability", "stretch", "--quick", "-o", out, "--overwrite")
    assert other.returncode == 2 and "holds a study; choose another folder" in other.stderr
    assert "example: clothsim study" in run_cli("study", "--help").stdout.replace("\n", " ")


# Tuning ---------------------------------------------------------------------------------------------------------


def test_tuned_settings_meet_their_bound_when_measured_again(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    done = run_cli("tune", scene, "--error", "0.1mm", "-o", out, "--repeats", "1", "--cost", "cpu_seconds", "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    facts = json.loads(done.stdout)
    assert facts["met"] and visible(out) == sorted([*FILES, "tune.json", "tuned.toml"])
    # Measured once more, by hand: the scene that was written against a far finer one.
    tuned = cs.Scene.load(out / "tuned.toml")
    ends = []
    for integrator, dt in ((None, None), ("rk4", 2e-5)):
        data = tuned.to_dict()
        if integrator:
            data["time"].update(integrator=integrator, dt=dt)
        simulation = cs.Simulation(cs.Scene(**data), threads=1)
        simulation.advance(tuned.duration)
        ends.append(simulation.positions)
    rms = float(np.sqrt(((ends[0] - ends[1]) ** 2).sum(axis=1).mean()))
    assert rms <= 1e-4
    assert rms == pytest.approx(facts["measured_again"]["values"]["rms"]["error"], abs=1e-8)
    again = run_cli("tune", scene, "--error", "0.1mm", "-o", out)
    assert again.returncode == 2 and "holds a study already" in again.stderr


def test_a_budget_gives_the_most_precise_settings_within_it(tmp_path: Path) -> None:
    vary: dict[str, Sequence[Any]] = {"integrator": ["implicit-euler", "rk4"], "dt": [0.005, 0.0025, 0.00125]}
    found = cs.study.tune(
        load(tmp_path, HANGING), budget=10.0, per="run", vary=vary, repeats=1, cost="cpu_seconds", progress=False
    )
    assert found.met and found.row is not None and found.row.settings == {"integrator": "rk4", "dt": 0.00125}
    assert "rk4" in found.statement


def test_a_bound_that_nothing_meets_is_said(tmp_path: Path) -> None:
    found = cs.study.tune(
        load(tmp_path, HANGING), error=1e-9, vary={"integrator": ["implicit-euler"], "dt": [0.01, 0.005]}, repeats=1,
        progress=False,
    )  # fmt: skip
    assert not found.met and found.scene is None and "not found" in found.statement


# Docs -----------------------------------------------------------------------------------------------------------

PAGES = [ROOT / "docs" / "study.md", ROOT / "gallery" / "README.md", ROOT / "README.md"]


def commands(page: Path) -> list[list[str]]:
    blocks = page.read_text().split("```sh\n")[1:]
    lines = [shlex.split(line, comments=True) for block in blocks for line in block.split("```")[0].splitlines()]
    return [words[1:] for words in lines if words[:2] in (["clothsim", "study"], ["clothsim", "tune"])]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.parent.name + "/" + p.name)
def test_commands_in_the_docs_can_be_run(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but the runs: the scene is there, and every axis and value is known."""
    monkeypatch.chdir(ROOT)
    seen: list[Request] = []

    def stop(request: Request, *_: Any, **__: Any) -> None:
        seen.append(request)
        raise cs.ClothSimError("stopped")

    monkeypatch.setattr("clothsim.study.job.run", stop)
    found = commands(page)
    assert found
    for words in found:
        words[words.index("-o") + 1] = "/nonexistent/out"
        if words[0] == "study":
            assert main(words) == 1
            assert len(seen.pop().points) > 1


def test_the_example_in_the_docs_runs(tmp_path: Path) -> None:
    code = PAGES[0].read_text().split("```python\n")[1].split("```")[0]
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "rk4, dt 0.0002" in done.stdout and (tmp_path / "tuned.toml").exists()


@pytest.mark.parametrize("path", sorted((ROOT / "gallery").glob("*/study.json")), ids=lambda p: p.parent.name)
def test_the_gallery_was_made_by_the_command_that_it_names(path: Path) -> None:
    facts = json.loads(path.read_text())
    assert f"-o gallery/{path.parent.name}" in facts["command"]
    assert facts["command"] in (path.parent.parent / "README.md").read_text()
    assert not [r["error"] for r in facts["rows"] if r["error"] and "diverged" not in r["error"]]
    assert all((path.parent / name).exists() for name in FILES)
