"""Detection alone: contract of the arguments and of the result."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clothsim as cs


def crumpled(seed: int = 3) -> tuple[Any, Any, Any]:
    """Two frames of a sheet that is thrown about, and its triangles."""
    rng = np.random.default_rng(seed)
    sheet = cs.Mesh.grid(1.0, 1.0, 9, 9)
    x = sheet.vertices * [1.0, 1.0, 0.3]
    return x + rng.normal(0, 0.06, x.shape), x + rng.normal(0, 0.06, x.shape), sheet.triangles


@pytest.mark.parametrize("mode", ["continuous", "discrete"])
@pytest.mark.parametrize("thickness", [0.0, 0.03])
def test_the_tree_finds_what_brute_force_finds(mode: str, thickness: float) -> None:
    x_t0, x_t1, triangles = crumpled()
    tree = cs.collision.detect(x_t0, x_t1, triangles, "bvh", mode, thickness)
    brute = cs.collision.detect(x_t0, x_t1, triangles, "brute", mode, thickness)
    # Two edges in space almost never touch exactly at one moment; everything else has plenty of pairs.
    assert (len(brute.edge_edge) > 10) == (mode == "continuous" or thickness > 0.0)
    for name in ("vertex_triangle", "edge_edge", "time_vertex_triangle", "time_edge_edge"):
        np.testing.assert_array_equal(getattr(tree, name), getattr(brute, name))


def test_shapes_types_and_order() -> None:
    x_t0, x_t1, triangles = crumpled()
    d = cs.collision.detect(x_t0, x_t1, triangles)
    assert d.vertex_triangle.dtype == d.edge_edge.dtype == np.int64
    assert d.vertex_triangle.shape[1] == 2
    assert d.edge_edge.shape[1] == 4
    assert d.time_vertex_triangle.shape == (len(d.vertex_triangle),)
    assert d.time_edge_edge.shape == (len(d.edge_edge),)
    assert sorted(map(tuple, d.vertex_triangle.tolist())) == list(map(tuple, d.vertex_triangle.tolist()))
    assert sorted(map(tuple, d.edge_edge.tolist())) == list(map(tuple, d.edge_edge.tolist()))
    vertices = triangles[d.vertex_triangle[:, 1]]
    assert not (vertices == d.vertex_triangle[:, :1]).any(), "a vertex of its own triangle"
    assert d.stats["candidates_edge_edge"] >= len(d.edge_edge)
    assert d.stats["seconds"]


def test_any_number_of_threads_gives_the_same_bits() -> None:
    x_t0, x_t1, triangles = crumpled()
    one, two = (cs.collision.detect(x_t0, x_t1, triangles, threads=n) for n in (1, 2))
    np.testing.assert_array_equal(one.edge_edge, two.edge_edge)
    np.testing.assert_array_equal(one.time_edge_edge, two.time_edge_edge)
    np.testing.assert_array_equal(one.time_vertex_triangle, two.time_vertex_triangle)


def test_input_is_borrowed_not_changed() -> None:
    x_t0, x_t1, triangles = crumpled()
    for array in (x_t0, x_t1):
        array.flags.writeable = False
    before = x_t0.copy()
    cs.collision.detect(x_t0, x_t1, triangles.astype(np.int32))
    np.testing.assert_array_equal(x_t0, before)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"method": "grid"},
            r'method: expected one that runs on device "cpu" \("brute", "bvh", "session" run on "cpu", '
            r'"grid", "virtual-subdivision", "octree-single", "octree" on "gpu"\), '
            'got "grid"',
        ),
        ({"method": "virtual-subdivision"}, 'that runs on device "cpu"'),
        ({"method": "bvh", "device": "gpu"}, 'that runs on device "gpu"'),
        ({"method": "gird"}, '"octree-single", "octree", "auto", got "gird" .did you mean "grid"'),
        ({"method": "octopus"}, '"auto", got "octopus"$'),
        ({"mode": "swept"}, 'mode: expected one of "continuous", "discrete", got "swept"'),
        ({"thickness": -1e-3}, "thickness: expected a finite length ≥ 0 m, got -0.001"),
        ({"thickness": float("nan")}, "thickness: .*NaN"),
        ({"threads": 0}, "threads: expected a whole number ≥ 1, got 0"),
        ({"device": "tpu"}, 'device: expected one of "cpu", "gpu", "auto", got "tpu"'),
        ({"x_t1": np.zeros((5, 3))}, "x_t1: expected 81 entries, got 5"),
        ({"x_t0": np.zeros((81, 2))}, r"x_t0: expected shape \(n, 3\) and float64, got shape \(81, 2\), float64"),
        ({"x_t1": np.full((81, 3), np.inf)}, "x_t1: expected finite coordinates"),
        ({"triangles": [[0, 1, 81]]}, r"triangles: expected indices in 0\.\.81, got 81 in triangle 0"),
        ({"triangles": [[0.0, 1, 2]]}, "triangles: .*float64"),
        ({"triangles": [[0, 1, 1]]}, "three different vertices, triangle 0"),
    ],
)
def test_bad_arguments(change: dict[str, Any], message: str) -> None:
    x_t0, x_t1, triangles = crumpled()
    with pytest.raises(cs.InvalidInput, match=message):
        cs.collision.detect(**{"x_t0": x_t0, "x_t1": x_t1, "triangles": triangles, **change})


STILL = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


def test_single_queries() -> None:
    through = [[0.2, 1.0, 0.2], *STILL, [0.2, -1.0, 0.2], *STILL]
    beside = [[2.0, 1.0, 2.0], *STILL, [2.0, -1.0, 2.0], *STILL]
    hit, time = cs.collision.vertex_triangle_ccd([through, beside])
    assert hit.tolist() == [True, False]
    assert 0.5 - 1e-6 < time[0] <= 0.5
    assert np.isinf(time[1])
    edges = [[-1, 1, 0], [1, 1, 0], [0, 0, -1], [0, 0, 1], [-1, -1, 0], [1, -1, 0], [0, 0, -1], [0, 0, 1]]
    hit, time = cs.collision.edge_edge_ccd([edges], thickness=0.1)
    assert hit[0]
    assert 0.45 - 1e-3 < time[0] <= 0.45
    assert cs.collision.edge_edge_ccd(np.zeros((0, 8, 3)))[0].shape == (0,)


@pytest.mark.parametrize("ccd", [cs.collision.vertex_triangle_ccd, cs.collision.edge_edge_ccd])
def test_bad_queries(ccd: Any) -> None:
    with pytest.raises(cs.InvalidInput, match=r"queries: expected shape \(n, 8, 3\) and float64, got shape \(8, 3\)"):
        ccd(np.zeros((8, 3)))
    with pytest.raises(cs.InvalidInput, match="queries: expected finite coordinates, got NaN in query 1"):
        ccd(np.stack([np.zeros((8, 3)), np.full((8, 3), np.nan)]))
    with pytest.raises(cs.InvalidInput, match="thickness"):
        ccd(np.zeros((1, 8, 3)), thickness=-1.0)


def test_self_intersections() -> None:
    x = np.array([[0, 0, 0], [2, 0, 0], [0, 0, 2], [0.5, -1, 0.5], [0.5, 1, 0.5], [0.6, 1, 0.5]])
    triangles = [[0, 1, 2], [3, 4, 5]]
    assert cs.collision.self_intersections(x, triangles).tolist() == [[0, 1]]
    apart = x + np.where(np.arange(6)[:, None] > 2, [0, 1.5, 0], 0)
    found = cs.collision.self_intersections(apart, triangles)
    assert found.shape == (0, 2)
    assert found.dtype == np.int64
    flat = cs.Mesh.grid(1.0, 1.0, 9, 9)
    assert len(cs.collision.self_intersections(flat.vertices, flat.triangles)) == 0, "neighbours do not pass through"


@pytest.mark.parametrize("thickness", [None, "x", True])
def test_a_thickness_that_is_no_number_is_named(thickness: Any) -> None:
    x = np.zeros((3, 3))
    with pytest.raises(cs.InvalidInput, match="thickness: expected a finite length"):
        cs.collision.detect(x, x, [[0, 1, 2]], thickness=thickness)


def test_rows_of_unequal_length_are_named() -> None:
    x = np.zeros((3, 3))
    with pytest.raises(cs.InvalidInput, match="triangles: expected shape .*, got rows of unequal length"):
        cs.collision.detect(x, x, [[0, 1], [0, 1, 2]])


def test_more_threads_than_any_machine_has_are_refused() -> None:
    x = np.zeros((3, 3))
    with pytest.raises(cs.InvalidInput, match="threads: expected at most"):
        cs.collision.detect(x, x, [[0, 1, 2]], threads=10**30)
