"""One run of a study, in a process of its own: ``python -m clothsim.study.worker JOB``.

Its own process gives it cores of its own and a peak of memory of its own, and whatever breaks it breaks it alone.
"""

from __future__ import annotations

import itertools
import json
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.simulation import Simulation
from clothsim.study.axes import variant
from clothsim.study.disturb import disturbed
from clothsim.study.process import serve
from clothsim.study.state import pinned

__all__ = ["LATE", "joined", "pack_scene", "run_job", "unpack_scene"]

# Share of the run after which what sticks is watched.
LATE = 0.75
# A timed run was disturbed if it took this many times its processor time and a reading of the clock [s].
_WAITED, _CLOCK = 1.05, 1e-4
# Pieces in which a run under error control is observed.
_PIECES = 200
# Runs at most, in place of disturbed ones too, over the repeats asked for.
_TRIES = 2


def pack_scene(scene: Scene) -> bytes:
    """What a scene holds besides its tables."""
    meshes, sequences, velocities = scene.assets()
    return pickle.dumps((meshes, sequences, velocities, str(scene.folder) if scene.folder else None))


def unpack_scene(packed: bytes, data: dict[str, Any]) -> Scene:
    """The scene that was packed, by ourselves, with tables of its own."""
    meshes, sequences, velocities, folder = pickle.loads(packed)
    scene = Scene()
    scene._meshes = {name: Mesh(*arrays) for name, arrays in meshes.items()}
    scene._sequences, scene._velocities = sequences, velocities
    scene.folder = Path(folder) if folder else None
    return variant(scene, data)


