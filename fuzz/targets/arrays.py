"""The Python functions that take arrays and numbers, with arrays of every type, shape and layout, and with others.

A call gives an answer, or raises an error of ours (`TypeError` where a value is of another kind altogether). It never
changes its arguments.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import _session, collision, mesh
from clothsim.errors import ClothSimError
from fuzz.target import Target, dump_json, load_json, refused

__all__ = ["target"]

_TYPES = ["f8", "f8", "f8", "i8", "i8", "i4", "f4", "f2", "g", "c16", "?", "u1", "u8", ">f8", ">i8", "O", "U3", "S3",
          "M8[s]", "m8[s]", "V8"]  # fmt: skip
_LAYOUTS = ["C", "C", "F", "strided", "reversed", "readonly", "broadcast", "list", "matrix", "unaligned"]
_FILLS = ["mesh", "mesh", "mesh", "zeros", "nan", "inf", "huge", "tiny", "negative", "large"]
_SHAPES = [[], [0], [3], [0, 3], [3, 0], [4, 3], [4, 3], [4, 3], [2, 3], [4, 2], [1, 1], [4, 4], [2, 4, 3], [1, 8, 3],
           [2, 8, 3],
           [0, 8, 3], [2, 3, 2], [2, 3, 3], [1, 1, 1, 1]]  # fmt: skip
_PLAIN: list[Any] = [
    None, True, 0, 1, -1, 2, 7, 10**400, 2**63, 0.5, -0.5, 1e308, "nan", "inf", "-inf", "", "x", "bvh", "auto", [],
    [[]], {}, [[0, 1, 2]], [[0, 1, "2"]], [[0, 1], [2]], {"a": 1}, "object", "bytes", "complex", "hysteresis",
    "coulomb",
]  # fmt: skip

_ARRAY = st.fixed_dictionaries({
    "dtype": st.sampled_from(_TYPES), "shape": st.sampled_from(_SHAPES), "layout": st.sampled_from(_LAYOUTS),
    "fill": st.sampled_from(_FILLS),
})  # fmt: skip
_VALUE = st.one_of(_ARRAY, _ARRAY, st.sampled_from(_PLAIN).map(lambda value: {"plain": value}))


def _value(made: dict[str, Any]) -> Any:
    """The argument that a case describes."""
    if "plain" in made:
        special = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf, "object": object(), "bytes": b"ab", "complex": 1j}
        plain = made["plain"]
        return special.get(plain, plain) if isinstance(plain, str) else plain
    shape = tuple(made["shape"])
    count = int(np.prod(shape))
    number = {
        "zeros": 0.0,
        "nan": np.nan,
        "inf": np.inf,
        "huge": 1e308,
        "tiny": 5e-324,
        "negative": -1.0,
        "large": 2.0**62,
    }
    # A mesh of four vertices and as many triangles, or as much of it as fits.
    numbers = np.resize([0.0, 1.0, 2.0, 1.0, 3.0, 2.0, 0.0, 2.0, 3.0, 3.0, 1.0, 0.0], count)
    if made["fill"] != "mesh":
        numbers[count // 2 :] = number[made["fill"]]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            array = numbers.reshape(shape).astype(made["dtype"])
        except (ValueError, TypeError):
            array = np.zeros(shape, made["dtype"])
    return _laid_out(array, made["layout"])


def _laid_out(array: Any, layout: str) -> Any:
    match layout:
        case "F":
            return np.asfortranarray(array)
        case "strided" if array.ndim:
            return np.repeat(array, 2, axis=0)[::2]
        case "reversed" if array.ndim:
            return array[::-1]
        case "readonly":
            array.flags.writeable = False
        case "broadcast" if array.ndim and len(array):
            return np.broadcast_to(array[:1], array.shape)
        case "list":
            return array.tolist()
        case "matrix" if array.ndim == 2:
            return np.ma.masked_array(array, mask=False)
        case "unaligned" if array.dtype.kind in "fi" and array.size:
            raw = np.zeros(array.nbytes + 1, np.uint8)
            moved = raw[1:].view(array.dtype).reshape(array.shape)
            moved[...] = array
            return moved
    return array


_X, _T = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]]), np.array([[0, 1, 2], [1, 3, 2]])


def _scene(**keys: Any) -> cs.Scene:
    return cs.Scene(cloth=[{"name": "a", "mesh": cs.Mesh(_X, _T), "material": "cotton", **keys}])


def _session_of(first: Any, second: Any, third: Any) -> Any:
    session = collision.SkippingSession(_T if third is None else third, threads=1)
    return session.detect(first, second, 0.01)


# What is called with three values; what a case leaves out is sound.
CALLS: dict[str, Callable[..., Any]] = {
    "mesh": lambda a, b, c: cs.Mesh(a, b, c),
    "mesh of sound triangles": lambda a, b, c: cs.Mesh(a, _T, b, {"g": c}),
    "transformed": lambda a, b, c: cs.Mesh(_X, _T).transformed(a),
    "detect": lambda a, b, c: collision.detect(a, b, c, "bvh", threads=1),
    "detect of sound triangles": lambda a, b, c: collision.detect(a, b, _T, "brute", thickness=c, threads=1),
    "detect with options": lambda a, b, c: collision.detect(_X, _X, _T, a, mode=b, threads=1, cell_factor=c,
    device="cpu"),
    "self_intersections": lambda a, b, c: collision.self_intersections(a, b, threads=1),
    "vertex_triangle_ccd": lambda a, b, c: collision.vertex_triangle_ccd(a, 0.0 if b is None else b),
    "edge_edge_ccd": lambda a, b, c: collision.edge_edge_ccd(a, 0.0 if b is None else b),
    "session": _session_of,
    "session with options": lambda a, b, c: collision.SkippingSession(_T, rest=a, bodies=b, frames=c, threads=1),
    "bending": lambda a, b, c: cs.bending.trace(a, "hysteresis" if b is None else b, rigidity=1e-5, coercive_couple=c),
    "friction": lambda a, b, c: cs.friction.force("coulomb", a, b, c, mu_c=0.1),
    "friction with options": lambda a, b, c: cs.friction.force("stribeck", 1.0, a, b, mu_c=c, mu_s=0.2, v_s=0.1,
    delta_s=1.0),
    "grid": lambda a, b, c: cs.Mesh.grid(a, b, 3, 2 if c is None else c),
    "box": lambda a, b, c: cs.Mesh.box(a, (1, 1, 1) if b is None else b),
    "animation": lambda a, b, c: cs.Animation(a, b, 24.0 if c is None else c),
    "collider": lambda a, b, c: _scene().add_collider("b", sequence=cs.Animation(a, b, 24.0), position=c),
    "cloth": lambda a, b, c: cs.Simulation(_scene(velocities=a, position=b, pins=c), threads=1, device="cpu"),
    "scene": lambda a, b, c: cs.Scene(duration=a, gravity=b, time=c),
    "simulation": lambda a, b, c: cs.Simulation(_scene(), threads=_few(a),
                                                device="cpu" if b is None else b).advance(_short(c)),
    "material": lambda a, b, c: cs.Material(areal_density=a, in_plane=b, bending=c),
    "fabric": lambda a, b, c: cs.materials.material("cotton", *(() if a is None else (a,)), plasticity=b),
    "recording": lambda a, b, c: cs.Recording([cs.Body("a", "cloth", 4, _T)], a, b, velocities=c),
    "set_friction": lambda a, b, c: cs.Scene(contact={"thickness": a}).set_friction(b, "a", c),
}  # fmt: skip


def _few(threads: Any) -> Any:
    """Not as many as the machine may not have."""
    return 2 if isinstance(threads, int) and threads > 64 else threads


def _short(seconds: Any) -> Any:
    """Not as long as to be waited for."""
    return 0.01 if isinstance(seconds, (int, float)) and seconds > 0.1 else seconds


def target() -> Target:
    """Arguments."""
    cases = st.fixed_dictionaries(
        {"call": st.sampled_from(sorted(CALLS)), "arguments": st.lists(_VALUE, min_size=3, max_size=3)}
    )
    return Target(
        "arrays", "arguments of the Python functions: types, shapes, layouts, values", cases, check, dump_json,
        load_json,
        plant, quick=500,
    )  # fmt: skip


def check(case: dict[str, Any]) -> None:
    """Call it and look at the arguments afterwards."""
    arguments = [_value(made) for made in case["arguments"]]
    before = [a.tobytes() if isinstance(a, np.ndarray) and a.dtype.kind != "O" else None for a in arguments]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            CALLS[case["call"]](*arguments)
        except ClothSimError as error:
            refused(error)
        except TypeError as error:
            assert str(error)
    for argument, content in zip(arguments, before, strict=True):
        assert content is None or argument.tobytes() == content, "an argument was changed"


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A conversion that takes any array for contiguous float64."""
    with (
        mock.patch.object(mesh, "floats", lambda value, *_: np.asarray(value)),
        mock.patch.object(collision, "floats", lambda value, *_: np.asarray(value)),
        mock.patch.object(_session, "floats", lambda value, *_: np.asarray(value)),
    ):
        yield
