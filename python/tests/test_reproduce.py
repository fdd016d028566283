"""``clothsim reproduce``: the catalogue, the files, the closed forms, and faults that must show."""

from __future__ import annotations

import csv
import json
import re
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import cli_command, without_gpu

from clothsim import bending
from clothsim._cli import main
from clothsim.errors import GpuUnavailable, InvalidInput
from clothsim.reproduce import CATALOGUE, Check, Effort, Table, clamping, find, pictures, reproduce, whole_steps
from clothsim.reproduce.contract import Reproduction

# Figures and tables per chapter, from the lists at the start of the thesis.
THESIS_FIGURES = {2: 1, 3: 4, 4: 14, 5: 16, 6: 11, 7: 8}
THESIS_TABLES = {4: 1, 5: 2, 6: 3, 7: 2}
REPRODUCED = [entry.name for entry in CATALOGUE if entry.state == "reproduced"]


def rows(path: Path) -> list[dict[str, str]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def column(table: list[dict[str, str]], name: str) -> Any:
    return np.array([float(row[name]) for row in table])


def loop_integral(x: Any, y: Any) -> float:
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)))


# Catalogue ------------------------------------------------------------------------------------------------------


def test_the_list_names_every_figure_and_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    expected = {f"{c}.{k}" for c, n in THESIS_FIGURES.items() for k in range(1, n + 1)}
    expected |= {f"table-{c}.{k}" for c, n in THESIS_TABLES.items() for k in range(1, n + 1)}
    expected |= {f"2010-{k}" for k in range(1, 8)} | {"2010-table-1", "2010-table-2", "2010-section-9.3"}
    assert {entry["name"] for entry in listed} == expected
    assert len(listed) == len(expected), "no name twice"
    for entry in listed:
        assert entry["state"] in ("reproduced", "drawing", "photograph", "input")
        assert (entry["command"] is not None) == (entry["state"] == "reproduced")
    assert main(["reproduce", "--list"]) == 0
    text = capsys.readouterr().out
    assert all(f"  {entry['state']}  " in text and entry["title"] in text for entry in listed)
    assert re.search(r"\n  2010-section-9\.3  reproduced  Comparison", text)
    assert "clothsim reproduce 4.7 -o out/figure-4.7" in text


@pytest.mark.parametrize("name", REPRODUCED)
def test_a_reproduced_figure_has_the_names_of_the_contract(name: str) -> None:
    module = find(name).load()
    functions = [key for key, value in vars(Reproduction).items() if callable(value) and not key.startswith("_")]
    assert set(functions) == {"measure", "parameters", "tables", "draw", "here", "checks"}
    assert all(callable(getattr(module, key)) for key in functions)
    assert module.THESIS


@pytest.mark.parametrize("spelled", ["4.7", "Figure 4.7", "fig. 4.7", "FIG 4.7"])
def test_figures_are_understood(spelled: str) -> None:
    assert find(spelled).stem == "figure-4.7"


def test_tables_are_told_from_figures() -> None:
    assert find("Table 4.1").kind == "table"
    assert find("4.1").kind == "figure"
    assert find("2010 table 2").paper == "Wong 2010"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["4.77"], "did you mean '4.7'?"),
        (["table-4.11"], "did you mean 'table-4.1'?"),
        (["4.3"], "a drawing: there is nothing to measure"),
        (["table-7.1"], "what an experiment was given"),
        (["5.2"], "reproduced are 4.7"),
        ([], "expected a name"),
    ],
)  # fmt: skip
def test_bad_names_are_answered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    out = tmp_path / "out"
    assert main(["reproduce", *arguments, "-o", str(out)]) == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def test_no_folder_no_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "4.7"]) == 2
    with pytest.raises(SystemExit, match="2"):
        main(["reproduce", "4.7", "-o", ""])
    assert "expected an output folder, got nothing: clothsim reproduce 4.7 -o out/figure-4.7" in capsys.readouterr().err


# Files ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Folders with the quick variants, each made once."""
    made: dict[str, Path] = {}

    def of(name: str) -> Path:
        if name not in made:
            out = tmp_path_factory.mktemp(name) / "out"
            try:
                reproduce(name, out, Effort(quick=True))
            except GpuUnavailable as reason:
                without_gpu(reason)
            made[name] = out
        return made[name]

    return of


