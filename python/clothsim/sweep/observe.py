"""What is kept of a run: numbers of its end, and series over its frames."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from clothsim._run.job import Finished
from clothsim.scene import Scene
from clothsim.simulation import Simulation
from clothsim.study.metrics import METRICS
from clothsim.study.state import State, pinned
from clothsim.study.worker import LATE, joined

__all__ = ["COUNTS", "observe"]

# Totals of a run that do not depend on the machine.
COUNTS = ("steps", "substeps", "retries", "not_converged", "linear_iterations")


def observe(done: Finished, scene: Scene, metrics: Sequence[str], series: Sequence[str]) -> dict[str, Any]:
    """Facts of a run for JSON: the same for every number of threads, and however often it was killed.

    Parameters
    ----------
    done : Finished
        The run.
    scene : Scene
        Its scene.
    metrics : sequence of str
        Of the state at the end; None where the scene has no such number, or the run has not come to its end.
    series : sequence of str
        What to keep of every frame.
    """
    totals = json.loads(done.simulation._core.summary())["totals"]
    crossings = [f["intersections"] for f in done.facts if f["intersections"] is not None]
    cloth = done.recording.cloth
    out: dict[str, Any] = {
        "simulated_seconds": done.simulation.time, "frames": len(done.facts),
        "vertices": sum(b.vertex_count for b in cloth), "triangles": sum(len(b.triangles) for b in cloth),
        **{key: totals[key] for key in COUNTS}, "max_intersections": max(crossings, default=None),
    }  # fmt: skip
    state = _state(done, scene) if metrics or series else None
    out["metrics"] = {
        name: METRICS[name].measure(state) if state is not None and done.error is None else None for name in metrics
    }
    if series and state is not None:
        out["series"] = _series(done, state, series)
    return out


def _state(done: Finished, scene: Scene) -> State:
    recording, simulation, data = done.recording, done.simulation, scene.to_dict()
    colliders = [b for b in recording.bodies if b.kind == "collider"]
    start = Simulation(scene, threads=1, allow_intersections=True)
    times = np.asarray(recording.times)
    late = int(np.argmin(np.abs(times - LATE * times[-1])))
    kinds = sorted(done.facts[0]["energy"])

    def cloth_at(frame: int) -> Any:
        return np.concatenate([recording.positions(b.name, frame) for b in recording.cloth])

    def colliders_at(frame: int) -> Any:
        return np.concatenate([np.zeros((0, 3)), *(recording.positions(b.name, frame) for b in colliders)])

    x_start = cloth_at(0)
    return State(
        x_start=x_start, x_late=cloth_at(late), x_end=cloth_at(-1), v_start=start.velocities,
        v_end=simulation.velocities, triangles=joined(list(recording.cloth)),
        counts=np.array([b.vertex_count for b in recording.cloth]), masses=simulation.masses,
        pinned=pinned(data, list(recording.cloth), x_start), collider_start=colliders_at(0),
        collider_late=colliders_at(late), collider_end=colliders_at(-1), collider_triangles=joined(colliders),
        times=times, energies=np.array([[f["energy"][k] for k in kinds] for f in done.facts]),
        facts={"energy_kinds": kinds, "late_seconds": max(float(times[-1] - times[late]), 1e-12)}, data=data,
    )  # fmt: skip


def _series(done: Finished, state: State, wanted: Sequence[str]) -> dict[str, list[Any]]:
    """Columns with one value per frame."""
    facts = done.facts
    out: dict[str, list[Any]] = {"frame": [f["frame"] for f in facts], "time": [f["time"] for f in facts]}
    if "energy" in wanted:
        for kind in state.facts["energy_kinds"]:
            out[f"energy_{kind}"] = [f["energy"][kind] for f in facts]
    if "counts" in wanted:
        for key in ("steps", "substeps", "retries", "linear_iterations", "residual", "intersections"):
            out[key] = [f[key] for f in facts]
    if "contacts" in wanted:
        keys = next((list(f["contact"]) for f in facts if f["contact"]), [])
        for key in keys:
            out[f"contact_{key}"] = [f["contact"][key] if f["contact"] else None for f in facts]
    for name in wanted:
        if name in METRICS:
            out[name] = [METRICS[name].measure(_at(done, state, k)) for k in range(len(facts))]
    return out


def _at(done: Finished, state: State, frame: int) -> State:
    """The state as it was at a frame, as far as quantities look at it."""
    x = np.concatenate([done.recording.positions(b.name, frame) for b in done.recording.cloth])
    return replace(state, x_end=x, times=state.times[: frame + 1], energies=state.energies[: frame + 1])
