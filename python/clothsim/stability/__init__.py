"""Where stability ends: hard cases over grids of two parameters, a verdict per cell, and a map per case.

Examples
--------
>>> import clothsim as cs
>>> cs.stability.case_names()[:3]
['stretch', 'bending', 'integrators']
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from clothsim._files import path_from

if TYPE_CHECKING:
    from clothsim.stability.atlas import Atlas

__all__ = ["case_names", "run"]


def case_names() -> list[str]:
    """Return the names of all cases."""
    from clothsim.stability.catalogue import CATALOGUE

    return [case.name for case in CATALOGUE]


def run(
    cases: Sequence[str] = (),
    *,
    quick: bool = False,
    at: Mapping[str, Sequence[Any]] | None = None,
    fixed: Mapping[str, Any] | None = None,
    processes: int | None = None,
    limit: float = 60.0,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = True,
) -> Atlas:
    """Run hard cases over their grids and judge every cell.

    Parameters
    ----------
    cases : sequence of str
        Names of `case_names`; all by default.
    quick : bool
        A few cells of each.
    at : mapping of str to sequence, optional
        Values of an axis in place of its own, in every case that has it: ``{"dt": [0.005]}``.
    fixed : mapping, optional
        Keys of every scene, as for `clothsim.study.run`: ``{"integrator": "implicit-newton"}``.
    processes : int, optional
        Most cells side by side; by default one per core.
    limit : float
        Seconds that a cell may take.
    out : path, optional
        Folder for tables and maps; without it nothing is kept on disk.
    resume, overwrite, progress : bool
        Go on where an atlas in ``out`` stopped; replace it; show a bar.

    Returns
    -------
    Atlas
        ``maps``, ``cells`` with their verdicts, and ``broken``: the cells in which a promise was broken.

    Raises
    ------
    InvalidInput
        A case, an axis or a value is not known; the nearest is named.
    OutputExists, CheckpointError
        The folder holds an atlas already, or another one.
    """
    from clothsim.stability import job
    from clothsim.stability.atlas import Request

    request = Request(cases, quick=quick, at=at, fixed=fixed)
    folder = None if out is None else path_from(out, "out")
    done = job.run(
        request, folder, resume=resume, overwrite=overwrite, processes=processes,
        limit=limit, progress=progress,
    )  # fmt: skip
    if isinstance(done, dict):
        from clothsim.errors import OutputExists

        raise OutputExists(f"{out}: the atlas is complete; its facts are in stability.json")
    return done
