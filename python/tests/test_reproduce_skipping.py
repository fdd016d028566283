"""The figures and tables of Wong 2010 in ``clothsim reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clothsim.reproduce import Effort, reproduce, skipping_figure_4

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
