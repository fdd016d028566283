"""Detection beside IPC Toolkit on the published frame pairs, and intersections also on sheets, in one run.

Usage: ``python benches/compare_ipctk.py [--repeats N] [--scenes NAME ...] [--detect] [--json FILE]``. Needs
``clothsim``, ``numpy`` and ``ipctk==1.6.1`` in one environment (``make compare``) and the data at ``$CLOTHSIM_DATA``
or ``../shared/data``.

What is timed, per scene, medians over the repeats, rounds interleaved so that all see the same machine:

* ours: ``clothsim.collision.detect`` as a user calls it (checks, topology, tree, detection, arrays), 1 and 2 threads:
  every colliding pair with its time. ``self_intersections`` likewise: every pair.
* IPC Toolkit, 1 and 2 threads: ``Candidates.build`` with ``LBVH``, then ``compute_collision_free_stepsize`` with
  ``AdditiveCCD``: the earliest impact only, each search cut off at the earliest impact so far.
* IPC Toolkit, 1 and 2 threads: the same build, then additive CCD of every candidate to its own end. Its Python face has
  no call for that, but the one above does it for candidates without an impact, of which nothing is cut off. So these,
  sorted out beforehand and untimed, are searched in one call, and those with an impact in one call each. What the many
  calls cost is in the time; it is listed beside, so that either may be left out.
* IPC Toolkit ``has_intersections``, 1 and 2 threads: whether there is any.

What is short is called in a row until 0.3 s have passed, ours as theirs, and the median counts: one call would mostly
show how cold the machine is after the seconds of the call before. A round before the first is not counted.

The sheets (92,450 triangles: flat, curved, crumpled) do not intersect; only intersections are timed on them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import ipctk
import numpy as np

import clothsim as cs

SHEETS = ("flat", "curved", "crumpled")
SCENES = ("cloth-ball", "cloth-funnel", "n-body-simulation")
GROUP = 32  # candidates that are searched together to find those with an impact
ROW = 0.3  # s of calls in a row


def data_folder() -> Path:
    """Return the folder of the frame pairs."""
    root = os.environ.get("CLOTHSIM_DATA")
    folder = Path(root) if root else Path(__file__).resolve().parents[2] / "shared" / "data"
    for candidate in (folder / "ccd", folder):
        if (candidate / "cloth-ball.npz").exists():
            return candidate
    sys.exit(f"no cloth-ball.npz under {folder}; set CLOTHSIM_DATA")


def seconds(work: Callable[[], object]) -> float:
    """Time calls in a row: their median."""
    times: list[float] = []
    while sum(times) < ROW:
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def sheet(shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and triangles of a 1 m sheet without intersections."""
    n = 216
    v, u = (axis.ravel() for axis in np.meshgrid(*[np.linspace(0.0, 1.0, n)] * 2, indexing="ij"))
    height = {
        "flat": 0.0 * u,
        "curved": 0.2 * np.sin(7 * u) * np.cos(5 * v),
        "crumpled": 0.03 * np.sin(60 * u + 20 * v)
        + 0.02 * np.cos(47 * v - 31 * u)
        + 0.01 * np.sin(150 * u) * np.cos(130 * v),
    }[shape]
    index = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = (corner.ravel() for corner in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    triangles = np.stack([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)], axis=1).reshape(-1, 3)
    return np.stack([u, height, v], axis=1), triangles


def measure_intersections(
    x: np.ndarray, triangles: np.ndarray, mesh: ipctk.CollisionMesh, threads: int, note: Callable[[str, float], None]
) -> None:
    """Time both libraries' intersections once."""
    note(
        f"self_intersections, {threads}",
        seconds(lambda: cs.collision.self_intersections(x, triangles, threads=threads)),
    )
    columns = np.asfortranarray(x)
    ipctk.set_num_threads(threads)
    note(f"ipctk has_intersections, {threads}", seconds(lambda: ipctk.has_intersections(mesh, columns)))


