"""What accuracy costs: a scene run over combinations of settings, with errors, times, memory and the front.

Examples
--------
>>> import clothsim as cs
>>> cs.study.metric_names()[:3]
['rms', 'max', 'shape']
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from clothsim._files import path_from

if TYPE_CHECKING:
    from clothsim.scene import Scene
    from clothsim.study.result import Study
    from clothsim.study.tuning import Tuned

__all__ = ["axis_names", "load", "metric_names", "run", "tune"]


def axis_names() -> dict[str, str]:
    """Return what the named axes vary; any key of a scene can be varied by its path too."""
    from clothsim.study.axes import NAMED

    return dict(NAMED)


def metric_names() -> list[str]:
    """Return the names of all metrics."""
    from clothsim.study.metrics import METRICS

    return list(METRICS)


def load(folder: str | os.PathLike[str]) -> Study:
    """Read a study that was written into a folder, for plots and tables of your own.

    Parameters
    ----------
    folder : str or path
        The folder that ``out`` named.

    Raises
    ------
    InvalidInput
        There is none.
    """
    from clothsim.study.loading import load as read

    return read(folder)


def run(
    scene: Scene,
    vary: Mapping[str, Sequence[Any]],
    metric: str | Sequence[str] | None = None,
    *,
    fixed: Mapping[str, Any] | None = None,
    reference: str = "auto",
    cost: str = "seconds",
    sample: int | None = None,
    seeds: int = 1,
    seed: int = 0,
    disturbance: float = 1e-3,
    repeats: int = 3,
    patience: float = 60.0,
    processes: int | None = None,
    limit: float | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool = True,
) -> Study:
    """Run a scene with every combination of settings, and measure error, time and memory of each.

    Parameters
    ----------
    scene : Scene
        What to study, for its whole duration.
    vary : mapping of str to sequence
        Values by axis: a name of `axis_names`, or a path such as ``"contact.friction"``.
    metric : str or sequence of str, optional
        What to measure (`metric_names`); the front is about the first. ``"rms"`` by default, ``"drape"`` with seeds.
    fixed : mapping, optional
        One value by axis, for all runs.
    reference : {"auto", "closed-form", "finest"}
        What errors are measured against: a closed form where one is known for the scene, else a run one step finer than
        the finest of the study, with its own error by refinement.
    cost : {"seconds", "cpu_seconds", "peak_bytes", "state_bytes"}
        What the front weighs errors against.
    sample : int, optional
        Run a seeded sample of so many combinations.
    seeds, seed, disturbance : int, int, float
        Run each point from so many disturbed starts (velocities [m/s] in the mean square) and compare means.
    repeats, patience : int, float
        Timed runs of each point, as long as ``patience`` [s] lasts; a run before them warms up.
    processes : int, optional
        Most runs side by side; by default one per core.
    limit : float, optional
        Stop a run, its repeats included, after so many seconds; its point is kept with that as its error.
    out : path, optional
        Folder for tables and plots; without it nothing is kept on disk.
    resume, overwrite, progress : bool
        Go on where a study in ``out`` stopped; replace it; show a bar.

    Returns
    -------
    Study

    Raises
    ------
    InvalidInput
        Nothing varies, or an axis, a value or a metric is not known; the nearest is named.
    OutputExists, CheckpointError
        The folder holds a study already, or another one.
    """
    from clothsim.study import job

    request = job.Request(
        scene, vary, metric, fixed=fixed, reference=reference, cost=cost, sample=sample, seeds=seeds, seed=seed,
        disturbance=disturbance, repeats=repeats, patience=patience,
    )  # fmt: skip
    folder = None if out is None else path_from(out, "out")
    done = job.run(
        request, folder, resume=resume, overwrite=overwrite, processes=processes, limit=limit, progress=progress
    )
    if isinstance(done, dict):  # complete already: its runs are gone, its tables are there
        from clothsim.errors import OutputExists

        raise OutputExists(f"{out}: the study is complete; its facts are in study.json")
    return done


def tune(
    scene: Scene,
    *,
    error: float | None = None,
    budget: float | None = None,
    per: str = "frame",
    metric: str = "rms",
    vary: Mapping[str, Sequence[Any]] | Sequence[Any] = (),
    fixed: Mapping[str, Any] | None = None,
    reference: str = "auto",
    cost: str = "seconds",
    repeats: int = 3,
    patience: float = 60.0,
    processes: int | None = None,
    limit: float | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    command: str = "",
    progress: bool = True,
) -> Tuned:
    """Find the cheapest settings that meet an error, or the most precise ones within a time, and measure them again.

    Every integrator is tried at time steps from coarse to fine until it meets the bound or costs more than one that
    does; then the gap between the last step that fails and the first that meets it is halved twice.

    Parameters
    ----------
    scene : Scene
        What to tune, for its whole duration.
    error : float, optional
        Largest error in the metric's unit; the reference's own error is added to what was measured. Or:
    budget : float, optional
        Most seconds.
    per : {"frame", "run"}
        What the budget is for; a frame lasts 1/``output.fps``.
    metric : str
        What the error is measured in.
    vary : mapping of str to sequence, optional
        What to choose from: axes that do not change what is asked. By default integrators and time steps.
    fixed, reference, cost, repeats, patience, processes, limit, resume, overwrite, progress
        As for `run`.
    out : path, optional
        Folder for ``tuned.toml`` and for the tables and plots of all that was tried.
    command : str
        How to run it again, for the table.

    Returns
    -------
    Tuned

    Raises
    ------
    InvalidInput
        Neither or both of error and budget, or an axis that changes what is asked.
    """
    from clothsim.study import tuning
    from clothsim.study.axes import axis

    axes = [axis(name, values) for name, values in vary.items()] if isinstance(vary, Mapping) else list(vary)
    return tuning.tune(
        scene, tuning.Goal(error, budget, per), metric=metric, vary=axes, fixed=dict(fixed or {}), reference=reference,
        cost=cost, repeats=repeats, patience=patience, processes=processes, limit=limit, progress=progress,
        out=None if out is None else path_from(out, "out"), resume=resume, overwrite=overwrite, command=command,
    )  # fmt: skip
