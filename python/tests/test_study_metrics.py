"""What studies measure: surfaces, distances, drifts, contact, disturbances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.study import surface
from clothsim.study.disturb import field
from clothsim.study.metrics import METRICS
from clothsim.study.state import State

# Surfaces and metrics -------------------------------------------------------------------------------------------


def test_nearest_points_against_samples_of_every_triangle() -> None:
    chance = np.random.default_rng(3)
    vertices = chance.normal(size=(30, 3))
    triangles = np.array([chance.choice(30, 3, replace=False) for _ in range(40)])
    points = 2.0 * chance.normal(size=(50, 3))
    distance, places = surface.nearest(points, vertices, triangles)
    assert (places[1] >= -1e-12).all() and np.allclose(places[1].sum(axis=1), 1.0)
    np.testing.assert_allclose(np.linalg.norm(surface.sample(places, vertices, triangles) - points, axis=1), distance)
    w = np.array([(a, b, 60 - a - b) for a in range(61) for b in range(61 - a)]) / 60.0
    dense = np.einsum("wc,tcx->twx", w, vertices[triangles]).reshape(-1, 3)
    for p, d in zip(points, distance, strict=True):
        least = float(np.sqrt(((dense - p) ** 2).sum(axis=1).min()))
        assert d <= least + 1e-12 and least - d < 0.06


def test_areas_in_the_plane() -> None:
    square = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    assert surface.hull_area(square) == pytest.approx(1.0)
    twice = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 3]])
    assert surface.shadow_area(square, twice) == pytest.approx(1.0, abs=2e-3)
    assert surface.shadow_area(square, twice[:1]) == pytest.approx(0.5, abs=2e-3)


def sheet(n: int, **changes: Any) -> State:
    mesh = cs.Mesh.grid(1.0, 1.0, n, n)
    x = np.asarray(mesh.vertices)
    count = len(x)
    none = np.zeros((0, 3))
    data = {"up": "y", "duration": 1.0, "cloth": [{}], "gravity": [0.0, -10.0, 0.0]}
    kinds = ["bending", "gravity", "kinetic", "total"]
    values: dict[str, Any] = {
        "x_start": x, "x_late": x, "x_end": x, "v_start": np.zeros_like(x), "v_end": np.zeros_like(x),
        "triangles": np.asarray(mesh.triangles), "counts": np.array([count]), "masses": np.full(count, 1.0 / count),
        "pinned": np.zeros(count, dtype=bool), "collider_start": none, "collider_late": none, "collider_end": none,
        "collider_triangles": np.zeros((0, 3), dtype=np.int64), "times": np.array([0.0, 1.0]),
        "energies": np.array([[0.0, 5.0, 0.0, 5.0], [1.0, 1.0, 2.0, 4.0]]), "facts": {"energy_kinds": kinds},
        "data": data,
    }  # fmt: skip
    return State(**{**values, **changes})


def wave(x: Any, amplitude: float) -> Any:
    return x + amplitude * np.sin(2.0 * np.pi * x[:, :1]) * [0.0, 1.0, 0.0]


def test_distances_across_resolutions_are_those_of_the_coarser_surface() -> None:
    fine, same, coarse = (sheet(n, x_end=wave(sheet(n).x_start, 0.1)) for n in (33, 33, 9))
    assert METRICS["rms"].measure(same, fine) == 0.0
    # What is left are the chords of a sine over cells of 1/8.
    x, nodes = fine.x_start[:, 0], np.linspace(-0.5, 0.5, 9)
    chords = np.interp(x, nodes, 0.1 * np.sin(2.0 * np.pi * nodes)) - 0.1 * np.sin(2.0 * np.pi * x)
    assert METRICS["max"].measure(coarse, fine) == pytest.approx(np.abs(chords).max(), rel=1e-9)
    assert METRICS["rms"].measure(coarse, fine) == pytest.approx(np.sqrt((chords**2).mean()), rel=1e-9)
    assert METRICS["max"].measure(sheet(9, x_end=wave(coarse.x_start, 0.2)), fine) == pytest.approx(0.1, rel=0.1)


def test_shape_ignores_sliding_along_the_surface_and_nothing_else() -> None:
    flat = sheet(17)
    middle = np.abs(flat.x_start[:, [0, 2]]).max(axis=1, keepdims=True) < 0.45
    slid = sheet(17, x_end=flat.x_start + middle * [0.02, 0.0, 0.01])
    assert (METRICS["rms"].measure(slid, flat) or 0.0) > 0.01
    assert METRICS["shape"].measure(slid, flat) == pytest.approx(0.0, abs=1e-12)
    lifted = sheet(17, x_end=flat.x_start + [0.0, 0.02, 0.0])
    assert METRICS["shape"].measure(lifted, flat) == pytest.approx(0.02)


def test_drifts() -> None:
    start = sheet(5)
    assert METRICS["energy_drift"].measure(start) == pytest.approx(1.0 / 4.0)
    fell = sheet(5, v_end=np.tile([0.0, -10.0, 0.0], (25, 1)))
    assert METRICS["momentum_drift"].measure(fell) == pytest.approx(0.0, abs=1e-12)
    assert METRICS["momentum_drift"].measure(start) is not None, "0 over 0 is no error"
    pushed = sheet(5, v_end=np.tile([1.0, -10.0, 0.0], (25, 1)))
    assert METRICS["momentum_drift"].measure(pushed) == pytest.approx(1.0 / np.sqrt(101.0))
    turning = sheet(5, v_end=np.cross([0.0, 1.0, 0.0], start.x_start))
    assert METRICS["spin_drift"].measure(turning) == pytest.approx(1.0)
    assert METRICS["spin_drift"].measure(sheet(5, pinned=np.arange(25) == 0)) is None


def test_quantities_at_the_end() -> None:
    """Energies of the last moment, of deformation without motion and height; the height goes along the scene's up."""
    x = sheet(5).x_start
    ended = sheet(5, x_end=x - [0.0, 0.3, 0.7])
    assert METRICS["strain_energy"].measure(ended) == 1.0 and METRICS["kinetic_energy"].measure(ended) == 2.0
    assert METRICS["lowest"].measure(ended) == pytest.approx(-0.3)
    assert METRICS["lowest"].measure(sheet(5, x_end=ended.x_end, data={"up": "z"})) == pytest.approx(-0.5 - 0.7)


