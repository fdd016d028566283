"""Detection on the GPU beside public peers, on the published frame pairs, in one run.

Usage: ``python benches/compare_gpu.py [--repeats N] [--scenes NAME ...] [--methods NAME ...] [--json FILE]``. Needs
``clothsim`` and ``numpy``, and the data at ``$CLOTHSIM_DATA`` or ``../shared/data``. Peers are used where they are
installed: ``ipctk``, on the processor, and ``warp`` (``warp-lang``), on CUDA, or with ``--warp-on-cpu`` on the
processor; what is absent is said.

What is timed, per scene, medians over the repeats, rounds interleaved so that all see the same machine:

* ours: ``clothsim.collision.detect`` as a user calls it (checks, topology, upload, detection, arrays): every colliding
  pair with its time. ``bvh`` on the processor, the other methods on the adapter that the system gives.
* IPC Toolkit: ``Candidates.build`` with each broad phase that the installed version has: candidates, none decided.
* Warp: boxes of the triangles over the step, ``wp.Bvh`` built and queried: pairs of triangles whose boxes overlap,
  without neighbours that share a vertex; no features, none decided. ``wp.HashGrid`` knows points only: no row.

Peers do less than the first rows: their times are bounds from below for what they would take to do the same.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

SCENES = ("cloth-ball", "cloth-funnel", "n-body-simulation")
METHODS = ("grid", "virtual-subdivision", "octree-single", "octree")
BROAD_PHASES = ("BruteForce", "HashGrid", "SpatialHash", "SweepAndPrune", "BVH", "LBVH")
"""Of IPC Toolkit; the first only on small scenes."""
SMALL = 2_000


def present(name: str) -> ModuleType | None:
    """Import a module; None, with a line that says so, if it is absent."""
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"absent: {name}")
        return None


def data_folder() -> Path:
    """Return the folder of the frame pairs."""
    root = os.environ.get("CLOTHSIM_DATA")
    folder = Path(root) if root else Path(__file__).resolve().parents[2] / "shared" / "data"
    for candidate in (folder / "ccd", folder):
        if (candidate / "cloth-ball.npz").exists():
            return candidate
    sys.exit(f"no cloth-ball.npz under {folder}; set CLOTHSIM_DATA")


Note = Callable[[str, float, str], None]


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return seconds and result of one call."""
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def ours(cs: ModuleType, frames: dict[str, Any], methods: list[str], refused: set[str], note: Note) -> None:
    """Time each method once; one that is refused is not asked again."""
    x0, x1, triangles = frames["V0"], frames["V1"], frames["F"]
    for method, device in [("bvh", "cpu"), *((name, "gpu") for name in methods)]:
        if method in refused:
            continue
        try:
            seconds, found = timed(partial(cs.collision.detect, x0, x1, triangles, method=method, device=device))
        except (ValueError, RuntimeError) as error:
            refused.add(method)
            print(f"absent: clothsim {method} on {device}: {error}")
            continue
        contacts = len(found.vertex_triangle) + len(found.edge_edge)
        result = f"{contacts} contacts, {found.stats['broad_phase_tests']} tests, {found.stats['device']}"
        note(f"clothsim {method}, {device}", seconds, result)


def ipc_toolkit(ipctk: ModuleType, frames: dict[str, Any], note: Note) -> None:
    """Time each broad phase once."""
    x0, x1, triangles = frames["V0"], frames["V1"], frames["F"]
    mesh = ipctk.CollisionMesh(x0, ipctk.edges(triangles), triangles)
    ends = np.asfortranarray(x0), np.asfortranarray(x1)
    for name in BROAD_PHASES:
        if not hasattr(ipctk, name) or (name == "BruteForce" and len(triangles) > SMALL):
            continue
        candidates = ipctk.Candidates()
        seconds, _ = timed(partial(candidates.build, mesh, *ends, 0.0, getattr(ipctk, name)()))
        count = len(candidates.fv_candidates) + len(candidates.ee_candidates)
        note(f"ipctk {name}, cpu", seconds, f"{count} candidates")


