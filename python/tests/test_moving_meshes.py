"""The generated benchmarks of detection: clear where a step starts, in contact in the last, the same every time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.reproduce import knots, pushed
from clothsim.reproduce.moving import Moving, joined, sheet

# Small ones, and the number of triangles.
SMALL: dict[str, tuple[Callable[[], Moving], int]] = {
    "reef": (lambda: knots.reef(120), 2 * 2 * 16 * 120),
    "bowline": (lambda: knots.bowline(120), 2 * 16 * 120),
    "funnel": (lambda: pushed.funnel(48), 2 * 48 * 48 + 2 * 6 * 32),
    "skirt": (lambda: pushed.skirt(64, 8, 3), 2 * 3 * 64 * 8 + 14 * 2 * 24 * 13),
}
# Of the thesis's benchmarks, thousands (Table 5.1).
FULL: dict[str, tuple[Callable[..., Moving], int]] = {
    "reef": (knots.reef, 20),
    "bowline": (knots.bowline, 11),
    "funnel": (pushed.funnel, 18),
    "skirt": (pushed.skirt, 49),
}


@pytest.mark.parametrize("name", SMALL)
def test_steps_start_clear_and_the_last_one_meets(name: str) -> None:
    make, count = SMALL[name]
    moving = make()
    assert moving.triangles.shape == (count, 3)
    assert len(moving.steps) == 3
    for x_t0, x_t1 in moving.steps:
        assert x_t0.shape == x_t1.shape == (moving.triangles.max() + 1, 3)
        assert np.isfinite(x_t0).all()
        assert np.isfinite(x_t1).all()
        assert len(cs.collision.self_intersections(x_t0, moving.triangles)) == 0
    # Where the last one ends nothing was in the way: what is looked for above is there.
    assert len(cs.collision.self_intersections(moving.steps[-1][1], moving.triangles)) > 10
    *early, last = (cs.collision.detect(*step, moving.triangles) for step in moving.steps)
    assert all(len(d.vertex_triangle) + len(d.edge_edge) == 0 for d in early)
    assert len(last.vertex_triangle) > 0
    assert len(last.edge_edge) > 100
    # They meet on the way, and not as one: times are spread.
    assert np.ptp(last.time_edge_edge) > 0.3


@pytest.mark.parametrize("name", SMALL)
def test_the_same_bits_every_time(name: str) -> None:
    first, again = SMALL[name][0](), SMALL[name][0]()
    assert np.array_equal(first.triangles, again.triangles)
    for a, b in zip(first.steps, again.steps, strict=True):
        assert np.array_equal(a[0], b[0])
        assert np.array_equal(a[1], b[1])


@pytest.mark.parametrize("name", FULL)
def test_full_size_is_that_of_the_thesis(name: str) -> None:
    make, thousands = FULL[name]
    moving = make(steps=1)
    assert abs(len(moving.triangles) / 1000 - thousands) < 1.0
    assert len(cs.collision.self_intersections(moving.steps[0][0], moving.triangles)) == 0
    area = 0.5 * np.linalg.norm(_normals(moving.steps[0][0], moving.triangles), axis=1)
    assert area.min() > 0.0


def _normals(x: Any, triangles: Any) -> Any:
    a, b, c = (x[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def test_a_ribbon_keeps_its_width_and_length() -> None:
    tight, loose = (knots.bowline(200, steps=2).steps[k][0].reshape(201, 17, 3) for k in (1, 0))
    for ribbon in (tight, loose):
        across = np.linalg.norm(np.diff(ribbon, axis=1), axis=2).sum(axis=1)
        assert np.abs(across * 50 - 1.0).max() < 0.02
        along = np.linalg.norm(np.diff(ribbon.mean(axis=1), axis=0), axis=1).sum()
        assert abs(along - 1.0) < 0.02


def test_sizes_scale() -> None:
    for make in (knots.reef, knots.bowline):
        small, large = make(120, steps=1), make(120, steps=1, length=2.0)
        np.testing.assert_allclose(large.steps[0][1], 2.0 * small.steps[0][1], rtol=0, atol=1e-12)
    small, large = pushed.funnel(48, steps=1), pushed.funnel(48, side=3.0, steps=1)
    np.testing.assert_allclose(large.steps[0][0], 3.0 * small.steps[0][0], rtol=0, atol=1e-12)


def test_the_sheet_of_the_funnel_keeps_the_length_of_its_rings() -> None:
    sheet_only = pushed.funnel(300, steps=1).steps[0][0][: 301 * 301]
    flat = np.stack([c.ravel() for c in np.meshgrid(*[np.linspace(-0.5, 0.5, 301)] * 2)], axis=1)
    rho = np.hypot(flat[:, 0], flat[:, 1])
    # A ring about the middle, its points in order.
    band = np.flatnonzero(np.abs(rho - 0.4) < 1.0 / 600)
    phi = np.arctan2(flat[band, 1], flat[band, 0])
    ring = sheet_only[band[np.argsort(phi)]][:, [0, 2]]
    length = np.linalg.norm(np.diff(ring, axis=0, append=ring[:1]), axis=1).sum()
    assert abs(length / (2 * np.pi * 0.4) - 1.0) < 0.06


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: knots.reef(119), "columns: expected a whole number ≥ 120, got 119"),
        (lambda: knots.reef(200.5), "columns: expected a whole number"),  # type: ignore[arg-type]
        (lambda: knots.bowline(200, length=0.0), "length: expected a finite length > 0 m, got 0.0"),
        (lambda: knots.bowline(200, length=float("nan")), "length: expected"),
        (lambda: knots.bowline(200, steps=0), "steps: expected a whole number ≥ 1, got 0"),
        (lambda: pushed.funnel(47), "cells: expected a whole number ≥ 48, got 47"),
        (lambda: pushed.funnel(side=-1.0), "side: expected"),
        (lambda: pushed.funnel(steps=True), "steps: expected"),
        (lambda: pushed.skirt(46), "around: expected a whole number ≥ 48, got 46"),
        (lambda: pushed.skirt(65), "around: expected an even number"),
        (lambda: pushed.skirt(rows=3), "rows: expected"),
        (lambda: pushed.skirt(layers=1), "layers: expected"),
    ],
)
def test_bad_parameters_are_refused(make: Callable[[], Moving], message: str) -> None:
    with pytest.raises(cs.InvalidInput, match=message):
        make()


def test_sheets_are_manifold() -> None:
    for closed in (False, True):
        triangles = sheet(3, 6, closed=closed)
        edges = np.sort(np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
        unique, count = np.unique(edges, axis=0, return_counts=True)
        vertices = 4 * (6 if closed else 7)
        assert triangles.max() + 1 == vertices
        assert vertices - len(unique) + len(triangles) == (0 if closed else 1)
        assert np.bincount(count).tolist()[1:] == [12 if closed else 18, len(unique) - (12 if closed else 18)]
    two = joined([sheet(1, 1), sheet(1, 1)], [4, 4])
    assert two.tolist() == [*sheet(1, 1).tolist(), *(sheet(1, 1) + 4).tolist()]
