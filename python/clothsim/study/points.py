"""The points of a study: combinations of values, and the scenes they make."""

from __future__ import annotations

import copy
import itertools
import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from clothsim import _core
from clothsim._device import DEVICES, GPU_METHODS, check_threads
from clothsim._nearest import one_of
from clothsim.errors import ClothSimError, InvalidInput
from clothsim.study.axes import Axis, apply, value_text

__all__ = ["Built", "Settings", "build", "check_contact", "check_each", "check_values", "label", "product"]

# Name of an axis and its value, for every axis.
Settings = dict[str, Any]
_MOST_POINTS = 20_000
# A material's fabric comes before its law, both before single keys.
_FIRST = ("resolution", "fabric", "bending", "hinges")
_PRECISIONS = ("f64", "f32")


@dataclass(frozen=True)
class Built:
    """Tables of a point's scene and how to run it, or why it cannot be."""

    data: dict[str, Any]
    threads: int = 1
    device: str = "cpu"
    precision: str = "f64"
    error: str | None = None


def product(axes: Sequence[Axis], sample: int | None = None, seed: int = 0) -> list[Settings]:
    """All combinations, in order; or a seeded sample of them in which every value occurs if ``sample`` allows it.

    Raises
    ------
    InvalidInput
        No axis has two values, an axis comes twice, or there are too many combinations.
    """
    if not any(len(axis.values) > 1 for axis in axes):
        expected = "an axis with two values or more, such as dt=0.01,0.005"
        raise InvalidInput(f"study: expected {expected}, got nothing that varies", name="vary", expected=expected)
    for attribute in ("name", "key"):
        names = [getattr(axis, attribute) for axis in axes]
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise InvalidInput(f"study: expected each axis once, got {', '.join(twice)} twice", name="vary")
    count = math.prod(len(axis.values) for axis in axes)
    if count > _MOST_POINTS and sample is None:
        expected = f"at most {_MOST_POINTS} combinations, or a sample of them"
        raise InvalidInput(f"study: expected {expected}, got {count}", name="vary", expected=expected)
    if sample is None or sample >= count:
        return [
            dict(zip([a.name for a in axes], values, strict=True))
            for values in itertools.product(*(a.values for a in axes))
        ]
    if sample < 1:
        raise InvalidInput(f"sample: expected a whole number ≥ 1, got {sample}", name="sample")
    return _sampled(axes, count, sample, seed)


def _sampled(axes: Sequence[Axis], count: int, sample: int, seed: int) -> list[Settings]:
    chance = random.Random(seed)
    sizes = [len(axis.values) for axis in axes]
    # Rows of a random Latin design first, so that every value occurs; then others at random.
    chosen: list[int] = []
    columns = [chance.sample(range(n), n) for n in sizes]
    rows = [[column[k % len(column)] for column in columns] for k in range(min(sample, max(sizes)))]
    for row in rows:
        number = 0
        for k, n in zip(row, sizes, strict=True):
            number = number * n + k
        if number not in chosen:
            chosen.append(number)
    while len(chosen) < sample:
        number = chance.randrange(count)
        if number not in chosen:
            chosen.append(number)
    points = []
    for number in sorted(chosen):
        values, rest = [], number
        for axis in reversed(axes):
            rest, k = divmod(rest, len(axis.values))
            values.append(axis.values[k])
        points.append(dict(zip([a.name for a in axes], reversed(values), strict=True)))
    return points


def build(base: Mapping[str, Any], axes: Sequence[Axis], settings: Settings) -> Built:
    """Make the scene of a point; what cannot be built says why."""
    data, run = copy.deepcopy(dict(base)), Built({})
    order = {name: k for k, name in enumerate(_FIRST)}
    try:
        for axis in sorted(axes, key=lambda a: order.get(a.key, len(order))):
            if axis.name not in settings:
                continue
            value = settings[axis.name]
            if axis.key == "threads":
                run = replace(run, threads=check_threads(value) or 1)
            elif axis.key == "device":
                run = replace(run, device=one_of("device", value, DEVICES, value_text(value)))
            elif axis.key == "precision":
                run = replace(run, precision=one_of("precision", value, _PRECISIONS, value_text(value)))
            else:
                apply(data, axis.key, value)
        checked = json.loads(_core.Scene.from_json(json.dumps(data)).to_json())
    except ClothSimError as error:
        return replace(run, data=data, error=str(error))
    detector = (checked.get("contact") or {}).get("detector")
    if detector in GPU_METHODS and all(axis.key != "device" for axis in axes):
        run = replace(run, device="gpu")
    return replace(run, data=checked)


def check_contact(base: Mapping[str, Any], axes: Sequence[Axis]) -> None:
    """Refuse to vary how contact is made in a scene that has none: it would get one of a thickness nobody asked for.

    Raises
    ------
    InvalidInput
        An axis is a key of ``[contact]``, the scene has no such table, and neither has an axis its ``thickness``.
    """
    inner = [axis for axis in axes if axis.key.startswith("contact.")]
    if base.get("contact") is None and inner and all(axis.key != "contact.thickness" for axis in inner):
        expected = "a scene with [contact]; a thickness adds it, such as --set thickness=0.004"
        raise InvalidInput(f"axis {inner[0].name}: expected {expected}; this one has none", name=inner[0].name)


def check_each(base: Mapping[str, Any], axes: Sequence[Axis]) -> None:
    """Refuse a text that is no value of its axis, whatever else is asked.

    Raises
    ------
    InvalidInput
        With the scene's own words, which name the nearest known value.
    """
    for axis in axes:
        for value in axis.values:
            error = build(base, [axis], {axis.name: value}).error if isinstance(value, str) else None
            if error is not None and f'"{value}"' in error:
                raise InvalidInput(f"axis {axis.name} = {value}: {error}", name=axis.name, got=value)


def check_values(base: Mapping[str, Any], axes: Sequence[Axis], points: Sequence[Settings]) -> None:
    """Refuse a value with which no combination makes a scene: it is wrong by itself.

    Raises
    ------
    InvalidInput
        With the scene's own words, which name the nearest known value.
    """
    good: dict[str, set[str]] = {axis.name: set() for axis in axes}
    bad: dict[tuple[str, str], str] = {}
    for point in points:
        error = build(base, axes, point).error
        for name, value in point.items():
            if error is None:
                good[name].add(value_text(value))
            else:
                bad.setdefault((name, value_text(value)), error)
    wrong = [(name, text, error) for (name, text), error in bad.items() if text not in good[name]]
    if wrong:
        by_name = {axis.name: axis for axis in axes}

        def alone(name: str, text: str) -> bool:
            value = next(v for v in by_name[name].values if value_text(v) == text)
            return build(base, [by_name[name]], {name: value}).error is not None

        name, text, error = next((w for w in wrong if alone(w[0], w[1])), wrong[0])
        raise InvalidInput(f"axis {name} = {text}: {error}", name=name, got=text)


def label(settings: Mapping[str, Any], names: Sequence[str] | None = None) -> str:
    """``"rk4, dt 0.001"``: words by themselves, numbers with their name."""
    parts = []
    for name in settings if names is None else names:
        value = settings[name]
        alone = isinstance(value, str) and not value.endswith("x")
        parts.append(value_text(value) if alone else f"{name} {value_text(value)}")
    return ", ".join(parts)
