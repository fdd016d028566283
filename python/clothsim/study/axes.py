"""Axes of a study: a name or a key of the scene, and the values it takes."""

from __future__ import annotations

import copy
import itertools
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim import _toml
from clothsim._nearest import hint
from clothsim.errors import InvalidInput
from clothsim.scene import Scene
from clothsim.study.resolution import set_resolution

__all__ = ["NAMED", "RUN_AXES", "Axis", "apply", "axis", "axis_kind", "parse", "value_text", "variant"]

# Names for keys of a scene that studies vary most.
_KEYS = {
    "dt": "time.dt",
    "dt_tolerance": "time.dt_tolerance",
    "integrator": "time.integrator",
    "bending_substeps": "time.bending_substeps",
    "newton_tolerance": "time.newton_tolerance",
    "solver": "solver.method",
    "solver_tolerance": "solver.tolerance",
    "thickness": "contact.thickness",
    "detector": "contact.detector",
    "contact_method": "contact.method",
    "friction": "contact.friction",
    "self_friction": "contact.self_friction",
    "air_damping": "air.damping",
}
# What is more than one key, or none of the scene's.
_OTHER = {
    "resolution": "vertices along each generated cloth (of the first one; the others in proportion), or factors: 2x",
    "bending": "bending law of every material (linear, nonlinear, hysteresis, none) or its rigidity [N m]",
    "fabric": "fabric of every cloth",
    "hinges": "coupled or independent, of every material's bending law",
    "threads": "threads of the run",
    "device": "device of collision detection",
    "precision": "f64, or f32: the state is kept in single precision from step to step",
}
NAMED = {**_KEYS, **_OTHER}
# Tables and keys of a scene at the top level, where a path may begin.
_ROOTS = ("time", "solver", "air", "contact", "cloth", "collider", "output", "gravity", "duration")
# Smaller is finer, or larger is; these do not change what the exact answer is.
_REFINES = {
    "time.dt": -1, "time.dt_tolerance": -1, "solver.tolerance": -1, "time.newton_tolerance": -1, "resolution": 1,
}  # fmt: skip
_NUMERIC_ONLY = {
    *_REFINES,
    "time.integrator",
    "time.indefinite",
    "time.bending_substeps",
    "time.newton_max_iterations",
    "time.max_halvings",
    "time.dt_min",
    "time.dt_max",
    "solver.method",
    "solver.max_iterations",
    "contact.detector",
    "contact.method",
    "contact.max_passes",
    "contact.max_zone_passes",
    "threads",
    "device",
    "precision",
}
# How a run is made: no part of a scene.
RUN_AXES = ("threads", "device", "precision")  # fmt: skip
_MOST_VALUES = 1000


@dataclass(frozen=True)
class Axis:
    """What is varied, and its values in the order given.

    Attributes
    ----------
    name : str
        As it was given.
    key : str
        Path in the scene, or a name that stands for more than one.
    values : tuple
        Numbers, strings, lists or tables.
    """

    name: str
    key: str
    values: tuple[Any, ...]

    @property
    def refines(self) -> int:
        """-1 where a smaller value is finer, 1 where a larger one is, 0 where none is."""
        return _REFINES.get(self.key, 0)

    @property
    def numerical(self) -> bool:
        """Whether it changes how the answer is found, not what is asked."""
        return axis_kind(self.key) == "numerical"

    @property
    def is_number(self) -> bool:
        """Whether all values are numbers (or factors)."""
        return all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in self.values)

    def finest(self) -> Any:
        """The finest value of an axis that refines."""
        return (min if self.refines < 0 else max)(self.values, key=_size)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        kind = "numerical" if self.numerical else "physical"
        return {"name": self.name, "key": self.key, "kind": kind, "values": list(self.values)}


def axis_kind(key: str) -> str:
    """``"numerical"`` for what only changes how the answer is found, else ``"physical"``."""
    return "numerical" if key in _NUMERIC_ONLY else "physical"


def axis(name: str, values: Any, *, most: int = _MOST_VALUES, once: bool = True) -> Axis:
    """Check an axis given by name and values: at most so many, and each ``once``.

    Raises
    ------
    InvalidInput
        The name is neither a named axis nor a path into the scene (the nearest is named), or there are no values.
    """
    key = _KEYS.get(name, name)
    if key not in _OTHER and re.split(r"[.\[]", key, maxsplit=1)[0] not in _ROOTS:
        known = [*NAMED, *(root for root in _ROOTS if root != "duration"), "duration"]
        expected = f"one of {', '.join(NAMED)}, or a key of the scene such as contact.friction or cloth[0].material"
        raise InvalidInput(
            f'axis: expected {expected}, got "{name}"{hint(name, known)}', name="axis", expected=expected, got=name
        )
    if isinstance(values, (str, Mapping)) or not isinstance(values, (Sequence, np.ndarray)):
        values = [values]
    found = tuple(v.item() if isinstance(v, np.generic) else v for v in values)
    if not found or len(found) > most:
        expected = f"1 to {most} values"
        raise InvalidInput(f"axis {name}: expected {expected}, got {len(found)}", name=name, expected=expected)
    texts = [value_text(v) for v in found]
    if wild := [t for t, v in zip(texts, found, strict=True) if isinstance(v, float) and not math.isfinite(v)]:
        raise InvalidInput(f"axis {name}: expected finite numbers, got {', '.join(wild)}", name=name, got=wild[0])
    twice = sorted(text for text, times in Counter(texts).items() if times > 1)
    if once and twice:
        raise InvalidInput(f"axis {name}: expected each value once, got {', '.join(twice)} twice", name=name)
    return Axis(name, key, found)


