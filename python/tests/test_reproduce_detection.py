"""Figures and tables of chapters 5 and 6: their benchmarks, what is counted on them, faults that must show."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim import collision
from clothsim._cli import main
from clothsim._data import VARIABLE
from clothsim.reproduce import Effort, benchmarks, counting, knots, snapshots
from clothsim.reproduce.benchmarks import Benchmark, Suite
from clothsim.reproduce.snapshots import Shot, Shown

ARRAYS = ("vertex_triangle", "time_vertex_triangle", "edge_edge", "time_edge_edge")
QUICK = Effort(quick=True, threads=2)


# Contacts -----------------------------------------------------------------------------------------------------------


# The first call of an octree has nine levels, seconds on a software adapter: not every knot with every method.
KNOTS = [
    *((knots.reef, method) for method in counting.METHODS),
    *((knots.bowline, method) for method in (counting.GRID, counting.VIRTUAL, counting.OCTREE)),
]


@pytest.mark.parametrize(("make", "method"), KNOTS)
def test_knots_have_the_contacts_of_the_cpu(gpu: str, make: Callable[..., Any], method: str) -> None:
    moving = make(120, steps=1)
    x_t0, x_t1 = moving.steps[0]
    for mode, thickness in (("continuous", 0.0), ("discrete", 2e-4)):
        expected = cs.collision.detect(x_t0, x_t1, moving.triangles, "bvh", mode, thickness)
        found = cs.collision.detect(x_t0, x_t1, moving.triangles, method, mode, thickness, device="gpu")
        assert len(expected.edge_edge) > 100
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert found.stats["device"] == gpu


# Benchmarks ---------------------------------------------------------------------------------------------------------


def small() -> Benchmark:
    moving = knots.bowline(120, steps=2)
    return Benchmark("small", "Bowline knot", benchmarks.GENERATED, moving.triangles, moving.steps)


def test_data_that_are_not_there_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ccd").mkdir()
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    x, f = np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)
    np.savez(tmp_path / "ccd" / "cloth-ball.npz", V0=x, V1=x + 1.0, F=f)
    suite = benchmarks.suite(Effort(), steps=1)
    assert [b.name for b in suite.benchmarks] == [
        "Cloth on ball", "Funnel (generated)", "Skirt (generated)", "Reef knot (generated)", "Bowline (generated)"
    ]  # fmt: skip
    assert suite.note == "left out: N-body, Funnel (no data: CLOTHSIM_DATA names their folder)"
    ball = suite.named("Cloth on ball")
    assert ball is not None
    assert np.array_equal(ball.steps[0][1], x + 1.0)
    assert ball.thickness == pytest.approx(0.1 * np.sqrt(2.0))
    assert suite.named("N-body") is None


@pytest.mark.data
def test_the_published_data_are_found(ccd_data: Path) -> None:
    suite = benchmarks.suite(Effort(), steps=1)
    assert suite.left_out == ()
    assert {b.name: len(b.triangles) for b in suite.benchmarks} == {
        "Cloth on ball": 92_230, "N-body": 146_480, "Funnel": 18_484, "Funnel (generated)": 18_816,
        "Skirt (generated)": 49_696, "Reef knot (generated)": 20_032, "Bowline (generated)": 11_008,
    }  # fmt: skip


def test_the_quick_suite_is_small() -> None:
    suite = benchmarks.suite(QUICK)
    assert all(len(b.triangles) < 10_000 and len(b.steps) == 1 for b in suite.benchmarks)
    assert "N-body" in suite.left_out
    assert set(benchmarks.COLOURS) == {b.name for b in suite.benchmarks} | set(suite.left_out)


# Counting -----------------------------------------------------------------------------------------------------------


def test_counts_are_means_over_steps(gpu: str) -> None:
    benchmark = small()
    counted = counting.count(benchmark, counting.VIRTUAL, QUICK, cell_factor=2.0)
    each = [
        cs.collision.detect(*step, benchmark.triangles, counting.VIRTUAL, device="gpu", cell_factor=2.0)
        for step in benchmark.steps
    ]
    assert counted.tests == np.mean([d.stats["broad_phase_tests"] for d in each])
    assert counted.registrations == np.mean([d.stats["registrations"] for d in each])
    assert counted.contacts == sum(len(d.vertex_triangle) + len(d.edge_edge) for d in each) > 0
    assert counted.bytes == max(d.stats["bytes"] for d in each)
    assert counted.differing == 0
    assert counted.device == gpu
    assert "device" not in counted.seconds
    assert counted.milliseconds == pytest.approx(1e3 * sum(counted.seconds.values()))
    finer = counting.count(benchmark, counting.VIRTUAL, QUICK, cell_factor=1.0)
    assert finer.tests < counted.tests
    assert finer.contacts == counted.contacts


@pytest.mark.parametrize(
    "fault",
    [
        lambda d: replace(d, edge_edge=d.edge_edge[1:], time_edge_edge=d.time_edge_edge[1:]),
        lambda d: replace(d, time_vertex_triangle=np.nextafter(d.time_vertex_triangle, 0.0)),
        lambda d: replace(d, edge_edge=d.edge_edge[:, [1, 0, 2, 3]]),
    ],
)
def test_wrong_contacts_fail_the_figure(
    gpu: str, fault: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any
) -> None:
    right = collision.detect

    def wrong(*arguments: Any, **options: Any) -> Any:
        found = right(*arguments, **options)
        return fault(found) if options.get("device") == "gpu" else found

    monkeypatch.setattr(collision, "detect", wrong)
    assert main(["reproduce", "5.13", "-o", str(tmp_path / "out"), "--quick", "--quiet"]) == 1
    differs = [line for line in capsys.readouterr().out.splitlines() if "DIFFERS" in line]
    assert len(differs) == 1
    assert "steps whose contacts are not those of the CPU 3, expected 0" in differs[0]


def counted(tests: float, contacts: int = 5, differing: int = 0, **seconds: float) -> counting.Counted:
    return counting.Counted(tests, 2.0 * tests, tests, 1e6, contacts, differing, seconds or {"bounds": 1.0}, "a card")


def test_agreement_can_fail() -> None:
    def failed(*counts: counting.Counted) -> int:
        return sum(not check.passed for check in counting.agreement(counts))

    assert failed(counted(1.0), counted(2.0)) == 0
    assert failed(counted(1.0), counted(2.0, differing=1)) == 1
    assert failed(counted(1.0), counted(2.0, contacts=0)) == 1


def test_shares_take_every_stage_once() -> None:
    found = counting.shares(
        {"bounds": 1.0, "sort": 2.0, "gather": 4.0, "unheard of": 3.0}, {"a": ("bounds",), "b": ("sort", "gather")}
    )
    assert found == {"a": 10.0, "b": 60.0, "other": 30.0}


def test_a_software_adapter_is_called_one() -> None:
    words = counting.device_words("llvmpipe (LLVM 15.0.6, 256 bits) (llvmpipe Mesa 22.3.6, vulkan)")
    assert words == "llvmpipe, a software adapter: times are for the record"
    assert counting.device_words("NVIDIA H200 (580.1, vulkan)") == "NVIDIA H200 (580.1, vulkan)"


# Findings of the thesis that must come out, planted the wrong way ---------------------------------------------------


def planted(names: tuple[str, ...] = ("N-body", "Cloth on ball", "Funnel")) -> Suite:
    triangles = np.array([[0, 1, 2]])
    step = (np.eye(3), np.eye(3))
    return Suite(tuple(Benchmark(name, name, "planted", triangles, (step,)) for name in names), (), "")


def failing(checks: Any) -> list[str]:
    return [check.what for check in checks if not check.passed]


def test_figure_5_14_sees_too_few_and_too_many() -> None:
    from clothsim.reproduce import figure_5_14 as figure

    def of(*factors: float) -> list[str]:
        suite = planted()
        counts = {}
        for b, factor in zip(suite.benchmarks, factors, strict=True):
            counts[b.name, counting.GRID], counts[b.name, counting.VIRTUAL] = counted(factor * 1e6), counted(1e6)
        return failing(figure.checks(counting.Compared(suite, counts)))

    assert of(12.0, 9.0, 2.0) == []
    assert of(7.9, 9.0, 9.0) == ["N-body: at least 8 times fewer tests"]
    assert of(12.0, 2.0, 2.0) == ["about an order of magnitude fewer in several benchmarks"]
    assert of(12.0, 9.0, 0.9) == ["fewer tests wherever triangles differ much in size"]


def test_figure_5_12_sees_tests_that_do_not_grow() -> None:
    from clothsim.reproduce import figure_5_12 as figure

    def of(tests: tuple[float, float, float], registrations: tuple[float, float, float]) -> list[str]:
        suite = planted(("Cloth on ball",))
        counts = {
            ("Cloth on ball", factor): replace(counted(t), registrations=r)
            for factor, t, r in zip(figure.QUICK, tests, registrations, strict=True)
        }
        return failing(figure.checks(figure.Measured(suite, figure.QUICK, counts)))

    assert of((3.0, 2.0, 4.0), (3.0, 2.0, 1.0)) == []
    assert len(of((1.0, 2.0, 2.0), (3.0, 2.0, 1.0))) == 1
    assert len(of((1.0, 2.0, 3.0), (2.0, 2.0, 1.0))) == 1


def test_figure_6_10_sees_too_many_tests_of_the_octree() -> None:
    from clothsim.reproduce import figure_6_10 as figure

    def of(virtual: float, single: float, octree: float, *, is_quick: bool = False) -> list[str]:
        suite = replace(planted(("Funnel", "N-body")), is_quick=is_quick)
        tests = {counting.GRID: 9e6, counting.VIRTUAL: virtual, counting.SINGLE: single, counting.OCTREE: octree}
        counts = {("Funnel", method): counted(t) for method, t in tests.items()}
        counts |= {("N-body", method): counted(t) for method, t in zip(tests, (9e6, 5e6, 2e6, 2e6), strict=True)}
        return failing(figure.checks(counting.Compared(suite, counts)))

    assert of(1e6, 7e5, 6.1e5) == []
    assert of(1e6, 7e5, 6.2e5) == ["at least 39 % fewer tests than virtual subdivision, each benchmark"]
    assert of(1e6, 7e5, 6.2e5, is_quick=True) == []
    assert of(1e6, 6e5, 6e5 + 1) == ["two stages never take more tests than one"]


def test_table_6_1_sees_registrations_in_the_wrong_levels() -> None:
    from clothsim.reproduce import table_6_1 as table

    def of(levels: dict[int, float], differing: int = 0) -> list[str]:
        row = np.array([[levels.get(k, 0.0) for k in range(table.LEVELS)]])
        return failing(table.checks(table.Measured(planted(("Funnel",)), {"Funnel": row}, {"Funnel": [8]}, differing)))

    assert of({4: 10.0, 6: 5000.0, 7: 4990.0}) == []
    assert of({2: 51.0, 6: 5000.0, 7: 4949.0}) == [
        "registrations in levels 0 to 2, the largest share of a benchmark [%]"
    ]
    assert of({3: 20.0, 6: 40.0, 8: 40.0}) == ["three neighbouring levels have over 85 % of the registrations"]
    assert len(of({6: 1.0}, differing=2)) == 1


def test_figure_5_16_compares_tests_not_times() -> None:
    from clothsim.reproduce import figure_5_16 as figure
    from clothsim.reproduce.timings import MODES, Times

    def of(factor: float, seconds: float, name: str = "Funnel", **timed: float) -> list[str]:
        stages = {"bounds": 1.0, "sort": 1.0, "gather": 1.0, "workload": 1.0}
        virtual = replace(counted(1e6), seconds=stages)
        grid = replace(counted(factor * 1e6), seconds={**stages, "bounds": seconds, **timed})
        counts = {(name, m, mode): c for m, c in ((counting.GRID, grid), (counting.VIRTUAL, virtual)) for mode in MODES}
        return failing(figure.checks(Times(planted((name,)), 0, counts)))

    fewer = "fewer tests than the uniform grid, DCD and CCD, each benchmark but the knots"
    assert of(12.0, 1.0) == of(12.0, 0.1) == []
    assert of(0.9, 9.0) == [fewer]
    assert of(0.9, 9.0, "Bowline (generated)") == []
    assert of(12.0, 1.0, sort=-1.0) == ["each stage was timed"]


# Snapshots ----------------------------------------------------------------------------------------------------------


def shown(x: Any, triangles: Any, thesis: str, *, contacts: int = 1, passing: int = 0, quick: bool = False) -> Shown:
    benchmark = Benchmark("planted", thesis, benchmarks.GENERATED, np.array(triangles), ((np.array(x), np.array(x)),))
    shot = Shot(benchmark, 0, contacts, 0, passing)
    return Shown(Suite((benchmark,), (), "", quick), (thesis,), (shot,))


def test_snapshots_see_unfit_benchmarks() -> None:
    sheet = cs.Mesh.grid(1.0, 1.0, 101, 101)  # 20,000 triangles of one size
    fit = shown(sheet.vertices, sheet.triangles, "Reef knot")
    assert failing(fit.checks()) == []
    few = shown(sheet.vertices, sheet.triangles[:18_999], "Reef knot")
    assert failing(few.checks()) == ["planted: thousands of triangles"]
    assert failing(replace(few, suite=replace(few.suite, is_quick=True)).checks()) == []
    bad = shown(sheet.vertices, sheet.triangles, "Reef knot", contacts=0, passing=1)
    assert failing(bad.checks()) == [
        "pairs of triangles that intersect at the start of a generated step", "each has contacts in its last step"
    ]  # fmt: skip
    assert shown(sheet.vertices, sheet.triangles, "Funnel").differing_sizes().passed is False
    assert fit.crowded().passed is False


def test_uneven_triangles_are_measured() -> None:
    # Ten of one size far apart, five times; then a tenth place with a hundred of them.
    one = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    far = [one + [20.0 * k, 0.0, 0.0] for k in range(9)] + [one + [200.0, 0.0, 0.0]] * 91
    shot = shown(np.concatenate(far), np.arange(300).reshape(-1, 3), "Funnel").shots[0]
    assert shot.uneven_places == pytest.approx(91.0)
    assert shot.uneven_sizes == pytest.approx(1.0)
    wide = shown(np.concatenate([*far[:4], 5.0 * one]), np.arange(15).reshape(-1, 3), "Funnel").shots[0]
    assert wide.uneven_sizes == pytest.approx(25.0)
    assert wide.edge == pytest.approx(1.0)


def test_pieces_are_the_connected_ones() -> None:
    moving = knots.reef(120, steps=1)
    pieces = snapshots._pieces(moving.triangles, len(moving.steps[0][0]))
    half = len(pieces) // 2
    assert pieces.tolist() == [0] * half + [1] * half
    # One long piece whose numbering runs against its order.
    strip = np.array([[9 - k, 8 - k, 7 - k] for k in (0, 6, 2, 4, 1, 7, 3, 5)])
    assert set(snapshots._pieces(strip, 10)) == {0}


# Files --------------------------------------------------------------------------------------------------------------


def test_the_files_say_what_was_left_out_and_on_what(gpu: str, tmp_path: Path) -> None:
    assert main(["reproduce", "table-5.1", "-o", str(tmp_path), "--quick", "--quiet"]) == 0
    facts = json.loads((tmp_path / "table-5.1.json").read_text())
    assert facts["parameters"]["left out"].startswith("Cloth on ball, N-body, Funnel")
    assert facts["parameters"]["device"] == counting.device_words(gpu)
    assert counting.device_words(gpu) in facts["here"]
    text = (tmp_path / "table-5.1.csv").read_text()
    assert "thesis: CCD [ms]" in text
    stages = (tmp_path / "table-5.1-stages.csv").read_text().splitlines()
    assert sum("triangle pairs" in line for line in stages) == 6
