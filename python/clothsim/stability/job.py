"""Runs the cells of the atlas side by side, and writes it."""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from clothsim.simulation import progress_bar
from clothsim.stability import outputs as files
from clothsim.stability.atlas import Atlas, Cell, Map, Request, engine_digest
from clothsim.study import machine
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.pool import Job, run_jobs

__all__ = ["LIMIT", "AtlasFolder", "run"]

# Seconds that a cell may take.
LIMIT = 60.0


class AtlasFolder(StudyFolder):
    """``OUT`` and its work folder."""

    noun, article = "atlas", "an"
    outputs = files.FILES
    facts_file = files.FACTS


def run(
    request: Request,
    out: Path | None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    processes: int | None = None,
    limit: float = LIMIT,
    progress: bool = True,
    command: str = "",
) -> Atlas | dict[str, Any]:
    """Run the cells and write the atlas into a folder; returns the facts of one that was complete already.

    Raises
    ------
    OutputExists, CheckpointError
        The folder holds something else, or an atlas and neither ``resume`` nor ``overwrite`` is set.
    """
    started = time.monotonic()
    cells, digest = request.cells(), request.digest
    with _folder(out) as folder:
        if out is not None:
            files.check_packages()
            complete = folder.begin(digest, resume=resume, overwrite=overwrite)
            if complete is not None:
                return complete
        with folder.locked():
            folder.claim(digest, overwrite=overwrite)
            where = machine.facts()
            seen = _seen(request, cells, folder, processes, limit, progress=progress)
            atlas = Atlas(_maps(request, seen), where, command, digest, time.monotonic() - started)
            if out is not None:
                files.write(atlas, out)
                folder.remove_work()
    return atlas


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[AtlasFolder]:
    if out is not None:
        yield AtlasFolder(out)
        return
    with tempfile.TemporaryDirectory(prefix="clothsim-stability-") as name:
        yield AtlasFolder(Path(name))


def _seen(
    request: Request, cells: list[Cell], folder: AtlasFolder, processes: int | None, limit: float, *, progress: bool
) -> list[Cell]:
    jobs = []
    for cell in cells:
        spec = {"case": cell.case.name, "x": cell.x, "y": cell.y, "fixed": request.fixed}
        name = fingerprint([spec, limit, engine_digest()])
        jobs.append(Job(folder.work / name, {**spec, "threads": 1}, "clothsim.stability.worker"))
    bar = progress_bar(len(jobs), enabled=progress, name="cells")
    bar.unit = "cell"
    try:
        run_jobs(jobs, processes, limit, bar.update)
    finally:
        bar.close()
    return [
        replace(cell, facts=json.loads(job.path.with_suffix(".result").read_bytes()))
        for cell, job in zip(cells, jobs, strict=True)
    ]


def _maps(request: Request, cells: list[Cell]) -> list[Map]:
    return [
        Map(case, request.values(case.x), request.values(case.y), [c for c in cells if c.case is case])
        for case in request.cases
    ]
