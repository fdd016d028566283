"""What a sweep is asked for, checked: the scenes, what varies, the seeds, and what is kept of every run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim import _core
from clothsim._device import check_device, check_threads
from clothsim._nearest import one_of
from clothsim._run.outputs import check_packages
from clothsim.errors import InvalidInput
from clothsim.scene import Scene
from clothsim.study.axes import RUN_AXES, Axis, axis
from clothsim.study.folder import fingerprint
from clothsim.study.job import based
from clothsim.study.metrics import METRICS
from clothsim.study.points import Built, Settings, build
from clothsim.study.worker import pack_scene
from clothsim.sweep.draws import Draw, draw

__all__ = ["COMBINE", "SERIES", "Request", "Run"]

COMBINE = ("product", "zip")
# What a series can hold besides quantities of metrics.
SERIES = {
    "energy": "every kind of energy [J]",
    "counts": "steps, retries and iterations since the frame before",
    "contacts": "what contact met and resolved since the frame before",
}
_MOST_RUNS = 100_000
_MOST_SEED = 2**62  # so that the last of the runs' seeds is a number of 64 bits in the tables
_MOST = 1e12  # as of the numbers of a scene
_DEFAULT_METRICS = ("lowest", "strain_energy", "kinetic_energy", "contact_error")


@dataclass(frozen=True)
class Run:
    """One run of a sweep.

    Attributes
    ----------
    number : int
        Its place; rows are in this order.
    scene : int
        Which scene.
    settings : dict
        Values by name, drawn ones included.
    seed : int or None
        What it was drawn and disturbed with.
    device : str
        Where collisions are detected.
    error : str or None
        Why there is no such scene.
    name : str
        Fingerprint of all that its results depend on.
    """

    number: int
    scene: int
    settings: Settings
    seed: int | None
    device: str
    error: str | None
    name: str


class Request:
    """A sweep.

    Parameters
    ----------
    scenes : Scene, or mapping of str to Scene
        What runs start from; several are run with every combination.
    vary, combine, fixed, seeds, seed, disturbance, draws, metrics, series, keep, timeout, threads, device
        As for `clothsim.sweep.run`.

    Raises
    ------
    InvalidInput
        Nothing varies, or a key, a metric or a choice is not known; the nearest is named.
    """

    def __init__(
        self,
        scenes: Scene | Mapping[str, Scene],
        vary: Mapping[str, Any] | Sequence[Axis] = (),
        *,
        name: str | None = None,
        combine: str = "product",
        fixed: Mapping[str, Any] | None = None,
        seeds: int | None = None,
        seed: int = 0,
        disturbance: float = 1e-3,
        draws: Mapping[str, Any] | None = None,
        metrics: Sequence[str] | str = _DEFAULT_METRICS,
        series: Sequence[str] | str = (),
        keep: Sequence[str] | str = (),
        timeout: float | None = None,
        threads: int = 1,
        device: str = "cpu",
        checkpoint_interval: float | None = None,
    ) -> None:
        self.scenes = dict(scenes) if isinstance(scenes, Mapping) else {"": scenes}
        for scene in self.scenes.values():
            if not isinstance(scene, Scene):
                raise TypeError(f"scene: expected a clothsim.Scene, got {type(scene).__name__}")
        if name is not None and not isinstance(name, str):
            raise InvalidInput(f"name: expected a text, got {name!r}", name="name", expected="a text")
        self.fixed = dict(fixed or {})
        self.combine = one_of("combine", combine, COMBINE)
        self.axes = _axes(vary, self.combine)
        self.draws = [draw(key, table) for key, table in (draws or {}).items()]
        self.seeds = _seeds(seeds, seed, self.draws)
        self.disturbance = _number("disturbance", disturbance, f"a number ≥ 0, at most {_MOST:g} [m/s]", zero=True)
        self.metrics = [_metric(one) for one in _names("metrics", metrics)]
        known = [*SERIES, *(m.name for m in METRICS.values() if m.kind == "quantity")]
        self.series = [one_of("series", one, known) for one in _names("series", series)]
        seconds = f"a number > 0, at most {_MOST:g} [s]"
        self.timeout = None if timeout is None else _number("timeout", timeout, seconds)
        self.threads, self.device = check_threads(threads) or 1, check_device(device)
        self.checkpoint_interval = None if checkpoint_interval is None else _number(
            "checkpoint_interval", checkpoint_interval, seconds
        )  # fmt: skip
        self.bases = {key: based(scene, self.fixed) for key, scene in self.scenes.items()}
        self.packed = {key: pack_scene(scene) for key, scene in self.scenes.items()}
        self.name = name or next(iter(self.bases.values()))["name"]
        self.keep = self._kept(_names("keep", keep))
        self.runs = self._runs()
        self._check_keys()

    @property
    def digest(self) -> str:
        """Fingerprint of all that results depend on."""
        return fingerprint([self.name, self.timeout, [(run.name, run.error) for run in self.runs], self.combine])

    def _kept(self, wanted: list[str]) -> list[str]:
        known = output_formats(next(iter(self.bases.values())))
        kept = [one_of("keep", one, known) for one in wanted]
        check_packages({**dict.fromkeys(known, False), **dict.fromkeys(kept, True)})
        return kept

    def _points(self) -> list[Settings]:
        names = [a.name for a in self.axes]
        values = [a.values for a in self.axes]
        rows = zip(*values, strict=True) if self.combine == "zip" and values else itertools.product(*values)
        return [dict(zip(names, row, strict=True)) for row in rows]

    def _runs(self) -> list[Run]:
        lengths = [len(a.values) for a in self.axes]
        points = (lengths[0] if self.combine == "zip" else math.prod(lengths)) if lengths else 1
        count = len(self.scenes) * points * len(self.seeds)
        if not self.axes and not self.draws and self.seeds == [None] and len(self.scenes) < 2:
            expected = "values under [vary], [seeds], or several scenes"
            raise InvalidInput(f"sweep: expected {expected}, got nothing that varies", name="vary", expected=expected)
        if count > _MOST_RUNS:
            expected = f"at most {_MOST_RUNS} runs"
            raise InvalidInput(f"sweep: expected {expected}, got {count}", name="vary", expected=expected)
        out: list[Run] = []
        digests = [fingerprint(_core.__version__, packed) for packed in self.packed.values()]
        for at in range(len(self.scenes)):
            for point, seed in itertools.product(self._points(), self.seeds):
                drawn = {d.name: d.value(seed) for d in self.draws} if seed is not None else {}
                settings = {**point, **drawn}
                built = self._built(at, settings)
                what = [digests[at], built.data, seed, self.disturbance, self.metrics, self.series, self.keep]
                number = len(out)
                name = f"{number:06d}-{fingerprint([*what, built.error])}"
                device = "gpu" if built.device == "gpu" else self.device
                out.append(Run(number, at, settings, seed, device, built.error, name))
        return out

    def data(self, run: Run) -> dict[str, Any]:
        """Tables of the scene of a run; made when they are asked for, as they are the most that there is of a run."""
        return self._built(run.scene, run.settings).data

    def _built(self, scene: int, settings: Settings) -> Built:
        axes = [*self.axes, *(d.axis() for d in self.draws)]
        built = build(list(self.bases.values())[scene], axes, settings)
        return built if built.error else replace(
            built, data={**built.data, "output": self._output(built.data["output"])}
        )  # fmt: skip

    def _output(self, output: Mapping[str, Any]) -> dict[str, Any]:
        """What a run writes: of the scene's formats those that are kept."""
        made = {**output, **{key: key in self.keep for key in output_formats({"output": output})}}
        if self.checkpoint_interval is not None:
            made["checkpoint_interval"] = self.checkpoint_interval
        return made

    def _check_keys(self) -> None:
        """Refuse a key with which no run at all can be made."""
        if not self.runs or any(run.error is None for run in self.runs):
            return
        axes = [*self.axes, *(d.axis() for d in self.draws)]
        base = next(iter(self.bases.values()))
        for one in axes:
            errors = [build(base, [one], {one.name: value}).error for value in one.values[:20]]
            if all(errors):
                raise InvalidInput(f"sweep: {one.name}: no value of it makes a scene: {errors[0]}", name=one.name)
        raise InvalidInput(f"sweep: no run can be made: {self.runs[0].error}", name="vary")

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.name, "digest": self.digest, "scenes": list(self.scenes), "combine": self.combine,
            "axes": [{"name": a.name, "key": a.key, "values": list(a.values)} for a in self.axes],
            "draws": [d.facts() for d in self.draws], "fixed": self.fixed,
            "seeds": [s for s in self.seeds if s is not None], "disturbance": self.disturbance,
            "metrics": self.metrics, "series": self.series, "keep": self.keep, "timeout": self.timeout,
            "threads": self.threads, "device": self.device,
        }  # fmt: skip