def test_contact_stick_and_drape_metrics() -> None:
    data = {"up": "y", "cloth": [{}], "contact": {"thickness": 0.01}}
    table = {
        "collider_end": np.array([[-9.0, 0, -9], [9, 0, -9], [0, 0, 9]]), "collider_triangles": np.array([[0, 1, 2]]),
        "data": data,
    }  # fmt: skip
    table["collider_start"] = table["collider_late"] = table["collider_end"]
    x = sheet(5).x_start + [0.0, 0.008, 0.0]
    low = sheet(5, x_end=x, x_late=x - [0.001, 0.0, 0.0], **table)
    assert METRICS["contact_error"].measure(low) == pytest.approx(0.002)
    assert METRICS["stick_drift"].measure(low) == pytest.approx(0.004)
    assert METRICS["contact_error"].measure(sheet(5)) is None
    assert METRICS["drape"].measure(sheet(5)) == pytest.approx(1.0, abs=2e-3)
    folded = sheet(5, x_end=np.abs(sheet(5).x_start))
    assert METRICS["drape"].measure(folded) == pytest.approx(0.25, abs=2e-3)


def test_disturbances_are_the_same_field_on_every_mesh() -> None:
    coarse, fine = (np.asarray(cs.Mesh.grid(1.0, 1.0, n, n).vertices) for n in (5, 9))
    same = [np.flatnonzero((np.abs(fine - p) < 1e-12).all(axis=1))[0] for p in coarse]
    np.testing.assert_allclose(field(fine, 7, 0.1)[same], field(coarse, 7, 0.1), atol=1e-12)
    assert np.abs(field(coarse, 8, 0.1) - field(coarse, 7, 0.1)).max() > 0.01
    assert np.sqrt((field(fine, 7, 0.1) ** 2).mean()) == pytest.approx(0.1, rel=0.5)