def measure(scene: str, repeats: int, *, detect_only: bool) -> dict[str, list[float]]:
    """Time everything, or only ``detect``, on one scene."""
    if scene in SHEETS:
        x0, triangles = sheet(scene)
        x1 = None
    else:
        z = np.load(data_folder() / f"{scene}.npz")
        x0, x1, triangles = z["V0"], z["V1"], z["F"]
    mesh = ipctk.CollisionMesh(x0, ipctk.edges(triangles), triangles)
    times: dict[str, list[float]] = {}
    parts = None

    def note(name: str, value: float) -> None:
        times.setdefault(name, []).append(value)

    for of_round in range(repeats + 1):
        if of_round == 1:
            times.clear()
        for threads in (1, 2):
            if not detect_only:
                measure_intersections(x0, triangles, mesh, threads, note)
            if x1 is None:
                continue
            note(f"detect, {threads}", seconds(partial(cs.collision.detect, x0, x1, triangles, threads=threads)))
            if detect_only:
                continue
            ends = np.asfortranarray(x0), np.asfortranarray(x1)
            candidates = ipctk.Candidates()
            build = seconds(partial(candidates.build, mesh, *ends, 0.0, ipctk.LBVH()))
            search = seconds(partial(candidates.compute_collision_free_stepsize, mesh, *ends, 0.0, ipctk.AdditiveCCD()))
            note(f"ipctk LBVH, {threads}", build)
            note(f"ipctk earliest impact, {threads}", search)
            note(f"ipctk LBVH + earliest impact, {threads}", build + search)
            parts = parts or split(candidates, mesh, ends)
            in_one_call, one_by_one = search_all(*parts, mesh, ends)
            note(f"ipctk all without an impact, {threads}", in_one_call)
            note(f"ipctk all with an impact, {threads}", one_by_one)
            note(f"ipctk LBVH + all candidates, {threads}", build + in_one_call + one_by_one)
    return times


def split(
    candidates: ipctk.Candidates, mesh: ipctk.CollisionMesh, ends: tuple[np.ndarray, np.ndarray]
) -> tuple[ipctk.Candidates, list[ipctk.Candidates]]:
    """Return the candidates without an impact, and each one with an impact by itself."""
    free, hits, tried = ipctk.Candidates(), [], ipctk.Candidates()
    for kind in ("fv_candidates", "ee_candidates"):

        def has_impact(part: list[object], kind: str = kind) -> bool:
            setattr(tried, kind, part)
            return bool(tried.compute_collision_free_stepsize(mesh, *ends, 0.0, ipctk.AdditiveCCD()) < 1.0)

        listed, without = getattr(candidates, kind), []
        for first in range(0, len(listed), GROUP):
            group = listed[first : first + GROUP]
            if not has_impact(group):
                without += group
                continue
            for candidate in group:
                if has_impact([candidate]):
                    hits.append(ipctk.Candidates())
                    setattr(hits[-1], kind, [candidate])
                else:
                    without.append(candidate)
        setattr(tried, kind, [])
        setattr(free, kind, without)
    return free, hits


def search_all(
    free: ipctk.Candidates, hits: list[ipctk.Candidates], mesh: ipctk.CollisionMesh, ends: tuple[np.ndarray, np.ndarray]
) -> tuple[float, float]:
    """Time additive CCD of all candidates: those without an impact, and those with one."""
    arguments = (mesh, *ends, 0.0, ipctk.AdditiveCCD())
    in_one_call = seconds(partial(free.compute_collision_free_stepsize, *arguments))
    if free.compute_collision_free_stepsize(*arguments) < 1.0:
        sys.exit("ipctk: a candidate that was sorted out as one without an impact has one")
    return in_one_call, seconds(lambda: [hit.compute_collision_free_stepsize(*arguments) for hit in hits])


def processor() -> str:
    """Name the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default 5)")
    both = SCENES + SHEETS
    parser.add_argument(
        "--scenes", nargs="*", default=["cloth-ball", *SHEETS], choices=both, metavar="NAME", help="frame pairs, sheets"
    )
    parser.add_argument("--detect", action="store_true", help="only detect, without IPC Toolkit beside it")
    parser.add_argument("--json", type=Path, help="also write all times [s] to this file")
    options = parser.parse_args()

    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "?"
    machine = f"{processor()}, {os.cpu_count()} cores, load {load} at the start"
    versions = f"clothsim {cs.__version__}, ipctk {ipctk.__version__}, numpy {np.__version__}"
    versions += f", python {platform.python_version()}"
    print(f"{machine}\n{versions}\n{options.repeats} rounds, milliseconds\n")
    report: dict[str, object] = {"machine": machine, "versions": versions, "scenes": {}}
    pairs = [
        ("ipctk LBVH + all candidates, 1", "detect, 1"),
        ("ipctk LBVH + earliest impact, 1", "detect, 1"),
        ("ipctk LBVH + earliest impact, 2", "detect, 2"),
        ("ipctk has_intersections, 1", "self_intersections, 1"),
        ("ipctk has_intersections, 2", "self_intersections, 2"),
    ]
    for scene in options.scenes:
        times = measure(scene, options.repeats, detect_only=options.detect)
        report["scenes"][scene] = times  # type: ignore[index]
        print(f"{scene:<38}{'median':>9}{'least':>9}{'most':>9}")
        for name, values in times.items():
            print(f"  {name:<36}{statistics.median(values) * 1e3:9.1f}{min(values) * 1e3:9.1f}{max(values) * 1e3:9.1f}")
        for theirs, ours in pairs:
            if ours not in times or theirs not in times:
                continue
            ratio, of_least = (of(times[theirs]) / of(times[ours]) for of in (statistics.median, min))
            print(f"  {theirs} / {ours}: {ratio:.1f}, of the least {of_least:.1f}")
        print()
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
