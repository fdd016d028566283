"""What the package says goes through ``logging``; the command line shows it."""

from __future__ import annotations

import logging
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT, RunCli

import clothsim as cs
from clothsim._logs import log_step
from clothsim.stability.catalogue import find

STEP = {
    "step": 3, "time": 0.03, "retries": 0, "substeps": 1, "smallest_dt": 0.01, "converged": True, "residual": 1e-7,
    "contact": None, "intersections": None, "newton_iterations": 1, "linear_iterations": 7,
    "seconds": [["solve", 2e-3]],
}  # fmt: skip


def falling() -> cs.Simulation:
    scene = cs.Scene(duration=0.1, time={"dt": 0.01}, contact={"thickness": 0.005})
    scene.add_cloth(cs.Mesh.grid(0.5, 0.5, 7, 7), "cotton", position=(0.0, 0.3, 0.0))
    return cs.Simulation(scene)


def test_steps_are_told_to_those_who_ask(caplog: pytest.LogCaptureFixture) -> None:
    sim = falling()
    with caplog.at_level(logging.DEBUG, "clothsim"):
        sim.step()
        sim.advance(0.03)
    lines = [record.getMessage() for record in caplog.records if record.levelno == logging.DEBUG]
    assert [line.split(":")[0] for line in lines] == [f"step {k} to {k / 100:.4f} s" for k in (1, 2, 3, 4)]
    assert {record.name for record in caplog.records} == {"clothsim.simulation"}


def test_nobody_who_asks_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = falling()
    monkeypatch.setattr("clothsim._logs.log_step", lambda *_: pytest.fail("a line that nobody reads"))
    sim.advance(0.03)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({}, None),
        (
            {"retries": 2, "substeps": 4, "smallest_dt": 0.0025},
            "refused 2 times, taken in 4 parts, the smallest 0.0025 s",
        ),
        ({"converged": False, "residual": 0.5}, "met a cap before its tolerance, residual 0.5"),
        ({"contact": {"held_vertices": 5, "collisions": 1}}, "5 vertices held back"),
        ({"intersections": 3}, "3 pairs of triangles pass through each other"),
    ],
)
def test_what_went_hard_is_worth_a_line(
    change: dict[str, object], line: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "clothsim"):
        log_step(logging.getLogger("clothsim.simulation"), {**STEP, **change})
    assert [r.getMessage() for r in caplog.records] == ([] if line is None else [f"step 3 to 0.0300 s: {line}"])


def test_a_refused_step_says_why(caplog: pytest.LogCaptureFixture) -> None:
    """A ball pushes a held sheet in: steps are made again smaller, and each line has the reason that the report has."""
    scene = find("fast-sphere").build(5e-3, 30.0).scene
    sim = cs.Simulation(scene)
    with caplog.at_level(logging.INFO, "clothsim"):
        sim.advance(scene.duration)
    refused = sim.report["refused"]
    told = [r.getMessage() for r in caplog.records if "refused" in r.getMessage()]
    first = {r["step"]: r["reason"] for r in reversed(refused)}
    assert told and len(told) == len(first)
    for line, (step, reason) in zip(told, sorted(first.items()), strict=True):
        assert line.startswith(f"step {step} to ") and line.endswith(f": {reason}") and reason


def test_the_library_is_silent_without_a_configuration() -> None:
    code = "import logging, clothsim; logging.getLogger('clothsim.simulation').warning('hear me')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    done = subprocess.run(
        [sys.executable, "-c", f"import logging; logging.basicConfig(); {code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == "WARNING:clothsim.simulation:hear me\n"


def test_the_package_prints_nothing_by_itself() -> None:
    """What is printed is the command line's, or the progress of a job that was asked to show it."""
    allowed = {"_cli", "_run", "study", "stability", "reproduce"}
    package = ROOT / "python" / "clothsim"
    for path in package.rglob("*.py"):
        if path.relative_to(package).parts[0] not in allowed:
            code = re.sub(r'""".*?"""', "", path.read_text(), flags=re.S)
            assert not re.search(r"^\s*(print\(|sys\.std(out|err)\.write)", code, re.M), path


def test_verbosity_on_the_command_line(tmp_path: Path, scene_file: Path, run_cli: RunCli) -> None:
    scene_file.write_text(
        scene_file.read_text().replace("thickness = 0.006", "thickness = 0.1\nallow_intersections = true")
    )
    out = {}
    for flags in ([], ["-v"], ["-vv"], ["-q"]):
        done = run_cli("run", scene_file, "-o", tmp_path / "out", "--frames", "1", "--overwrite", *flags)
        assert done.returncode == 0, done.stderr
        out["".join(flags)] = done.stderr
    warning = "warning: contact.thickness = 0.1 m is above the edge length"
    assert [warning in out[flags] for flags in ("", "-v", "-vv", "-q")] == [True, True, True, False]
    assert ["debug: step 1 to " in out[flags] for flags in ("", "-v", "-vv", "-q")] == [
        False,
        False,
        True,
        False,
    ]
    assert out["-q"] == ""