def parse(text: str) -> Axis:
    """``name=v1,v2,…``; a value is TOML or a plain word; ``first:last:count`` stands for a geometric row.

    Raises
    ------
    InvalidInput
        There is no name or no value, or a row is no row.
    """
    name, equals, rest = text.partition("=")
    name, rest = name.strip(), rest.strip()
    if not (name and equals and rest):
        expected = "NAME=VALUE,VALUE,…"
        raise InvalidInput(f'axis: expected {expected}, got "{text}"', name="axis", expected=expected, got=text)
    values: list[Any] = []
    for part in _split(rest):
        values += _row(name, part) if re.fullmatch(r"[^:{}\[\]\"']+:[^:]+:[^:]+", part) else [_value(part)]
    return axis(name, values)


def _split(text: str) -> list[str]:
    """Cut at commas outside brackets and quotes."""
    parts, depth, quote, start = [], 0, "", 0
    for i, c in enumerate(text):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == "," and depth == 0:
            parts.append(text[start:i])
            start = i + 1
    return [p.strip() for p in [*parts, text[start:]] if p.strip()]


def _value(text: str) -> Any:
    try:
        return _toml.loads(f"v = {text}")["v"]
    except (ValueError, RecursionError):
        pass
    try:
        return float(text)  # 1e-3 is TOML, .5 is not
    except ValueError:
        return text


def _row(name: str, text: str) -> list[float]:
    first, last, count = (_value(t.strip()) for t in text.split(":"))
    numbers = all(isinstance(v, (int, float)) and v > 0 for v in (first, last))
    if not (numbers and isinstance(count, int) and 2 <= count <= _MOST_VALUES):
        expected = "first:last:count with numbers > 0 and a whole count ≥ 2"
        raise InvalidInput(f'axis {name}: expected {expected}, got "{text}"', name=name, expected=expected, got=text)
    return [float(f"{v:.6g}") for v in np.geomspace(first, last, count)]


def value_text(value: Any) -> str:
    """A value as it is shown."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        head = next((str(value[k]) for k in ("law", "pair", "model", "fabric") if k in value), "")
        rest = ", ".join(f"{k} {value_text(v)}" for k, v in value.items() if str(v) != head)
        return f"{head} ({rest})" if head and rest else head or f"({rest})"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(value_text(v) for v in value) + "]"
    return str(value)


def _size(value: Any) -> float:
    if value == "auto":
        return math.inf  # of a step: as large as its error allows
    if isinstance(value, str) and re.fullmatch(r"[0-9.]+x", value):
        return float(value[:-1])
    try:
        return float(value)
    except (TypeError, ValueError):
        return 0.0


def variant(scene: Scene, data: dict[str, Any]) -> Scene:
    """Make a scene with the arrays of another and tables of its own."""
    made = copy.copy(scene)
    made._data = data
    made._core = None
    return made


def apply(data: dict[str, Any], key: str, value: Any) -> None:
    """Set one axis in the tables of a scene.

    Raises
    ------
    InvalidInput
        The scene has nothing that it applies to.
    """
    if key in RUN_AXES:
        return
    if key == "resolution":
        set_resolution(data, value)
    elif key in ("bending", "hinges", "fabric"):
        for cloth in data["cloth"]:
            cloth["material"] = _material(cloth["material"], key, value)
    else:
        _set(data, key, value)


def _material(material: Any, key: str, value: Any) -> Any:
    table: dict[str, Any] = {"fabric": material} if isinstance(material, str) else copy.deepcopy(material)
    if key == "fabric":
        return {**(table if "fabric" in table else {}), "fabric": value}
    if "fabric" in table:
        if key == "bending" and not isinstance(value, str):
            raise InvalidInput(
                f"bending: expected the name of a law, as the fabric has its rigidity, got {value_text(value)}",
                name="bending",
            )
        return {**table, key: value}
    law = table.get("bending", {"model": "none"})
    if key == "hinges":
        table["bending"] = {**law, "hinges": value}
    elif isinstance(value, Mapping):
        table["bending"] = dict(value)
    elif isinstance(value, str):
        table["bending"] = {"model": "none"} if value == "none" else {**law, "model": value}
    else:
        table["bending"] = {**law, "rigidity": float(value)}
    return table


def _set(data: dict[str, Any], key: str, value: Any) -> None:
    steps: list[str | int] = [int(a) if a else b for a, b in re.findall(r"\[(\d+)\]|([^.\[\]]+)", key)]
    at: Any = data
    for step, following in itertools.pairwise(steps):
        if isinstance(step, str) and isinstance(at, dict) and at.get(step) is None:
            at[step] = [] if isinstance(following, int) else {}
        at = _enter(at, step, key)
    last = steps[-1]
    if isinstance(last, int):
        _enter(at, last, key)
    elif not isinstance(at, dict):
        raise _no_key(key)
    at[last] = copy.deepcopy(value)


def _enter(at: Any, step: str | int, key: str) -> Any:
    try:
        return at[step]
    except (KeyError, IndexError, TypeError) as error:
        raise _no_key(key) from error


def _no_key(key: str) -> InvalidInput:
    expected = "a key of the scene"
    return InvalidInput(f"axis {key}: expected {expected}; the scene has no such place", name=key, expected=expected)
