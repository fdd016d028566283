"""Detection against exact ground truth: nothing missed, nothing outside the lists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from comparison import Difference, compare

import clothsim as cs

pytestmark = pytest.mark.data

SCENES = ["cloth-ball", "cloth-funnel", "n-body-simulation"]

# What Tight-Inclusion gives on these queries (separation 0, tolerance 1e-6).
MOST_FALSE_POSITIVES = {"vf": 78, "ee": 125}


@pytest.mark.parametrize("scene", SCENES)
def test_no_pair_is_missed_and_none_is_outside_the_lists(ccd_data: Path, scene: str) -> None:
    z = np.load(ccd_data / f"{scene}.npz")
    found = cs.collision.detect(z["V0"], z["V1"], z["F"])
    vertex_triangle = compare(found.vertex_triangle, z["vf"], z["vf_true"])
    edge_edge = compare(found.edge_edge, z["ee"], z["ee_true"])
    assert (vertex_triangle.missed, vertex_triangle.outside) == (0, 0), scene
    assert (edge_edge.missed, edge_edge.outside) == (0, 0), scene
    for time in (found.time_vertex_triangle, found.time_edge_edge):
        assert ((time >= 0.0) & (time <= 1.0)).all()


@pytest.mark.parametrize(
    ("kind", "ccd"), [("vf", cs.collision.vertex_triangle_ccd), ("ee", cs.collision.edge_edge_ccd)]
)
def test_single_queries(ccd_data: Path, kind: str, ccd: object) -> None:
    z = np.load(ccd_data / "queries.npz")
    hit, time = ccd(z[kind])  # type: ignore[operator]
    assert hit.shape == time.shape == (len(z[kind]),)
    assert not (z[f"{kind}_true"] & ~hit).any(), "a collision is missed"
    assert (hit & ~z[f"{kind}_true"]).sum() <= MOST_FALSE_POSITIVES[kind]
    assert ((time[hit] >= 0.0) & (time[hit] <= 1.0)).all()
    assert np.isinf(time[~hit]).all()


def test_the_comparison_sees_planted_faults() -> None:
    listed = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]])
    true = np.array([True, True, False])
    swapped = np.array([[2, 3, 1, 0], [6, 7, 4, 5]])
    assert compare(swapped, listed, true) == Difference(0, 0, 0)
    assert compare(swapped[:1], listed, true) == Difference(1, 0, 0), "a missed pair"
    assert compare(listed, listed, true) == Difference(0, 0, 1), "a pair that is listed as apart"
    extra = np.concatenate([swapped, [[0, 1, 6, 7]]])
    assert compare(extra, listed, true) == Difference(0, 1, 1), "a pair in no list"
    with pytest.raises(AssertionError, match="reported twice"):
        compare(np.concatenate([swapped, swapped[:1]]), listed, true)
    assert compare(np.array([[1, 0]]), np.array([[0, 1]]), np.array([True])) == Difference(1, 1, 1), "not a vertex pair"
