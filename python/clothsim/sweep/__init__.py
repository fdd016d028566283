"""Ensembles: scenes over parameters and seeds, on this machine's cores or any Dask cluster, as Parquet tables.

Examples
--------
>>> import clothsim as cs
>>> list(cs.sweep.distributions())
['uniform', 'log_uniform', 'normal', 'integers', 'choice']
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from clothsim._files import path_from

if TYPE_CHECKING:
    from clothsim.scene import Scene
    from clothsim.sweep.job import Sweep
    from clothsim.sweep.request import Request

__all__ = ["distributions", "load", "run", "run_file"]


def distributions() -> dict[str, str]:
    """Return the distributions that seeds can draw from, and what the list of each holds."""
    from clothsim.sweep.draws import KINDS

    return dict(KINDS)


def load(folder: str | os.PathLike[str]) -> Sweep:
    """Read a sweep that was written into a folder.

    Parameters
    ----------
    folder : path
        What was ``out``.

    Raises
    ------
    InvalidInput
        There is none.
    MissingDependency
        Dask or pyarrow is not installed: ``pip install 'clothsim[sweep]'``.
    """
    from clothsim.sweep.job import load as read

    return read(path_from(folder, "folder"))


def run(
    scene: Scene | Mapping[str, Scene],
    vary: Mapping[str, Any] | None = None,
    *,
    combine: str = "product",
    fixed: Mapping[str, Any] | None = None,
    seeds: int | None = None,
    seed: int = 0,
    disturbance: float = 1e-3,
    draws: Mapping[str, Mapping[str, Sequence[Any]]] | None = None,
    metrics: str | Sequence[str] = ("lowest", "strain_energy", "kinetic_energy", "contact_error"),
    series: str | Sequence[str] = (),
    keep: str | Sequence[str] = (),
    timeout: float | None = None,
    retries: int = 3,
    threads: int = 1,
    device: str = "cpu",
    checkpoint_interval: float | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = True,
) -> Sweep:
    """Run a scene with every combination of settings and every seed.

    Parameters
    ----------
    scene : Scene, or mapping of str to Scene
        What runs start from; several are each run with everything.
    vary : mapping, optional
        Values by key: a name of `clothsim.study.axis_names` or a path such as ``"contact.friction"``; a list, or
        ``{"first": a, "last": b, "count": n, "spacing": "linear" or "geometric"}``.
    combine : {"product", "zip"}
        All combinations, or the first value of each key together, then the second, and so on.
    fixed : mapping, optional
        One value by key, for all runs.
    seeds, seed : int, int
        Run each combination with so many seeds, counted from ``seed``; by default once, undisturbed.
    disturbance : float
        A seed adds a smooth random field of velocities of this size [m/s] to the start; 0: none.
    draws : mapping, optional
        Keys whose values a seed draws: ``{"contact.friction": {"uniform": [0.1, 0.5]}}``; see `distributions`. A seed
        draws the same in every combination.
    metrics : str or sequence of str
        What to measure at the end of each run: those of `clothsim.study.metric_names` that need no reference.
    series : str or sequence of str
        What to keep of every frame: ``"energy"``, ``"counts"``, ``"contacts"``, or a metric such as ``"lowest"``.
    keep : str or sequence of str
        Outputs of every run to keep, by their keys in the scene's ``[output]``: ``"npz"``, ``"usd"``, …
    timeout : float, optional
        Stop a run after so many seconds; its row says so.
    retries : int
        How often a run whose worker was lost is started again.
    threads, device : int, str
        Of each run.
    checkpoint_interval : float, optional
        Simulated time between checkpoints [s], in place of the scene's.
    processes : int, optional
        Runs side by side on this machine; by default as many as cores allow.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster, in place of this machine.
    out : path, optional
        Folder for tables and kept outputs; without it nothing is kept on disk.
    resume, overwrite, progress : bool
        Go on with the sweep in ``out``; replace it; show a bar.

    Returns
    -------
    Sweep

    Raises
    ------
    InvalidInput
        Nothing varies, or a key, a metric or a choice is not known; the nearest is named.
    OutputExists, CheckpointError
        The folder holds a sweep already, or another one.
    OutputError, ClusterError
        The disk is full, or the cluster cannot be reached; what has finished is kept.
    MissingDependency
        Dask or pyarrow is not installed: ``pip install 'clothsim[sweep]'``.
    """
    from clothsim.sweep.request import Request

    request = Request(
        scene, vary or {}, combine=combine, fixed=fixed, seeds=seeds, seed=seed, disturbance=disturbance, draws=draws,
        metrics=metrics, series=series, keep=keep, timeout=timeout, threads=threads, device=device,
        checkpoint_interval=checkpoint_interval,
    )  # fmt: skip
    return _run(
        request, out, processes=processes, scheduler=scheduler, retries=retries, resume=resume, overwrite=overwrite,
        progress=progress,
    )  # fmt: skip


def run_file(
    path: str | os.PathLike[str],
    *,
    fixed: Mapping[str, Any] | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = True,
) -> Sweep:
    """Run what a sweep file (TOML) asks for; it returns and raises what `run` does.

    Parameters
    ----------
    path : path
        The file.
    fixed : mapping, optional
        Values for all runs, before those of the file's ``[set]``.
    processes, scheduler, out, resume, overwrite, progress
        As for `run`.
    """
    from clothsim.sweep.file import read

    asked = read(path, fixed)
    return _run(
        asked.request, out, processes=processes, scheduler=scheduler, retries=asked.retries, resume=resume,
        overwrite=overwrite, progress=progress,
    )  # fmt: skip


def _run(request: Request, out: str | os.PathLike[str] | None, **options: Any) -> Sweep:
    from clothsim.sweep import job

    folder = None if out is None else path_from(out, "out")
    done = job.run(request, folder, job.Options(**options))
    return job.load(folder) if isinstance(done, dict) and folder is not None else done  # type: ignore[return-value]