def warp_kernel(wp: ModuleType) -> Any:
    """Return the kernel that counts pairs of triangles whose boxes overlap."""

    # Warp reads the types when it compiles, so they are given here and not in the signature as text.
    def count_pairs(bvh, low, high, corners, total) -> None:  # type: ignore[no-untyped-def]
        t = wp.tid()
        query = wp.bvh_query_aabb(bvh, low[t], high[t])
        other = wp.int32(0)
        found = wp.int32(0)
        while wp.bvh_query_next(query, other):
            if other > t:
                shared = wp.int32(0)
                for i in range(3):
                    for j in range(3):
                        if corners[t, i] == corners[other, j]:
                            shared = wp.int32(1)
                if shared == 0:
                    found += 1
        wp.atomic_add(total, 0, found)

    count_pairs.__annotations__ = {
        "bvh": wp.uint64,
        "low": wp.array(dtype=wp.vec3),
        "high": wp.array(dtype=wp.vec3),
        "corners": wp.array2d(dtype=wp.int32),
        "total": wp.array(dtype=wp.int32),
    }
    return wp.Kernel(count_pairs)


def warp_pairs(wp: ModuleType, kernel: Any, device: str, frames: dict[str, Any], note: Note) -> None:
    """Time Warp's tree once: boxes on the host, then upload, build and query."""
    triangles = np.ascontiguousarray(frames["F"], dtype=np.int32)
    both = np.stack([frames["V0"][triangles], frames["V1"][triangles]]).astype(np.float32)
    boxes = both.min(axis=(0, 2)), both.max(axis=(0, 2))

    def run() -> int:
        low, high = (wp.array(side, dtype=wp.vec3, device=device) for side in boxes)
        corners = wp.array(triangles, dtype=wp.int32, device=device)
        total = wp.zeros(1, dtype=wp.int32, device=device)
        tree = wp.Bvh(low, high)
        wp.launch(kernel, dim=len(triangles), inputs=[tree.id, low, high, corners, total], device=device)
        return int(total.numpy()[0])

    seconds, pairs = timed(run)
    note(f"warp Bvh, {device}", seconds, f"{pairs} triangle pairs")


def main() -> None:
    """Measure and print one table per scene."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="rounds after one that is not counted (default 3)")
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=SCENES, metavar="NAME", help="frame pairs")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), metavar="NAME", help="of clothsim on the GPU")
    parser.add_argument("--warp-on-cpu", action="store_true", help="run Warp on the processor where there is no CUDA")
    parser.add_argument("--json", type=Path, help="also write all times [s] to this file")
    options = parser.parse_args()

    cs, ipctk, wp = present("clothsim"), present("ipctk"), present("warp")
    warp_device, kernel = "", None
    if wp is not None:
        wp.config.quiet = True
        wp.init()
        warp_device = "cuda:0" if wp.is_cuda_available() else "cpu" if options.warp_on_cpu else ""
        kernel = warp_kernel(wp)
        if not warp_device:
            print("absent: a CUDA device for warp")
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, python {platform.python_version()}")
    print(f"{options.repeats} rounds, milliseconds\n")
    report: dict[str, dict[str, list[float]]] = {}
    refused: set[str] = set()
    folder = data_folder()
    for scene in options.scenes:
        with np.load(folder / f"{scene}.npz") as archive:
            frames = {name: archive[name] for name in ("V0", "V1", "F")}
        times: dict[str, list[float]] = {}
        results: dict[str, str] = {}

        def note(
            name: str,
            seconds: float,
            result: str,
            times: dict[str, list[float]] = times,
            results: dict[str, str] = results,
        ) -> None:
            times.setdefault(name, []).append(seconds)
            results[name] = result

        for _ in range(options.repeats + 1):
            if cs is not None:
                ours(cs, frames, options.methods, refused, note)
            if ipctk is not None:
                ipc_toolkit(ipctk, frames, note)
            if wp is not None and warp_device:
                warp_pairs(wp, kernel, warp_device, frames, note)
        # The first round compiles kernels and fills caches.
        report[scene] = {name: values[1:] or values for name, values in times.items()}
        print(f"{scene}, {len(frames['F'])} triangles")
        for name, values in report[scene].items():
            print(f"  {name:<36}{statistics.median(values) * 1e3:10.1f}   {results[name]}")
        print()
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
