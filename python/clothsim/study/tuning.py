"""The cheapest settings that meet a bound, with the evidence."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from clothsim._files import write_whole
from clothsim.errors import InvalidInput, OutputExists
from clothsim.scene import Scene
from clothsim.study import evaluate, machine, outputs
from clothsim.study.axes import RUN_AXES, Axis, apply, axis, variant
from clothsim.study.folder import StudyFolder, fingerprint
from clothsim.study.job import Request, based
from clothsim.study.points import label
from clothsim.study.quantities import amount
from clothsim.study.result import COSTS, Row, Study
from clothsim.study.runner import Runner
from clothsim.study.search import SHARE, Goal, Search, look, own_error
from clothsim.study.work import kept

__all__ = ["Goal", "Tuned", "tune"]

_INTEGRATORS = ("implicit-euler", "implicit-newton", "midpoint", "rk4", "explicit-euler")
# Time steps tried: the scene's own times 4, down to 4/2^11 of it.
_COARSEST, _LEVELS = 4.0, 12


@dataclass(frozen=True, eq=False)
class Tuned:
    """The settings found, and what speaks for them.

    Attributes
    ----------
    goal : Goal
        What was asked for.
    row : Row or None
        The settings chosen, with their error and time; None if none was found.
    again : Row or None
        The same, measured again from the scene that was written.
    met : bool
        Whether what was measured again meets the bound.
    scene : Scene or None
        The scene with these settings.
    study : Study
        All that was tried.
    statement : str
        In words.
    frames : float
        What a run's cost is divided by.
    files : list of Path
        What was written.
    """

    goal: Goal
    row: Row | None
    again: Row | None
    met: bool
    scene: Scene | None
    study: Study
    statement: str
    frames: float = 1.0
    files: list[Path] = field(default_factory=list)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "met": self.met, "statement": self.statement,
            "goal": {"error": self.goal.error, "budget": self.goal.budget, "per": self.goal.per},
            "chosen": None if self.row is None else self.row.facts(),
            "measured_again": None if self.again is None else self.again.facts(),
            "reference_own_error": None if self.row is None else self.study.own_error(self.row),
            "files": [str(path) for path in self.files],
        }  # fmt: skip


def tune(
    scene: Scene,
    goal: Goal,
    *,
    metric: str = "rms",
    vary: Sequence[Axis] = (),
    fixed: dict[str, Any] | None = None,
    reference: str = "auto",
    cost: str = "seconds",
    repeats: int = 3,
    patience: float = 60.0,
    processes: int | None = None,
    limit: float | None = None,
    progress: bool = True,
    out: Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    command: str = "",
) -> Tuned:
    """Find the cheapest settings whose error meets a bound, or the most precise ones within a budget of time.

    Every integrator (and combination of the other axes) is tried at time steps from coarse to fine, until it meets the
    bound or costs more than one that does; two halvings of the gap then find how coarse the step may be. The reference
    is refined until its own error is a tenth of the bound; what is compared with the bound is the sum of both.

    Raises
    ------
    InvalidInput
        An axis changes what is asked, or there is nothing to choose from.
    OutputExists, CheckpointError
        The folder holds a study already, or another one.
    """
    from clothsim._progress import progress_bar

    started = time.monotonic()
    axes = _axes(based(scene, fixed or {}), vary)
    request = Request(
        scene, axes, metric, fixed=fixed, reference=reference, cost=cost, repeats=repeats, patience=patience
    )
    if goal.budget is not None and COSTS[cost][0] != "s":
        raise InvalidInput(f"cost: expected seconds or cpu_seconds for a budget, got {cost}", name="cost", got=cost)
    digest = fingerprint([request.digest, goal.error, goal.budget, goal.per])
    where = machine.facts()

    def make(folder: StudyFolder) -> Tuned:
        runner = Runner(
            scene, request.base, request.axes, folder, repeats=repeats, patience=patience, processes=processes,
            limit=limit,
        )  # fmt: skip
        bar = progress_bar(0, enabled=progress, name="runs", unit="run")
        try:
            search = Search(request, runner, goal, bar.update)
            look(search)
            best = search.best()
            row, again, made = _confirmed(search, best, scene, request, out)
        finally:
            bar.close()
        rows = sorted(search.rows.values(), key=lambda r: [str(v) for v in r.settings.values()])
        study = evaluate.study(request, rows, [({}, search.reference)], where, 1)
        study = replace(study, command=command, digest=digest, out=out, seconds=time.monotonic() - started)
        met = again is not None and search.meets(again)
        statement = _statement(search, row, again, met=met)
        return Tuned(goal, row, again, met, made, study, statement, search.frames)

    def write(found: Tuned, out: Path) -> Tuned:
        return replace(found, files=_write(found, out))

    found = kept(
        StudyFolder, out, digest, make, write, check=outputs.check_packages, resume=resume, overwrite=overwrite
    )
    if not isinstance(found, Tuned):
        raise OutputExists(f"{out}: holds these settings already; --overwrite finds them anew")
    return found


def _write(found: Tuned, out: Path) -> list[Path]:
    """Write the evidence; the scene is there already."""
    scene = [out / "tuned.toml"] if found.scene is not None else []
    written = replace(found.study, statement=[found.statement, *found.study.statement])
    budget = None if found.goal.budget is None else found.goal.budget * found.frames
    files = [*scene, *outputs.write(written, out, (found.goal.error, budget)), out / "tune.json"]
    facts = json.dumps(replace(found, files=files).facts(), indent=1, ensure_ascii=False)
    write_whole(out / "tune.json", (facts + "\n").encode())
    return files


def _axes(base: dict[str, Any], vary: Sequence[Axis]) -> list[Axis]:
    for a in vary:
        if a.key in RUN_AXES:
            expected = "axes of the scene that is written, such as integrator or dt"
            raise InvalidInput(f"vary: expected {expected}, got {a.name}, which is no part of one", name="vary")
        if not a.numerical:
            raise InvalidInput(
                f"tune: expected axes that do not change what is asked, such as integrator, dt, resolution or "
                f"solver_tolerance, got {a.name}",
                name="vary",
                got=a.name,
            )
    axes = list(vary)
    keys = {a.key for a in axes}
    if "time.integrator" not in keys:
        own = base["time"]["integrator"]
        held = (base.get("contact") or {}).get("method") == "constraints"  # what only implicit schemes can do
        others = [i for i in _INTEGRATORS if i != own and (i.startswith("implicit") or not held)]
        axes.insert(0, axis("integrator", [own, *others]))
    if "time.dt" not in keys:
        own_dt, most = base["time"]["dt"], float(base["duration"])
        dt = float(base["time"]["dt_max"] if own_dt == "auto" else own_dt)
        steps = [dt * _COARSEST / 2**k for k in range(_LEVELS)]
        axes.append(axis("dt", [s for s in steps if s <= most]))
    return axes


def _confirmed(
    search: Search, best: Row | None, scene: Scene, request: Request, out: Path | None
) -> tuple[Row | None, Row | None, Scene | None]:
    """Write the scene, read it again, and measure it anew, without any result from before."""
    for _ in range(3):
        if best is None:
            return None, None, None
        data = json.loads(json.dumps(request.base))
        for a in request.axes:
            apply(data, a.key, best.settings[a.name])
        made = variant(scene, data)
        path = None if out is None else out / "tuned.toml"
        if path is not None:
            made.save(path)
            made = Scene.load(path)
        with tempfile.TemporaryDirectory(prefix="clothsim-tune-") as name:
            folder = StudyFolder(Path(name))
            with folder.locked():
                runner = Runner(made, made.to_dict(), [], folder, repeats=request.repeats, patience=request.patience)
                again = evaluate.row({}, runner.run([{}], search.progress)[0], request.metrics, search.reference)
        if search.meets(again) or search.goal.error is not None:
            return best, again, made
        # Over the budget when measured again: the next best.
        del search.rows[label(best.settings)]
        best = search.best()
    return None, None, None


def _statement(search: Search, row: Row | None, again: Row | None, *, met: bool) -> str:
    metric, goal = search.metric, search.goal
    own = own_error(search.reference, metric.name) if metric.needs_reference else 0.0
    if goal.error is not None:
        wanted = f"{metric.name} ≤ {amount(goal.error, metric.unit)}"
    else:
        wanted = f"≤ {amount(goal.budget, 's')} per {goal.per}"
    if row is None or again is None:
        if search.reference.kind == "none" and metric.needs_reference:
            return f"{wanted}: no settings can be judged: {search.reference.statement}"
        if goal.error is not None and own > SHARE * goal.error and metric.needs_reference:
            return (
                f"{wanted}: not found; the reference's own error is {amount(own, metric.unit)} at its finest. "
                "A scene that buckles or touches by chance has no single answer: try --metric shape or drape"
            )
        return f"{wanted}: no settings that were tried meet it"
    at = f"{amount(search.bound(again), metric.unit)} (the reference's own {amount(own, metric.unit)} included)"
    cost = amount(search.cost(again), search.unit) + (f" per {goal.per}" if search.unit == "s" else "")
    verdict = "" if met else " NOT MET when measured again"
    return f"{wanted}:{verdict} {row.label}, measured again: {metric.name} ≤ {at}, {cost}"
