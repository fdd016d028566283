"""Sweep files: damaged examples, tables with odd axes, draws and seeds, products beyond all bounds.

A file is either a sweep whose runs can be listed, handed to a worker and written into tables, or it is refused by an
error that names the file and the parameter.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import math
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from clothsim import _core, _toml
from clothsim._cli import sweep as command
from clothsim.errors import InvalidInput, InvalidScene
from clothsim.sweep import draws, request, tables
from clothsim.sweep.file import read as read_sweep
from clothsim.sweep.request import Request
from fuzz.mutations import JUNK, damaged, damaged_tree, edits, tree_edits
from fuzz.target import File, Target
from fuzz.targets.files import read, written
from fuzz.targets.scenes import DEEP, toml

__all__ = ["target"]

_ROOT = Path(__file__).resolve().parents[2]
_EXAMPLE = (_ROOT / "examples" / "sweep.toml").read_bytes()
_SCENE = _toml.loads(_EXAMPLE.decode())["scene"]
# What a sweep may make here, so that a case takes seconds at most; the bound of the product is the same code.
_MOST_RUNS = 300

_NAMES = st.one_of(
    st.sampled_from([
        "fabric", "friction", "contact.friction", "cloth[0].position", "cloth[0].material", "gravity", "gravity[1]",
        "duration", "time.dt", "dt", "dtt", "resolution", "bending", "air.damping", "output.fps", "output", "threads",
        "device", "precision", "cloth[9].x", "cloth[", "time.", "contact..x", "nothing", "", "name", "cloth",
        "x" * 3000, "cloth[99999999999999999999]", "collider[0].keyframes[0].time", "contact.pairs[0].friction",
    ]),
    st.text(max_size=5),
)  # fmt: skip
_NUMBERS = st.one_of(
    st.sampled_from([0, 1, 2, -1, 0.0, 0.5, 1e-3, -0.5, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf, 2**63,
                     -(2**63), 2**63 - 1, 10**400, True]),
    st.integers(-5, 300),
    st.floats(allow_nan=False, allow_infinity=False),
)  # fmt: skip
_VALUES: SearchStrategy[Any] = st.one_of(
    _NUMBERS,
    st.sampled_from(["cotton", "silk", "denim", "hysteresis", "cottn", "", "grid", "auto", "2x", "y" * 3000,
                     [0, 0.3, 0], [0.0, 0.31, 0.0], {"law": "coulomb", "mu_c": 0.3}, {"fabric": "denim"},
                     {"first": 1}]),
    JUNK,
)  # fmt: skip
_ROW = st.fixed_dictionaries(
    {"first": _NUMBERS, "last": _NUMBERS},
    optional={
        "count": st.one_of(st.integers(-1, 12), st.sampled_from([299, 300, 301, 100_000, 100_001, 2**63, 1.5, True])),
        "spacing": st.sampled_from(["linear", "geometric", "geometrc", 3]),
        "step": st.just(1),
    },
)
_DRAW = st.one_of(
    st.dictionaries(
        st.sampled_from([*draws.KINDS, "unform", "first"]),
        st.one_of(st.lists(_NUMBERS, min_size=2, max_size=2), st.lists(_VALUES, max_size=4), _VALUES),
        min_size=1, max_size=2,
    ),
    _VALUES,
)  # fmt: skip


def _sweeps() -> SearchStrategy[dict[str, Any]]:
    """Tables of sweeps: one in order, with up to four of its parts drawn."""
    bounds = st.builds(
        lambda kind, numbers: {kind: numbers},
        st.sampled_from([*draws.KINDS]),
        st.lists(_NUMBERS, min_size=2, max_size=2),
    )
    drawn = st.dictionaries(
        st.sampled_from(["friction", "air.damping", "dt"]), st.one_of(bounds, bounds, _DRAW), min_size=1, max_size=2
    )
    seeds = st.fixed_dictionaries(
        {"count": st.one_of(st.integers(1, 4), st.integers(1, 4), _NUMBERS)},
        optional={
            "first": st.one_of(st.integers(0, 9), st.sampled_from([2**64, 2**63 - 1]), _NUMBERS),
            "disturbance": _NUMBERS, "draw": st.dictionaries(_NAMES, _DRAW, max_size=3), "cuont": st.just(1),
        },
    )  # fmt: skip
    names = st.lists(st.sampled_from(["lowest", "drape", "energy_drift", "energy", "contacts", "counts", "npz", "usd",
                                      "hausdorff", "lowst", "", "z" * 3000]), max_size=3)  # fmt: skip
    parts: dict[str, SearchStrategy[Any]] = {
        "scene": st.one_of(st.sampled_from(["scene.toml", ["scene.toml", "scene.toml"], ["scene.toml", "other.toml"],
                                            "none.toml", ".", "\0", "w" * 3000, [], [3]]), _VALUES),
        "vary": st.dictionaries(_NAMES, st.one_of(st.lists(_VALUES, max_size=4), _ROW, _VALUES), max_size=3),
        "seeds": st.one_of(*[st.builds(lambda draw: {"count": 2, "draw": draw}, drawn)] * 3, seeds),
        "set": st.dictionaries(_NAMES, _VALUES, max_size=2),
        "combine": st.sampled_from(["product", "zip", "zpi", 3]), "name": st.one_of(st.text(max_size=5), _VALUES),
        "metrics": names, "series": names, "keep": names, "timeout": _NUMBERS, "retries": _NUMBERS,
        "threads": _NUMBERS, "device": st.sampled_from(["cpu", "auto", "gpu", "tpu", 1]),
        "checkpoint_interval": _NUMBERS, "varry": st.just({}), "q" * 3000: st.just(1),
    }  # fmt: skip
    part = st.one_of([st.tuples(st.just(name), values) for name, values in parts.items()])
    return st.lists(part, max_size=4).map(lambda drawn: {"scene": _SCENE, "seeds": {"count": 2}, **dict(drawn)})


def target() -> Target:
    """Sweep files."""
    tree = _toml.loads(_EXAMPLE.decode())
    made = st.one_of(_sweeps(), st.builds(damaged_tree, st.one_of(st.just(tree), _sweeps()), tree_edits(3)))
    tables_of = made.filter(lambda one: isinstance(one, dict))
    return Target(
        "sweeps", "sweep files: axes, draws, seeds, products",
        st.one_of(
            st.builds(lambda todo: File(".toml", damaged(_EXAMPLE, todo)), edits()),
            *[tables_of.map(lambda one: File(".toml", toml(one).encode("utf-8", "surrogatepass")))] * 3,
            DEEP.map(lambda text: File(".toml", (text + "\n").encode() + _EXAMPLE)),
            DEEP.map(lambda text: File(".toml", b"[vary]\n" + text.encode())),
        ),
        check, lambda case: (case.suffix, case.content), File, plant, quick=100,
    )  # fmt: skip


@functools.cache
def _scenes() -> None:
    """The scenes that a file may name, beside it."""
    folder = written(File(".toml", b"")).parent
    for name in ("scene", "other"):
        (folder / f"{name}.toml").write_text(toml({**_SCENE, "name": name}))


def check(case: File) -> None:
    """Read it, list its runs, hand them out, and make tables of them."""
    _scenes()
    with mock.patch.object(request, "_MOST_RUNS", _MOST_RUNS):
        asked = read(case, _named, InvalidInput, InvalidScene)
    if asked is None:
        return
    sweep: Request = asked.request
    assert 1 <= len(sweep.runs) <= _MOST_RUNS
    assert [run.number for run in sweep.runs] == list(range(len(sweep.runs)))
    assert len({run.name for run in sweep.runs}) == len(sweep.runs), "two runs of one name share a folder"
    for run in sweep.runs:
        pickle.dumps(dataclasses.astuple(run))
        if run.error is None:
            _core.Scene.from_json(json.dumps(sweep.data(run), allow_nan=False))
        for drawn in sweep.draws:
            if run.seed is not None:
                _drawn(drawn, run.settings[drawn.name])
    json.dumps(command._listing(sweep), ensure_ascii=False)
    assert len(command._text(sweep)) <= 40 * 2000
    none = [{"error": run.error or "none", "error_type": "Unbuildable", "metrics": {}} for run in sweep.runs]
    assert tables.runs_table(sweep, none).num_rows == tables.costs_table(sweep, none).num_rows == len(sweep.runs)


def _named(path: Path) -> Any:
    """Read a sweep; an error has to say of which parameter it speaks."""
    try:
        return read_sweep(path)
    except InvalidInput as error:
        assert error.name, f"an error that names no parameter: {error}"
        raise


def _drawn(drawn: draws.Draw, value: Any) -> None:
    """Hold what a seed has drawn against its distribution."""
    if drawn.kind == "choice":
        assert value in drawn.values or math.isnan(value)
        return
    first, second = drawn.values
    assert math.isfinite(value), f"{drawn}: drew {value}"
    if drawn.kind != "normal":
        slack = 1e-12 * max(abs(first), abs(second))  # of rounding in exp(log)
        assert first - slack <= value <= second + slack, f"{drawn}: drew {value}"


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A reader that takes any numbers as the bounds of a draw."""
    with mock.patch.object(draws, "_check_numbers", lambda *_: None):
        yield
