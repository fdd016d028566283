"""Detection on a GPU: the contacts of the CPU, and what is said where there is no GPU."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
from typing import Any

import numpy as np
import pytest
from conftest import GPU_METHODS

import clothsim as cs

ARRAYS = ("vertex_triangle", "time_vertex_triangle", "edge_edge", "time_edge_edge")


def soup(seed: int, count: int = 150) -> tuple[Any, Any, Any]:
    """Two frames of loose triangles of very different sizes, and the triangles."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2.0, -0.3, (count, 1, 1))
    x = (rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))).reshape(-1, 3)
    return x, x + rng.normal(0, 0.1, x.shape), np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize("method", [*GPU_METHODS, "auto"])
@pytest.mark.parametrize("mode", ["continuous", "discrete"])
@pytest.mark.parametrize("thickness", [0.0, 0.02])
def test_the_gpu_finds_what_the_cpu_finds(gpu: str, method: str, mode: str, thickness: float) -> None:
    for seed in (1, 2):
        frames = soup(seed)
        found = cs.collision.detect(*frames, method, mode, thickness, device="gpu")
        for oracle in ("bvh", "brute"):
            expected = cs.collision.detect(*frames, oracle, mode, thickness)
            for name in ARRAYS:
                np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert thickness == 0.0 or len(found.vertex_triangle) > 10
        assert found.stats["device"] == gpu
        assert found.stats["method"] == ("virtual-subdivision" if method == "auto" else method)
        assert found.stats["candidates_edge_edge"] >= len(found.edge_edge)
        assert found.stats["broad_phase_tests"] > 0
        assert all(seconds >= 0.0 for seconds in found.stats["seconds"].values())
        assert found.stats["seconds"]["device"] > 0.0


def test_threads_that_call_at_once_all_get_the_contacts(gpu: str) -> None:
    frames = [soup(seed, 60) for seed in range(4)]
    expected = [cs.collision.detect(*f) for f in frames]
    found: dict[int, cs.collision.Detection] = {}

    def work(k: int) -> None:
        found[k] = cs.collision.detect(*frames[k], GPU_METHODS[k], device="gpu", threads=1)

    workers = [threading.Thread(target=work, args=(k,)) for k in range(len(frames))]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for k, contacts in enumerate(expected):
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(found[k], name), getattr(contacts, name))


def test_cell_factor_changes_the_counts_and_not_the_contacts(gpu: str) -> None:
    frames = soup(3, 600)
    expected = cs.collision.detect(*frames)
    tests: list[int] = []
    for cell_factor in (None, 1.2, 1.0, 2.0, 5.0):
        found = cs.collision.detect(*frames, "virtual-subdivision", device="gpu", cell_factor=cell_factor)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        tests.append(found.stats["broad_phase_tests"])
        assert found.stats["registrations"] >= found.stats["parts"] >= len(frames[2])
        assert found.stats["bytes"] > 0
    assert tests[0] == tests[1], "1.2 by default"
    assert len(set(tests[1:])) == len(tests) - 1, tests


@pytest.mark.parametrize("mode", ["continuous", "discrete"])
def test_variants_give_the_contacts_of_the_cpu(gpu: str, mode: str) -> None:
    frames = soup(5, 300)
    expected = cs.collision.detect(*frames, mode=mode, thickness=0.01)
    assert len(expected.edge_edge) > 20
    bytes_of: dict[tuple[str, str | None], set[int]] = {}
    for distribution in (None, "binary-search", "segmented-scan"):
        for method, duplicates in [
            ("grid", None), *(("virtual-subdivision", d) for d in (None, "one-sort", "all")),
        ]:  # fmt: skip
            found = cs.collision.detect(
                *frames, method, mode, 0.01, device="gpu", distribution=distribution, duplicates=duplicates
            )
            for name in ARRAYS:
                np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
            assert found.stats["method"] == method
            bytes_of.setdefault((method, distribution), set()).add(found.stats["bytes"])
    for method in ("grid", "virtual-subdivision"):
        # The scan has memory of its own; without a choice it is the search.
        assert bytes_of[method, None] == bytes_of[method, "binary-search"]
        assert min(bytes_of[method, "segmented-scan"]) > max(bytes_of[method, "binary-search"])
    assert len(bytes_of["virtual-subdivision", "binary-search"]) == 2, "sorts by triangle have memory of their own"


def test_a_mesh_that_stays_on_the_gpu_is_not_taken_for_another(gpu: str) -> None:
    """Calls for one mesh share its upload; calls in between for others, of the same size, get their own."""
    x_t0, x_t1, triangles = soup(4, 60)
    turned = np.roll(triangles, 7, axis=0)
    for faces in (triangles, triangles, turned, triangles, np.flip(triangles, axis=0), turned, turned):
        found = cs.collision.detect(x_t0, x_t1, faces, "grid", thickness=0.05, device="gpu")
        expected = cs.collision.detect(x_t0, x_t1, faces, thickness=0.05)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.parametrize("method", GPU_METHODS)