@pytest.mark.parametrize("name", REPRODUCED)
def test_quick_variants_agree_with_the_paper(quick: Any, name: str) -> None:
    entry, out = find(name), quick(name)
    facts = json.loads((out / f"{entry.stem}.json").read_text())
    assert facts["line"].startswith(f"the {entry.source}: ")
    assert " / here: " in facts["line"]
    assert facts["checks"]
    if name != "table-4.1":  # its check compares times, which no test may depend on
        assert [check for check in facts["checks"] if not check["passed"]] == []
    assert (out / f"{entry.stem}.png").read_bytes().startswith(b"\x89PNG")
    head = (out / f"{entry.stem}.csv").read_text()
    assert head.startswith(f"# figure: {entry.paper}, ")
    assert f"# made by: clothsim {facts['parameters']['made by'].split()[1]}" in head
    assert "--quick" in facts["parameters"]["made by"]
    table = rows(out / f"{entry.stem}.csv")
    assert table
    assert all(None not in row and None not in row.values() for row in table), "as many cells as columns"
    assert not (out / ".clothsim").exists()


def test_the_command_prints_the_line_and_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["reproduce", "4.7", "-o", str(out), "--quick", "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("the thesis: ")
    before = (out / "figure-4.7.csv").read_bytes()
    assert main(["reproduce", "4.7", "-o", str(out), "--quick", "--quiet"]) == 2
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert main(["reproduce", "4.7", "-o", str(out), "--quick", "--overwrite", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["passed"] is True
    assert (out / "figure-4.7.csv").read_bytes() == before, "equal input, equal bytes"


def test_a_folder_with_a_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "report.json").write_text("{}")
    assert main(["reproduce", "4.7", "-o", str(tmp_path), "--quick", "--overwrite"]) == 2
    assert "holds a run of a scene" in capsys.readouterr().err


def test_what_was_killed_can_be_made_again(tmp_path: Path) -> None:
    (tmp_path / ".clothsim").mkdir()
    (tmp_path / ".clothsim" / "lock").touch()  # what kill -9 leaves
    assert main(["reproduce", "4.7", "-o", str(tmp_path), "--quick", "--quiet"]) == 0
    assert not (tmp_path / ".clothsim").exists()


def test_a_folder_with_an_unfinished_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".clothsim").mkdir()
    (tmp_path / ".clothsim" / "frames.bin").touch()
    assert main(["reproduce", "4.7", "-o", str(tmp_path), "--quick", "--overwrite"]) == 2
    assert "holds a run of a scene" in capsys.readouterr().err


def test_a_failure_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise InvalidInput("planted")

    monkeypatch.setattr(bending, "trace", fail)
    with pytest.raises(InvalidInput, match="planted"):
        reproduce("4.7", tmp_path / "out", Effort(quick=True))
    assert not (tmp_path / "out").exists()


# Closed forms, read from the files ------------------------------------------------------------------------------


def test_figure_4_7_is_the_loop_of_its_coefficients(quick: Any) -> None:
    table = rows(quick("4.7") / "figure-4.7.csv")
    loop = [row for row in table if row["panel"] == "b"]
    k, m = column(loop, "K [1/cm]"), column(loop, "M [gf cm/cm]")
    start, end = (next(i for i, row in enumerate(loop) if row["turning point"] == name) for name in ("Km", "Km again"))
    m0, k0 = (0.76 - 0.26) ** 2 / (4 * 0.38), (0.76 - 0.26) / (2 * 0.38)
    trapezoids = 1e-4  # |c1| h²/12 a sample over 10/cm of way, h = 1/200 cm
    assert loop_integral(k[start : end + 1], m[start : end + 1]) == pytest.approx(
        4 * m0 * (2.5 - 2 / 3 * k0), abs=trapezoids
    )
    assert m[start] == pytest.approx(m0 + 0.26 * 2.5, rel=1e-9)
    assert column(loop, "M [N]") == pytest.approx(m * 9.80665e-3, rel=1e-8)
    assert column(loop, "K [1/m]") == pytest.approx(k * 100.0, rel=1e-8)
    turns = [row["turning point"] for row in table if row["panel"] == "d" and row["turning point"]]
    assert turns == ["0", "Ka", "Kb", "Kc", "Kd", "Ke", "Kf", "Kg"]


def test_figure_4_14_falls_as_fatigue_says(quick: Any) -> None:
    table = rows(quick("4.14") / "figure-4.14.csv")
    n, couple = column(table, "n"), column(table, "2 M0 [gf cm/cm]")
    m0 = (5.20 - 2.51) ** 2 / (4 * 4.45)
    assert couple[0] == pytest.approx(2 * m0, rel=1e-9)
    # A recovery that is cut short takes less friction, none takes more.
    assert np.all(couple >= 2 * m0 * 0.9**n * (1 - 1e-9))
    assert np.all(np.diff(couple) <= 0.0)
    # b1 − b2 goes with the square root of M0.
    assert column(table, "b1 [gf cm2/cm]") == pytest.approx(2.51 + 2.69 * np.sqrt(couple / (2 * m0)), rel=1e-9)
    assert column(table, "residual angle [rad]") == pytest.approx(
        column(table, "rest curvature [1/cm]") * 0.4, rel=1e-8
    )


def plainly(simulation: Any, steps: int, dt: float, look: Any, path: list[Any], file: Path) -> Any:
    """Whatever the engine does within a step."""
    for _ in range(steps):
        simulation.step()
        path.append(look(simulation))
    return simulation


@pytest.mark.parametrize(("advance", "whole"), [(whole_steps.advance, True), (plainly, False)])
def test_a_path_has_the_turns_within_steps_that_are_cut(
    monkeypatch: pytest.MonkeyPatch, advance: Any, whole: bool
) -> None:
    # Steps of 2 ms: contact makes the engine cut a third of them.
    monkeypatch.setattr(whole_steps, "advance", advance)
    strip = clamping.clamp("hysteresis", 1, clamping.Setup(rows=1, dt=2e-3), hang=False, followed=True)
    assert (len(strip.path) > 328) == whole
    laws = [bending.trace(k, "hysteresis", **clamping.FABRIC.si()) for k in strip.path.T]
    off = [abs(law.b1[-1] / b1 - 1.0) > 1e-9 for law, b1 in zip(laws, strip.lifted["b1"][-1], strict=True)]
    assert any(off) != whole


# Planted faults -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "caught"),
    [
        (lambda t: replace(t, moment=t.moment * 1.0001), "M0 [gf cm/cm]"),
        (lambda t: replace(t, dissipated=t.dissipated * (1 + 1e-6)), "dissipated in the loop"),
        (lambda t: replace(t, rest_curvature=t.rest_curvature * 1.001), "rest curvature after the first cycle"),
        (lambda t: replace(t, moment=np.where(np.abs(t.curvature) < 30.0, t.moment, t.moment + 1e-4)), "dM/dK"),
    ],
)  # fmt: skip
def test_a_wrong_law_fails_figure_4_7(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], fault: Any, caught: str
) -> None:
    right = bending.trace
    monkeypatch.setattr(bending, "trace", lambda *a, **k: fault(right(*a, **k)))
    assert main(["reproduce", "4.7", "-o", str(tmp_path / "out"), "--quick", "--quiet"]) == 1
    differs = [line for line in capsys.readouterr().out.splitlines() if "DIFFERS" in line]
    assert any(caught in line for line in differs), differs


