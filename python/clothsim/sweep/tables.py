"""What a sweep found, as Arrow tables and Parquet files.

The tables of runs and of frames are the same bytes for the same sweep, whatever ran it and in whichever order. What
depends on the machine (times, workers, restarts) is a table of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim._files import replacing, whole_folder
from clothsim.study.metrics import METRICS
from clothsim.sweep.folder import KEPT
from clothsim.sweep.observe import COUNTS
from clothsim.sweep.request import Request

__all__ = ["costs_table", "frames_tables", "read", "runs_table", "write", "write_frames"]

_UNITS = {"simulated_seconds": "s", "time": "s", "residual": "-"}
_FRAME_ROWS = 500_000  # rows of a part file, about


def status(facts: Mapping[str, Any]) -> str:
    """One word for what became of a run."""
    words = {"TimeLimit": "timed out", "WorkerLost": "lost", "Unbuildable": "not run"}
    return words.get(facts["error_type"], "failed") if facts.get("error") else "ok"


def runs_table(request: Request, results: Sequence[Mapping[str, Any]]) -> Any:
    """One row per run: what it was, what became of it, its metrics and counts."""
    columns: dict[str, list[Any]] = {"run": [run.number for run in request.runs]}
    if len(request.scenes) > 1:
        names = list(request.scenes)
        columns["scene"] = [names[run.scene] for run in request.runs]
    if request.seeds != [None]:
        columns["seed"] = [run.seed for run in request.runs]
    for name in [*(a.name for a in request.axes), *(d.name for d in request.draws)]:
        columns[name] = _uniform([run.settings[name] for run in request.runs])
    columns["status"] = [status(facts) for facts in results]
    columns["error"] = [facts.get("error") for facts in results]
    columns["error_type"] = [facts.get("error_type") for facts in results]
    for name in request.metrics:
        columns[name] = [_float(facts.get("metrics", {}).get(name)) for facts in results]
    columns["simulated_seconds"] = [_float(facts.get("simulated_seconds")) for facts in results]
    for name in ("frames", "vertices", "triangles", *COUNTS, "max_intersections"):
        columns[name] = [facts.get(name) for facts in results]
    if request.keep:
        kept = [f"{KEPT}/{run.name.partition('-')[0]}" for run in request.runs]
        columns["folder"] = [k if "metrics" in facts else None for k, facts in zip(kept, results, strict=True)]
    floats = {*request.metrics, "simulated_seconds"}
    texts = {"status", "error", "error_type", "folder"}
    whole = {"run", "seed", "frames", "vertices", "triangles", *COUNTS, "max_intersections"}
    return _table(columns, request, floats, texts, whole)


def frames_tables(request: Request, results: Sequence[Mapping[str, Any]]) -> list[Any]:
    """Tables with one row per frame of each run that has a series, in parts of whole runs."""
    if not request.series:
        return []
    names = list(dict.fromkeys(n for facts in results for n in facts.get("series", {})))
    parts: list[dict[str, list[Any]]] = []
    for run, facts in zip(request.runs, results, strict=True):
        series = facts.get("series")
        if not series:
            continue
        if not parts or len(parts[-1]["run"]) > _FRAME_ROWS:
            parts.append({"run": [], **{n: [] for n in names}})
        count = len(series["frame"])
        parts[-1]["run"] += [run.number] * count
        for n in names:
            parts[-1][n] += series.get(n, [None] * count)
    whole = {"run", "frame", "steps", "substeps", "retries", "linear_iterations", "intersections"}
    return [_table(part, request, set(names) - whole, set(), whole) for part in parts]


def costs_table(request: Request, results: Sequence[Mapping[str, Any]]) -> Any:
    """One row per run: what it took, and where. Not the same from sweep to sweep."""
    columns: dict[str, list[Any]] = {
        "run": [run.number for run in request.runs],
        "seconds": [_float(facts.get("seconds")) for facts in results],
        "starts": [facts.get("starts", 0) for facts in results],
        "losses": [facts.get("losses", 0) for facts in results],
        "resumed_at": [facts.get("resumed_at") for facts in results],
        "worker": [facts.get("worker") for facts in results],
    }
    return _table(columns, request, {"seconds"}, {"worker"}, {"run", "starts", "losses", "resumed_at"})


def write(table: Any, path: Path) -> None:
    """Write a table, whole or not at all."""
    import pyarrow.parquet as pq

    with replacing(path) as part:
        pq.write_table(table, part, compression="zstd")


def write_frames(tables: Sequence[Any], folder: Path) -> None:
    """Write the parts of a table, all or none."""
    import pyarrow.parquet as pq

    with whole_folder(folder, overwrite=True) as part:
        for k, table in enumerate(tables):
            pq.write_table(table, part / f"part-{k:05d}.parquet", compression="zstd")


def read(path: Path) -> Any:
    """A table, or all parts of one."""
    import pyarrow.parquet as pq

    return pq.read_table(path)


def _table(
    columns: Mapping[str, list[Any]], request: Request, floats: set[str], texts: set[str], whole: set[str]
) -> Any:
    import pyarrow as pa

    fields, arrays = [], []
    for name, values in columns.items():
        known = pa.float64() if name in floats else pa.string() if name in texts else None
        array = pa.array(values, type=pa.int64() if name in whole else known)
        notes = {"unit": METRICS[name].unit, "meaning": METRICS[name].meaning} if name in METRICS else {}
        unit = _UNITS.get(name) or ("J" if name.startswith("energy_") else None)
        fields.append(pa.field(name, array.type, metadata=notes or ({"unit": unit} if unit else None)))
        arrays.append(array)
    about = {"clothsim": _core.__version__, "sweep": request.name, "digest": request.digest}
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=about))


def _uniform(values: list[Any]) -> list[Any]:
    """Values of one type: numbers as they are, anything else, mixed or not, as text."""
    if all(isinstance(v, bool) for v in values) or all(isinstance(v, str) for v in values):
        return values
    if all(isinstance(v, int) and not isinstance(v, bool) for v in values):
        return values if all(-(2**63) <= v < 2**63 for v in values) else [float(v) for v in values]
    if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
        return [float(v) for v in values]
    return [v if isinstance(v, str) else json.dumps(v, sort_keys=True, default=str) for v in values]


def _float(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