def test_no_triangles_have_no_contacts(gpu: str, method: str) -> None:
    x = np.zeros((3, 3))
    found = cs.collision.detect(x, x, np.zeros((0, 3), dtype=np.int64), method, device="gpu")
    assert found.vertex_triangle.shape == (0, 2)
    assert found.edge_edge.shape == (0, 4)
    assert found.stats["device"] == gpu


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x_t0": np.full((450, 3), np.nan)}, "x_t0: expected finite coordinates"),
        ({"x_t1": np.zeros((5, 3))}, "x_t1: expected 450 entries, got 5"),
        ({"thickness": -1.0}, "thickness: expected a finite length"),
        ({"method": "virtual-subdivison"}, 'did you mean "virtual-subdivision"'),
        ({"method": "brute"}, 'that runs on device "gpu".*got "brute"'),
        ({"cell_factor": 0.05}, "cell_factor: expected λ from 0.1 to 100, got 0.05"),
        ({"cell_factor": float("nan")}, "cell_factor: expected λ from 0.1 to 100, got NaN"),
        ({"cell_factor": 1.2}, 'cell_factor: expected nothing, as only the method "virtual-subdivision" has it'),
        ({"cell_factor": 1.2, "method": "auto"}, 'got a value for "auto"'),
        ({"cell_factor": "wide"}, "cell_factor: expected λ from 0.1 to 100, got 'wide'"),
        (
            {"distribution": "segmented"},
            '^distribution: expected one of "binary-search", "segmented-scan", got "segmented"',
        ),
        ({"distribution": "segmented-scam"}, 'did you mean "segmented-scan"'),
        ({"duplicates": 3}, 'duplicates: expected one of "one-sort", "all", got "3"'),
        (
            {"distribution": "binary-search", "method": "octree"},
            'only the methods "grid", "virtual-subdivision" have it',
        ),
        ({"distribution": "binary-search", "method": "bvh", "device": "cpu"}, 'got a value for "bvh"'),
        (
            {"duplicates": "all"},
            'duplicates: expected nothing, as only the method "virtual-subdivision" has it.*"grid"',
        ),
        ({"device": "gpus"}, 'device: expected one of "cpu", "gpu", "auto", got "gpus" .did you mean "gpu"'),
    ],
)
def test_bad_arguments_are_refused_before_a_gpu_is_looked_for(change: dict[str, Any], message: str) -> None:
    x_t0, x_t1, triangles = soup(1)
    arguments = {"x_t0": x_t0, "x_t1": x_t1, "triangles": triangles, "method": "grid", "device": "gpu"}
    with pytest.raises(cs.InvalidInput, match=message):
        cs.collision.detect(**(arguments | change))


def test_auto_says_why_it_takes_the_cpu(caplog: pytest.LogCaptureFixture) -> None:
    frames = soup(1)
    expected = cs.collision.detect(*frames)
    with caplog.at_level(logging.INFO, "clothsim.collision"):
        plain = cs.collision.detect(*frames, "bvh", device="auto")
        assert not caplog.records, "a method of the CPU is on its device"
        found = [cs.collision.detect(*frames, method, device="auto") for method in ("grid", "auto")]
    assert plain.stats["device"] == "cpu"
    for d in found:
        np.testing.assert_array_equal(d.edge_edge, expected.edge_edge)
        np.testing.assert_array_equal(d.time_edge_edge, expected.time_edge_edge)
    on_cpu = [d for d in found if d.stats["device"] == "cpu"]
    assert len(caplog.records) == len(on_cpu)
    assert all("on the CPU instead of a GPU" in record.getMessage() for record in caplog.records)
    assert all(d.stats["method"] == "bvh" for d in on_cpu)
    assert cs.collision.detect(*frames, "auto").stats["method"] == "bvh"


@pytest.mark.skipif(sys.platform != "linux", reason="drivers are hidden from the Vulkan loader by its variables")
def test_without_a_driver_the_error_says_what_was_looked_for() -> None:
    code = """
import clothsim as cs
x = [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
for method in ("grid", "auto"):
    try:
        cs.collision.detect(x, x, [[0, 1, 2]], method, device="gpu")
    except cs.GpuUnavailable as error:
        print(error)
print(cs.collision.detect(x, x, [[0, 1, 2]], "grid", device="auto").stats["device"])
"""
    hidden = {"VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | hidden
    )
    grid, auto, device = done.stdout.strip().splitlines()
    assert grid == auto
    assert "device: expected a GPU (a Vulkan, Metal or DX12 adapter" in grid
    assert "found none" in grid
    assert device == "cpu"