def output_formats(base: Mapping[str, Any]) -> list[str]:
    """What ``[output]`` can ask for."""
    return [key for key, value in base["output"].items() if isinstance(value, bool) and key != "velocities"]


def _axes(vary: Mapping[str, Any] | Sequence[Axis], combine: str) -> list[Axis]:
    pairs = vary.items() if isinstance(vary, Mapping) else [(a.name, a.values) for a in vary]
    axes = [_axis(name, values, once=combine == "product") for name, values in pairs]
    names = [a.key for a in axes]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise InvalidInput(f"sweep: expected each key once, got {', '.join(twice)} twice", name="vary")
    lengths = {a.name: len(a.values) for a in axes}
    if combine == "zip" and len(set(lengths.values())) > 1:
        got = ", ".join(f"{n} of {name}" for name, n in lengths.items())
        raise InvalidInput(f'sweep: expected as many values of each key with combine = "zip", got {got}', name="vary")
    return axes


def _axis(name: str, values: Any, *, once: bool) -> Axis:
    if name in RUN_AXES:
        where = "clothsim study varies it" if name == "precision" else f"{name} at the top of the sweep is for all runs"
        raise InvalidInput(f"vary: expected a key of the scene, got {name}: {where}", name="vary")
    return axis(name, _row(name, values), most=_MOST_RUNS, once=once)


