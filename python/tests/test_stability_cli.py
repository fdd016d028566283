"""The stability atlas on the command line: folders, interruptions, bad input, and the committed maps."""

from __future__ import annotations

import csv
import itertools
import json
import re
import shlex
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, RunCli, cli_command

from clothsim.stability.atlas import Request, parse_values, value_text
from clothsim.stability.catalogue import CATALOGUE
from clothsim.stability.verdict import Verdict

QUICK = ("stability", "one-triangle", "empty", "--at", "dt=5e-3,1/24", "--at", "stiffness=1,100")


def test_the_command_writes_tables_and_maps_and_refuses_a_second_atlas(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    out = tmp_path / "out"
    done = run_cli(*QUICK, "-o", out)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "one-triangle: One triangle" in done.stdout and "no promise broken" in done.stdout
    assert "100%" in done.stderr, "a progress bar"
    names = {p.name for p in out.iterdir()}
    maps = {f"{case}.{suffix}" for case in ("one-triangle", "empty", "overview") for suffix in ("png", "svg")}
    assert names == maps | {"README.md", "stability.csv", "stability.json"}, "no work folder is left"
    with (out / "stability.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    facts = json.loads((out / "stability.json").read_text())
    assert len(rows) == facts["cells"] == 4 + 6
    assert [r["verdict"] for r in rows] == [c["verdict"] for case in facts["cases"] for c in case["cells"]]
    assert {r["verdict"] for r in rows if r["case"] == "empty" and r["y"] != "all pinned"} == {"refused"}
    page = (out / "README.md").read_text()
    assert "| **One triangle** | dt × stiffness | 4 |" in page and "clothsim stability one-triangle empty --at" in page
    before = (out / "stability.json").read_bytes()
    again = run_cli(*QUICK, "-o", out)
    assert again.returncode == 2 and "holds an atlas already" in again.stderr
    resumed = run_cli(*QUICK, "-o", out, "--resume", "--json")
    assert json.loads(resumed.stdout)["resumed"] == "complete already"
    other = run_cli("stability", "empty", "-o", out, "--resume")
    assert other.returncode == 2 and "is another one; --overwrite starts anew" in other.stderr
    assert (out / "stability.json").read_bytes() == before


def test_an_interrupted_atlas_goes_on_where_it_stopped(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    out = tmp_path / "out"
    arguments = ("stability", "one-triangle", "--at", "dt=1e-3,1e-4,5e-5", "--at", "stiffness=1", "-o", out, "--quiet")
    process = subprocess.Popen(cli_command(*arguments, "--jobs", "1"), stderr=subprocess.PIPE, text=True)
    work, deadline = out / ".clothsim", time.monotonic() + 120
    while not list(work.glob("*.result")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "to go on:" in errors and "--resume" in errors and "Traceback" not in errors
    kept = {p.name: p.stat().st_mtime_ns for p in work.glob("*.result")}
    assert 1 <= len(kept) < 3 and not list(work.glob("*.job")), "its runs are stopped"
    refused = run_cli(*arguments)
    assert refused.returncode == 2 and "holds an unfinished atlas; --resume goes on with it" in refused.stderr
    done = run_cli(*arguments, "--resume", "--json")
    assert done.returncode == 0, done.stderr
    assert {c["verdict"] for c in json.loads(done.stdout)["cases"][0]["cells"]} == {"stable"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("strech",), "did you mean 'stretch'?"),
        (("stretch", "--at", "stifness=1"), "did you mean 'stiffness'?"),
        (("stretch", "--at", "dt"), "expected NAME=VALUE"),
        (("stretch", "--at", "dt=1e-3", "--at", "dt=1e-2"), "expected it once"),
        (("stretch", "--at", "dt=0"), "expected a number > 0 [s]"),
        (("stretch", "--at", "dt=fast"), "expected a number > 0 [s]"),
        (("integrators", "--at", "integrator=rk5"), "did you mean 'rk4'?"),
        (("stretch", "--set", "integrater=rk4"), 'did you mean "integrator"?'),
        (("stretch", "--resume"), "-o: expected an output folder"),
        (("stretch", "--jobs", "0"), "expected a whole number ≥ 1"),
        (("stretch", "--limit", "-1"), "expected a number > 0 [s]"),
    ],
)
def test_bad_input_is_answered(run_cli: RunCli, arguments: tuple[str, ...], message: str) -> None:
    done = run_cli("stability", *arguments, "--quick")
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr


def test_the_list_names_every_case(run_cli: RunCli) -> None:
    listed = json.loads(run_cli("stability", "--list", "--json").stdout)
    assert [c["case"] for c in listed] == [case.name for case in CATALOGUE]
    assert "example: clothsim stability" in run_cli("stability", "--help").stdout.replace("\n", " ")


def test_a_broken_promise_is_an_exit_code(run_cli: RunCli, monkeypatch: pytest.MonkeyPatch) -> None:
    explicit = ("--set", "integrator=explicit-euler", "--at", "dt=1e-5", "--at", "stiffness=1000", "--json")
    done = run_cli("stability", "stretch", *explicit)
    assert done.returncode == 1, "explicit Euler without damping has no stable step"
    facts: dict[str, Any] = json.loads(done.stdout)
    assert facts["broken"] == 1 and facts["cases"][0]["cells"][0]["verdict"] == "diverged silently"


def test_values_are_written_as_they_are_read() -> None:
    for value in (1 / 24, 1 / 60, 1e-5, 5e-3, 1e7, 0.0, -1.0, "edge on face"):
        name, values = parse_values(f"key={value_text(value)}")
        assert name == "key" and values == [pytest.approx(value) if isinstance(value, float) else value]


# The docs -------------------------------------------------------------------------------------------------------


def test_the_docs_name_every_verdict_and_their_commands_can_be_run() -> None:
    page = (ROOT / "docs" / "stability.md").read_text()
    for verdict in Verdict:
        assert f"| {verdict.words} | `{verdict.letter}` |" in page
    lines = [shlex.split(x, comments=True) for b in re.findall(r"```sh\n(.*?)```", page, re.S) for x in b.splitlines()]
    for words in lines:
        assert words[:2] == ["clothsim", "stability"]
        at = dict(parse_values(b) for a, b in itertools.pairwise(words) if a == "--at")
        cases = [w for w in words[2:] if w in {c.name for c in CATALOGUE}]
        assert "--list" in words or Request(cases, at=at).cells()


def test_the_committed_atlas_is_of_these_cases() -> None:
    folder = ROOT / "stability"
    facts = json.loads((folder / "stability.json").read_text())
    assert facts["command"].startswith("clothsim stability ") and facts["command"].endswith("-o stability")
    assert [c["case"] for c in facts["cases"]] == [case.name for case in CATALOGUE]
    for made in facts["cases"]:
        assert all((folder / f"{made['case']}.{suffix}").exists() for suffix in ("png", "svg"))
        kinds = {cell["verdict"] for cell in made["cells"] if cell["promised"]}
        assert not kinds & {"tunnelled", "intersected", "failed"}, made["case"]