def run_job(job: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run a job; returns facts for JSON and arrays.

    One run is observed in pieces of whole steps and warms everything up; then the run is timed, at least once and up to
    ``repeats`` times, as long as ``patience`` [s] lasts: in the same pieces, on which the last digit of a step's size
    depends, and cloth in contact on that. Timed runs during which the core was given to something else are repeated.
    """
    data = job["data"]
    duration, dt = float(data["duration"]), data["time"]["dt"]
    if dt == "auto":
        steps = _PIECES
    else:
        steps = max(1, int(np.ceil(duration / float(dt) - 1e-9)))
        data["time"]["dt"] = duration / steps
    scene = unpack_scene(Path(job["scene"]).read_bytes(), data)
    threads, device = job["threads"], job["device"]
    if job["seed"] is not None:
        scene = disturbed(scene, job["seed"], job["disturbance"])
    before = _resident("VmRSS")

    def fresh() -> Simulation:
        return Simulation(scene, threads=threads, device=device)

    simulation = fresh()
    advance = _rounding(duration / steps) if job["precision"] == "f32" else Simulation.advance
    marks = sorted({round(steps * k / 20) for k in range(1, 21)} | {round(LATE * steps)} - {0})
    pieces = [(mark, (mark - done) * (duration / steps)) for done, mark in itertools.pairwise([0, *marks])]
    facts, arrays = _observe(simulation, pieces, data, advance)
    facts["peak_bytes"] = max(0, _resident("VmHWM") - before)
    del simulation
    spent = facts.pop("observed_seconds")
    if job["repeats"] == 0 or spent[0] > 0.5 * job["patience"]:
        return {**facts, **_times([spent], []), "repeatable": True}, arrays
    times: list[tuple[float, float]] = []
    setups, ends, observed = [], [], arrays["x_end"]
    undisturbed = 0
    while undisturbed < job["repeats"] and len(times) < _TRIES * job["repeats"]:
        start = time.perf_counter()
        simulation = fresh()
        setups.append(time.perf_counter() - start)
        wall, cpu = time.perf_counter(), time.process_time()
        for _, seconds in pieces:
            advance(simulation, seconds)
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
        ends.append(simulation.positions)
        # With one thread, time that passed without work is time in which the core was given to something else.
        undisturbed += threads > 1 or times[-1][0] < _WAITED * times[-1][1] + _CLOCK
        if sum(w for w, _ in times) > job["patience"]:
            break
    arrays["x_end"], arrays["v_end"] = ends[-1], simulation.velocities
    repeatable = all(np.array_equal(end, observed) for end in ends)
    return {**facts, **_times(times, setups, single=threads == 1), "repeatable": repeatable}, arrays


def _times(times: list[tuple[float, float]], setups: list[float], *, single: bool = True) -> dict[str, Any]:
    """Wall-clock and processor seconds of runs, those in which the core was taken away left out if others are there."""
    good = [t for t in times if not single or t[0] < _WAITED * t[1] + _CLOCK]
    kept = good or sorted(times)[: max(1, len(times) // _TRIES)]  # all disturbed: those that were least
    return {
        "walls": [w for w, _ in kept], "cpus": [c for _, c in kept], "disturbed": len(times) - len(good),
        "setup_seconds": float(np.median(setups)) if setups else None,
    }  # fmt: skip


def _rounding(dt: float) -> Callable[[Simulation, float], None]:
    """Advance by whole steps; after each the state is rounded to single precision."""

    def advance(simulation: Simulation, seconds: float) -> None:
        for _ in range(round(seconds / dt)):
            simulation.advance(dt)
            simulation._core.round_state()

    return advance


def _observe(
    simulation: Simulation,
    pieces: list[tuple[int, float]],
    data: dict[str, Any],
    advance: Callable[[Simulation, float], None],
) -> tuple[dict[str, Any], Any]:
    cloths = [b for b in simulation.bodies if b.kind == "cloth"]
    colliders = [b for b in simulation.bodies if b.kind == "collider"]
    x, v = simulation.positions, simulation.velocities
    arrays: dict[str, Any] = {
        "x_start": x, "v_start": v, "masses": simulation.masses,
        "triangles": joined(cloths), "collider_triangles": joined(colliders),
        "collider_start": simulation.collider_positions, "pinned": pinned(data, cloths, x),
        "counts": np.array([b.vertex_count for b in cloths]),
    }  # fmt: skip
    energies, times, wall, cpu = [simulation.energy], [0.0], 0.0, 0.0
    for mark, seconds in pieces:
        start, start_cpu = time.perf_counter(), time.process_time()
        advance(simulation, seconds)
        wall += time.perf_counter() - start
        cpu += time.process_time() - start_cpu
        energies.append(simulation.energy)
        times.append(simulation.time)
        if mark == round(LATE * pieces[-1][0]):
            arrays["x_late"], arrays["collider_late"] = simulation.positions, simulation.collider_positions
    arrays.setdefault("x_late", x)
    arrays.setdefault("collider_late", arrays["collider_start"])
    arrays["x_end"], arrays["v_end"] = simulation.positions, simulation.velocities
    arrays["collider_end"] = simulation.collider_positions
    arrays["times"] = np.array(times)
    arrays["energies"] = np.array([[e[k] for k in sorted(e)] for e in energies])
    report = json.loads(simulation._core.summary())  # not `report`: its tables of all steps would count as memory
    totals = {k: n for k, n in report["totals"].items() if isinstance(n, (int, float)) or n is None}
    facts = {
        "totals": totals,
        "energy_kinds": sorted(energies[0]),
        "state_bytes": sum(int(effect["bytes"]) for effect in report["effects"]),
        "vertices": int(arrays["counts"].sum()),
        "triangles": len(arrays["triangles"]),
        "intersections": len(simulation.intersections()),
        "observed_seconds": (wall, cpu),
    }
    return facts, arrays


def joined(bodies: list[Any]) -> Any:
    """Triangles of all bodies, with indices into all their vertices."""
    first, out = 0, [np.zeros((0, 3), dtype=np.int64)]
    for body in bodies:
        out.append(np.asarray(body.triangles) + first)
        first += body.vertex_count
    return np.concatenate(out)


def _resident(what: str) -> int:
    """Resident bytes of this process now (``VmRSS``) or at their peak (``VmHWM``)."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith(what + ":"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


if __name__ == "__main__":
    sys.exit(serve(Path(sys.argv[1]), run_job))
