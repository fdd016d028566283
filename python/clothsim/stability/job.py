"""Runs the cells of the atlas side by side, and writes it."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

from clothsim._progress import progress_bar
from clothsim.stability import outputs as files
from clothsim.stability.atlas import Atlas, Cell, Map, Request, engine_digest
from clothsim.study import machine
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.pool import Job, run_jobs
from clothsim.study.work import kept

__all__ = ["LIMIT", "AtlasFolder", "run"]

# Seconds that a cell may take.
LIMIT = 60.0


class AtlasFolder(StudyFolder):
    """``OUT`` and its work folder."""

    noun, article = "atlas", "an"
    outputs = files.FILES
    facts_file = files.FACTS
    strangers: ClassVar[dict[str, str]] = {StudyFolder.facts_file: "a study"}


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

    def make(folder: AtlasFolder) -> Atlas:
        where = machine.facts()
        seen = _seen(request, cells, folder, processes, limit, progress=progress)
        return Atlas(_maps(request, seen), where, command, digest, time.monotonic() - started)

    def write(atlas: Atlas, out: Path) -> Atlas:
        files.write(atlas, out)
        return atlas

    return kept(AtlasFolder, out, digest, make, write, check=files.check_packages, resume=resume, overwrite=overwrite)


def _seen(
    request: Request, cells: list[Cell], folder: AtlasFolder, processes: int | None, limit: float, *, progress: bool
) -> list[Cell]:
    jobs = []
    for cell in cells:
        spec = {"case": cell.case.name, "x": cell.x, "y": cell.y, "fixed": request.fixed}
        name = fingerprint([spec, limit, engine_digest()])
        jobs.append(Job(folder.work / name, {**spec, "threads": 1}, "clothsim.stability.worker"))
    bar = progress_bar(len(jobs), enabled=progress, name="cells", unit="cell")
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