def _row(name: str, values: Any) -> Any:
    """Values of ``{first, last, count, spacing}``; anything else as it is."""
    if not (isinstance(values, Mapping) and "first" in values):
        return values
    expected = '{ first, last, count } and perhaps spacing = "linear" or "geometric"'
    first, last, count = (values.get(k) for k in ("first", "last", "count"))
    spacing = values.get("spacing", "linear")
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (first, last))
    known = set(values) <= {"first", "last", "count", "spacing"} and spacing in ("linear", "geometric")
    if not (numbers and known and isinstance(count, int) and 1 <= count <= _MOST_RUNS):
        raise InvalidInput(
            f"vary {name}: expected {expected}, got {dict(values)}", name=name or "vary", expected=expected
        )
    if spacing == "geometric" and not (first > 0 and last > 0):  # type: ignore[operator]
        raise InvalidInput(
            f"vary {name}: a geometric row is between numbers > 0, got {dict(values)}", name=name or "vary"
        )
    made = np.geomspace(first, last, count) if spacing == "geometric" else np.linspace(first, last, count)  # type: ignore[arg-type]
    return [float(f"{v:.12g}") for v in made]


def _seeds(seeds: int | None, first: int, draws: Sequence[Draw]) -> list[int | None]:
    if seeds is None:
        if draws:
            raise InvalidInput("seeds: expected how many, as there are draws, got nothing", name="seeds")
        return [None]
    for name, value, least in (("seeds", seeds, 1), ("seed", first, 0)):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            raise InvalidInput(f"{name}: expected a whole number ≥ {least}, got {value!r}", name=name)
    if seeds > _MOST_RUNS:
        raise InvalidInput(f"seeds: expected at most {_MOST_RUNS}, got {seeds}", name="seeds")
    if first > _MOST_SEED:
        raise InvalidInput(f"seed: expected at most {_MOST_SEED}, got {first}", name="seed")
    return [first + k for k in range(seeds)]


def _number(name: str, value: Any, expected: str, *, zero: bool = False) -> float:
    good = isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value <= _MOST
    if not good or (value == 0 and not zero):
        raise InvalidInput(f"{name}: expected {expected}, got {value!r}", name=name, expected=expected)
    return float(value)


def _names(name: str, value: Any) -> list[str]:
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, Sequence) or not all(isinstance(one, str) for one in values):
        raise InvalidInput(f"{name}: expected a list of names, got {value!r}", name=name)
    return list(dict.fromkeys(values))


def _metric(name: str) -> str:
    own = [m.name for m in METRICS.values() if m.kind != "distance"]
    if name in METRICS and name not in own:
        raise InvalidInput(
            f"metrics: {name} compares with a reference, and a sweep has none: clothsim study measures it; "
            f"expected one of {', '.join(own)}",
            name="metrics",
        )
    return one_of("metrics", name, own)
