"""One sweep from runs to tables."""

from __future__ import annotations

import contextlib
import json
import logging
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from clothsim._files import write_whole
from clothsim._progress import progress_bar
from clothsim.errors import ClusterError, InvalidInput
from clothsim.study import machine
from clothsim.study.points import label
from clothsim.sweep import tables
from clothsim.sweep.cluster import check_packages, connected
from clothsim.sweep.farm import run_all
from clothsim.sweep.folder import COSTS, FACTS, FRAMES, KEPT, RUNS, SweepFolder
from clothsim.sweep.request import Request, Run
from clothsim.sweep.task import read_result

__all__ = ["RETRIES", "Options", "Sweep", "load", "run"]

_logger = logging.getLogger(__name__)

RETRIES = 3


@dataclass(frozen=True)
class Options:
    """How a sweep is run; nothing of it changes what comes out.

    Attributes
    ----------
    processes : int or None
        Runs side by side on this machine; by default as many as cores allow.
    scheduler : str or None
        Address of the scheduler of a Dask cluster, in place of this machine.
    retries : int or None
        How often a run whose worker was lost is started again.
    resume, overwrite, progress : bool
        Go on with the sweep in the folder; replace it; show a bar.
    command : str
        How to do it again, for the record.
    """

    processes: int | None = None
    scheduler: str | None = None
    retries: int | None = None
    resume: bool = False
    overwrite: bool = False
    progress: bool = True
    command: str = ""


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a sweep found.

    Attributes
    ----------
    runs : pyarrow.Table
        One row per run, in order: what it was, what became of it, its metrics and counts.
    frames : pyarrow.Table or None
        One row per frame of every run, if series were asked for.
    costs : pyarrow.Table
        Seconds, starts and workers of every run.
    facts : dict
        What was asked for, where it ran, how many runs are ``ok``, ``failed``, ``timed out``, ``lost`` or ``not run``.
    out : Path or None
        Where it was written.
    """

    runs: Any
    frames: Any
    costs: Any
    facts: dict[str, Any]
    out: Path | None = None

    def rows(self) -> list[dict[str, Any]]:
        """The runs as dicts."""
        return list(self.runs.to_pylist())


def run(request: Request, out: Path | None, options: Options) -> Sweep | dict[str, Any]:
    """Run a sweep into a folder; returns the facts of one that was complete already.

    Raises
    ------
    MissingDependency
        Dask or pyarrow is not installed.
    OutputExists, CheckpointError
        The folder holds a sweep already, or another one.
    OutputError, ClusterError
        The disk is full, or the cluster is gone; ``resume`` goes on.
    """
    retries = RETRIES if options.retries is None else options.retries
    if not isinstance(retries, int) or isinstance(retries, bool) or retries < 0:
        raise InvalidInput(f"retries: expected a whole number ≥ 0, got {retries!r}", name="retries")
    check_packages()
    started = time.monotonic()
    with _folder(out) as folder:
        complete = folder.begin(request.digest, resume=options.resume, overwrite=options.overwrite)
        if complete is not None:
            return complete
        with folder.locked():
            folder.claim(request.digest, overwrite=options.overwrite)
            with _nothing_left(folder):
                results, cluster = _results(request, folder, options, retries)
            facts = {
                **request.facts(), "command": options.command, "machine": machine.facts(), **cluster,
                "seconds": round(time.monotonic() - started, 1), **_counts(results), "files": [],
            }  # fmt: skip
            sweep = _written(request, folder, results, facts, out)
            folder.remove_work()
    return sweep


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[SweepFolder]:
    """Give the folder, or one that goes when the sweep is over."""
    if out is not None:
        yield SweepFolder(out)
        return
    with tempfile.TemporaryDirectory(prefix="clothsim-sweep-") as name:
        yield SweepFolder(Path(name) / "out")


@contextlib.contextmanager
def _nothing_left(folder: SweepFolder) -> Iterator[None]:
    """A sweep that has not begun, as there is no cluster, leaves no unfinished one behind."""
    try:
        yield
    except ClusterError:
        if not any((folder.work / "results").iterdir()) and not any((folder.work / "runs").iterdir()):
            folder.remove_work()
            with contextlib.suppress(OSError):
                folder.out.rmdir()
        raise


def _results(
    request: Request, folder: SweepFolder, options: Options, retries: int
) -> tuple[list[Mapping[str, Any]], dict[str, Any]]:
    """Facts of every run, by number, and of the cluster."""
    work = folder.work_of()
    known: dict[int, Mapping[str, Any]] = {}
    waiting: list[Run] = []
    for one in request.runs:
        found = read_result(work.result(one.name))
        if one.error is not None:
            known[one.number] = {"error": one.error, "error_type": "Unbuildable"}
        elif found is not None:
            known[one.number] = found
        else:
            waiting.append(one)
    bar = progress_bar(len(request.runs), initial=len(known), enabled=options.progress, name=request.name, unit="run")
    again = 0

    def done(one: Run, facts: Mapping[str, Any]) -> None:
        known[one.number] = facts
        if facts.get("error_type") != "WorkerLost":  # that is no word about the run: it is tried again on a resume
            path = work.result(one.name)
            write_whole(path, json.dumps({**(read_result(path) or facts), "losses": facts.get("losses", 0)}).encode())
        bar.update()

    def lost(one: Run) -> None:
        nonlocal again
        again += 1
        bar.set_postfix_str(f"{again} started again")
        text = f"run {one.number} ({label(one.settings)}): its worker was lost; it goes on with another one"
        _logger.warning("%s", text)
        if options.progress:
            bar.write(text, file=sys.stderr)

    cluster_facts: dict[str, Any] = {"scheduler": options.scheduler, "workers": 0, "started_again": 0}
    try:
        if waiting:
            with connected(options.scheduler, options.processes, request.threads) as cluster:
                run_all(cluster, request, waiting, work, retries, done, lost)
                cluster_facts.update(workers=cluster.slots, started_again=again)
    finally:
        bar.close()
    return [known[one.number] for one in request.runs], cluster_facts


def _counts(results: list[Mapping[str, Any]]) -> dict[str, Any]:
    words = [tables.status(facts) for facts in results]
    return {"runs": len(words), "counts": {word: words.count(word) for word in dict.fromkeys(words)}}


def _written(
    request: Request, folder: SweepFolder, results: list[Mapping[str, Any]], facts: dict[str, Any], out: Path | None
) -> Sweep:
    """Tables, and, the facts last, their files: with the facts the sweep is complete."""
    runs, parts = tables.runs_table(request, results), tables.frames_tables(request, results)
    costs = tables.costs_table(request, results)
    import pyarrow as pa

    frames = pa.concat_tables(parts) if parts else None
    if out is None:
        return Sweep(runs, frames, costs, facts)
    folder.move_kept(request.keep)
    names = [RUNS, COSTS, *([FRAMES] if parts else []), *([KEPT] if request.keep else []), FACTS]
    if parts:
        tables.write_frames(parts, out / FRAMES)
    tables.write(costs, out / COSTS)
    tables.write(runs, out / RUNS)
    facts = {**facts, "files": names}
    write_whole(out / FACTS, (json.dumps(facts, indent=1, ensure_ascii=False) + "\n").encode())
    return Sweep(runs, frames, costs, facts, out)


def load(out: Path) -> Sweep:
    """Read a sweep that is complete.

    Raises
    ------
    InvalidInput
        There is none.
    """
    check_packages()
    try:
        facts = json.loads((out / FACTS).read_bytes())
        frames = tables.read(out / FRAMES) if FRAMES in facts["files"] else None
        return Sweep(tables.read(out / RUNS), frames, tables.read(out / COSTS), facts, out)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidInput(f"{out}: expected a complete sweep, got none ({error})", name="folder") from error
