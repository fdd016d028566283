"""The command line: arguments of every command, and texts of axes, values and keys for studies and stability maps.

A command ends with an exit code and a line, never with a traceback. What would run for long is stopped once its request
has been understood.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from hypothesis import strategies as st

from clothsim import _cli
from clothsim.errors import InvalidInput
from clothsim.stability import job as stability_job
from clothsim.study import axes
from clothsim.study import job as study_job
from fuzz.target import Target, dump_json, load_json

__all__ = ["target"]

_SCENE = """
duration = 0.01
[contact]
thickness = 0.004
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 0.2, height = 0.2, nx = 3, ny = 3 }
[cloth.material]
areal_density = 0.1
in_plane = { model = "spring", stiffness = 10.0 }
bending = { model = "hinge", rigidity = 1e-6 }
[output]
fps = 100
usd = false
film_strip = false
plots = false
"""
_WORDS = ["scene.toml", "none.toml", ".", "out", "out/frames.npz", "drape", "cotton", "4.7", "bowline", "0", "1",
          "-1", "1e400", "nan",
          "", " ", "--", "-", "é", "\0", "auto", "cpu", "dt", "plates", "stretch", "x" * 300]  # fmt: skip
_OPTIONS = ["--help", "--json", "--version", "-o", "--out", "--threads", "--device", "--frames", "--resume",
            "--overwrite", "--quiet",
            "--allow-intersections", "--from", "--frame", "--vary", "--set", "--metric", "--reference", "--cost",
            "--sample",
            "--seeds", "--seed", "--disturbance", "--repeats", "--patience", "--processes", "--limit", "--at", "--jobs",
            "--list", "--quick", "--to", "--format", "--error", "--budget", "--per", "--xyz", "--js"]  # fmt: skip
_COMMANDS = [
    "run",
    "plan",
    "export",
    "study",
    "study",
    "study",
    "tune",
    "stability",
    "reproduce",
    "materials",
    "schema",
    "nothing",
]

_NAMES = st.one_of(
    st.sampled_from([*axes.NAMED, "cloth[0].material", "cloth[0].mesh.nx", "contact.pairs[0].friction", "gravity",
                     "cloth", "cloth[9].x",
                     "gravity[1]", "cloth[0][0]", "time", "output.fps", "collider[0].position[2]", "time.", "cloth[]",
                     "dtt",
                     "cloth[99999999999999999999]", "duration.x", "contact..x"]),
    st.text(max_size=6),
)  # fmt: skip
_VALUES = st.one_of(
    st.sampled_from(["1e-3", "1,2", "1:2:3", "1e-3:1e-1:5", "0:1:3", "1:2:1e9", "nan", "inf", "1e400", "-1", "2x",
                     "0x", ".x", "9e99x", "1.2.3x",
                     "true", "auto", "rk4", "[1,2,3]", "[", "{", "{a=1}", "'", '"x', "{law='coulomb',mu_c=1}",
                     "1979-05-27", "07:32:00",
                     "0b101", "1_0", "99999999999999999999", "[" * 200, "cotton", "denim", "hysteresis", "grid",
                     "f32", ",", "1,1"]),
    st.text(max_size=8),
)  # fmt: skip
_AXIS = st.builds(
    lambda name, equals, value: name + equals + value, _NAMES, st.sampled_from(["=", "=", "=", "", "=="]), _VALUES
)


def target() -> Target:
    """Command lines."""
    word = st.one_of(st.sampled_from(_WORDS), st.sampled_from(_OPTIONS), _AXIS)
    option = st.one_of(
        st.tuples(word),
        st.tuples(st.sampled_from(["--vary", "--set", "--at"]), _AXIS),
        st.tuples(st.sampled_from(_OPTIONS), word),
    )
    cases = st.builds(
        lambda command, scene, options: [command, *scene, *(word for part in options for word in part)],
        st.sampled_from(_COMMANDS), st.sampled_from([["scene.toml"], ["scene.toml", "-o", "out"], []]),
        st.lists(option, max_size=4),
    )  # fmt: skip
    return Target(
        "commands",
        "the command line and the texts of its options",
        cases,
        check,
        dump_json,
        load_json,
        plant,
        quick=200,
    )


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="clothsim-fuzz-")


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _understood(*_: Any, **__: Any) -> Any:
    raise InvalidInput("understood", name="fuzz")


def check(case: list[str]) -> None:
    """Run it here."""
    if "reproduce" in case[:1] and "--list" not in case:
        case = ["reproduce", "--list", *case[1:]]
    out, err = io.StringIO(), io.StringIO()
    folder = Path(_folder().name)
    (folder / "scene.toml").write_text(_SCENE)
    with (
        _inside(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err),
        mock.patch.object(study_job, "run", _understood), mock.patch.object(stability_job, "run", _understood),
    ):  # fmt: skip
        try:
            code: Any = _cli.main(case)
        except SystemExit as end:
            code = end.code
    assert code in (0, 1, 2), f"exit code {code!r}"
    assert code == 0 or err.getvalue().strip(), "a command failed and said nothing"
    assert "Traceback" not in err.getvalue()
    assert len(err.getvalue()) <= 4000, f"{len(err.getvalue())} characters on stderr"
    if code == 0 and "--json" in case and not {"--help", "--version", "--"} & set(case):
        json.loads(out.getvalue())


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A reader of values that takes all that is no TOML for a number."""
    with mock.patch.object(axes, "_value", lambda text: float(text)):
        yield