def test_the_law_alone_catches_a_wrong_hinge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right = bending.trace
    monkeypatch.setattr(bending, "trace", lambda *a, **k: right(*a, **{**k, "plasticity": 0.1501}))
    outcome = reproduce("4.14", tmp_path / "out", Effort(quick=True))
    assert [check.what for check in outcome.checks if not check.passed] == [
        "rest curvature: the hinge against the law alone on its path"
    ]


def test_checks_can_fail() -> None:
    assert Check("x", 1.0, 1.1, 0.2, "").passed
    assert not Check("x", 1.0, 1.3, 0.2, "").passed
    assert not Check("x", float("nan"), 1.0, 10.0, "").passed
    assert not Check.true("x", found=False, reason="").passed


@pytest.mark.parametrize("width", [6.0, 17.0])
def test_notes_stay_inside_the_picture(width: float) -> None:
    made = pictures.figure("title", (width, 4.0), "Continuous detection with mmm and www, means over all steps. " * 9)
    made.canvas.draw()
    assert made._supxlabel.get_window_extent().x1 <= made.bbox.x1


def test_tables_carry_their_parameters() -> None:
    text = Table(("a [m]", "b"), [(0.1, "x"), (2, "y")]).text({"c1 [N m2]": -0.5, "chosen": "c1"})
    assert text == "# c1 [N m2]: -0.5\n# chosen: c1\na [m],b\n0.1,x\n2,y\n"
    text = Table(("thesis, 5 s [s]", "b"), [(0.1, 'one, "two"')]).text({})
    assert list(csv.DictReader(text.splitlines())) == [{"thesis, 5 s [s]": "0.1", "b": 'one, "two"'}]


def test_where_one_simulation_fails_the_others_end() -> None:
    done: list[int] = []

    def work(item: int) -> int:
        if item == 1:
            raise InvalidInput("planted")
        for _ in range(10_000):
            time.sleep(0.001)
            bar.update()
        done.append(item)
        return item

    effort = Effort(threads=2)
    with effort.bar(1, "test") as bar, pytest.raises(InvalidInput, match="planted"):
        effort.each(work, [0, 1, 2], bar)
    assert done == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_soon_and_leaves_no_folder(tmp_path: Path, number: signal.Signals) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(cli_command("reproduce", "4.13", "-o", out, "--quiet"), stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not out.exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    time.sleep(1.0)
    process.send_signal(number)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130
    assert error.decode() == "clothsim: interrupted\n"
    assert not out.exists()
