"""The figures and tables of Wong 2010 in ``clothsim reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.reproduce import Effort, reproduce, skipping_figure_4, skipping_report, skipping_run
from clothsim.reproduce.animations import SETS, Listed
from clothsim.reproduce.skipping_run import ADAPTIVE, EVERY_FRAME, Run

# Figure 4 -----------------------------------------------------------------------------------------------------------


def test_the_probability_integrates_to_the_mean_way() -> None:
    # E[way] = the integral of the probability over all movements; beyond s = 1 no closed form stands, so that the
    # integral up to there is a lower bound, and the rest at most what the probability at s = 1 leaves.
    s = np.linspace(0.0, 1.0, 2001)
    inside = np.array([skipping_figure_4.probability(float(x), 2.0) for x in s])
    upto_one = float(np.sum(0.5 * (inside[1:] + inside[:-1]) * np.diff(s)))
    rest = skipping_figure_4.mean_way() - upto_one
    assert 0.0 < rest < inside[-1] * (np.sqrt(3.0) - 1.0)
    assert skipping_figure_4.mean_way(24) == pytest.approx(skipping_figure_4.mean_way(48), rel=1e-9)


def test_the_example_of_the_paper_in_one_dimension() -> None:
    # Equation (2): (L - l)/2 along an axis.
    class Along:
        def uniform(self, *arguments: Any) -> Any:
            return np.random.default_rng(1).uniform(*arguments)

        def normal(self, size: Any) -> Any:
            return np.tile([1.0, 0.0, 0.0], (size[0], 1))

    ways = skipping_figure_4.free_ways(4.0, 100_000, Along())  # type: ignore[arg-type]
    errors = 5.0 * 3.0 / np.sqrt(12.0 * len(ways))
    assert float(ways.mean()) == pytest.approx(1.5, abs=errors)


@pytest.mark.parametrize(
    ("fault", "caught"),
    [
        (lambda ways: 1.05 * ways, "expected free movement"),
        (lambda ways: np.where(ways > 0.5, ways, 0.97 * ways), "probability"),
    ],
)
def test_a_wrong_simulation_fails_figure_4(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Any, caught: str
) -> None:
    right = skipping_figure_4.free_ways
    monkeypatch.setattr(skipping_figure_4, "free_ways", lambda *a: fault(right(*a)))
    outcome = reproduce("2010-4", tmp_path / "out", Effort(quick=True))
    assert outcome.line.startswith("the paper: ")
    assert any(check.what.startswith(caught) for check in outcome.checks if not check.passed)


# Sessions ----------------------------------------------------------------------------------------------------------

FRAMES = 20
LISTED = [(experiment, listed) for experiment, group in SETS.items() for listed in group]
SWD = {**ADAPTIVE, **skipping_run.fixed((3, 4), (15, 16))}


def run(experiment: str, listed: Listed, variants: Any, **options: Any) -> Run:
    with Effort().bar(FRAMES, "test") as bar:
        return skipping_run.run(experiment, listed, variants, FRAMES, bar, quick=True, **options)


@pytest.mark.parametrize("self_collision", [True, False])
@pytest.mark.parametrize(("experiment", "listed"), LISTED, ids=[f"{e}-{item.number}" for e, item in LISTED])
def test_every_frame_is_that_of_bvh(experiment: str, listed: Listed, self_collision: bool) -> None:
    made = run(experiment, listed, SWD, self_collision=self_collision)
    assert (made.compared, made.wrong, made.different) == (FRAMES, 0, 0)
    for series in made.series.values():
        assert series.skipped > 0.5
        assert series.sum("colliding") > 0


def test_counts_are_the_same_each_time() -> None:
    one, two = (run("one", SETS["one"][0], {**EVERY_FRAME, **ADAPTIVE}) for _ in range(2))
    for name, series in one.series.items():
        assert series.counts == two.series[name].counts
        assert series.kinds == two.series[name].kinds


@pytest.mark.parametrize(
    ("fault", "caught"),
    [
        (lambda d: cs.collision.Detection(d.vertex_triangle[1:], d.time_vertex_triangle[1:], d.edge_edge,
                                          d.time_edge_edge, d.stats), "frames that differ from bvh"),
        (lambda d: cs.collision.Detection(d.vertex_triangle, np.nextafter(d.time_vertex_triangle, 1.0), d.edge_edge,
                                          d.time_edge_edge, d.stats), "frames that differ from bvh"),
        (lambda d: cs.collision.Detection(d.vertex_triangle, d.time_vertex_triangle, d.edge_edge, d.time_edge_edge,
                                          {**d.stats, "pair_bytes": 49 * d.stats["pending"]}), "a stored pair takes"),
        (lambda d: cs.collision.Detection(d.vertex_triangle, d.time_vertex_triangle, d.edge_edge, d.time_edge_edge,
                                          {**d.stats, "admissible": d.stats["pending"] + 1}), "colliding ≤ admissible"),
    ],
    ids=["lost", "late", "memory", "count"],
)  # fmt: skip
def test_a_wrong_session_is_reported(monkeypatch: pytest.MonkeyPatch, fault: Any, caught: str) -> None:
    right = cs.collision.SkippingSession.detect
    monkeypatch.setattr(cs.collision.SkippingSession, "detect", lambda *a, **k: fault(right(*a, **k)))
    made = run("one", SETS["one"][2], ADAPTIVE)
    failed = [check.what for check in skipping_report.checks([made]) if not check.passed]
    assert len(failed) == 1
    assert failed[0].startswith(caught)


def test_sessions_that_differ_among_each_other_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    right = cs.collision.SkippingSession.detect

    def detect(session: Any, *arguments: Any) -> Any:
        d = right(session, *arguments)
        if d.stats["frame"] != "skipping":
            return d
        return cs.collision.Detection(d.vertex_triangle, d.time_vertex_triangle, d.edge_edge[:-1],
                                      d.time_edge_edge[:-1], d.stats)  # fmt: skip

    monkeypatch.setattr(cs.collision.SkippingSession, "detect", detect)
    made = run("one", SETS["one"][2], {"NoDup": EVERY_FRAME["NoDup"], **ADAPTIVE})
    assert made.wrong == 0
    assert made.different > FRAMES // 2
