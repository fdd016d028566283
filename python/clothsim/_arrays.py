"""Arguments into the arrays that the compiled module takes, and optional packages."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.errors import InvalidInput, MissingDependency

__all__ = ["Floats", "Ints", "floats", "indices", "number", "optional", "shape_text"]

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


def floats(value: ArrayLike, name: str, shape: str = "") -> Floats:
    """C-contiguous float64; real numbers that float64 holds exactly are widened, everything else is refused."""
    array = _array(value, name, f"{shape} and float64" if shape else "float64")
    if array.dtype.kind not in "fiu" or array.dtype.itemsize > 8:
        raise _wrong(array, name, f"{shape} and float64" if shape else "float64")
    return np.ascontiguousarray(array, dtype=np.float64)


def indices(value: ArrayLike, name: str, shape: str = "shape (m, 3)") -> Ints:
    """C-contiguous int64 from int32 or int64; other types are refused, not converted."""
    array = _array(value, name, f"{shape} and int32 or int64")
    if array.dtype not in (np.dtype(np.int32), np.dtype(np.int64)) and array.size:
        raise _wrong(array, name, f"{shape} and int32 or int64")
    return np.ascontiguousarray(array, dtype=np.int64)


def number(value: float, name: str, expected: str = "a number") -> float:
    """Accept a real number."""
    if isinstance(value, (bool, str, bytes)):
        raise _no_number(value, name, expected)
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise _no_number(value, name, expected) from error


def _no_number(value: object, name: str, expected: str) -> InvalidInput:
    return InvalidInput(f"{name}: expected {expected}, got {value!r}", name=name, expected=expected, got=repr(value))


def _array(value: ArrayLike, name: str, expected: str) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except ValueError as error:  # rows of unequal length
        got = "rows of unequal length or values that make no array"
        raise InvalidInput(f"{name}: expected {expected}, got {got}", name=name, expected=expected, got=got) from error


def _wrong(array: NDArray[Any], name: str, expected: str) -> InvalidInput:
    got = f"{shape_text(array)}, {array.dtype}"
    return InvalidInput(f"{name}: expected {expected}, got {got}", name=name, expected=expected, got=got)


def shape_text(array: NDArray[Any]) -> str:
    """``"shape (12, 4)"``."""
    return f"shape {array.shape}"


def optional(module: str, *, extra: str, purpose: str) -> Any:
    """Import an optional package; where it is missing, say what it is for and how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise _missing(module, extra, purpose) from error


def demand(module: str, *, extra: str, purpose: str) -> None:
    """Say what `optional` says where a top-level package is not installed, without importing it."""
    if importlib.util.find_spec(module) is None:
        raise _missing(module, extra, purpose)


def _missing(module: str, extra: str, purpose: str) -> MissingDependency:
    package = module.split(".", maxsplit=1)[0]
    return MissingDependency(f"{purpose} needs the package {package}: pip install 'clothsim[{extra}]'")
