"""Python values into what JSON and TOML hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from clothsim.errors import InvalidScene
from clothsim.friction import Pair

__all__ = ["plain"]


def plain(value: Any, key: str) -> Any:
    """Turn mappings, pairs, sequences and NumPy values into dicts, lists and numbers; ``key`` is named in errors.

    Raises
    ------
    InvalidScene
        A number is NaN or infinite, or a value is of another type.
    """
    if isinstance(value, Pair):
        value = value.to_dict()
    if isinstance(value, Mapping):
        return {str(k): plain(v, f"{key}.{k}" if key else str(k)) for k, v in value.items() if v is not None}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple, range)):
        return [plain(v, f"{key}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        raise _wrong(key, "a finite number", str(value))
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise _wrong(key, "a number, a string, true or false, a list or a table", type(value).__name__)


def _wrong(key: str, expected: str, got: str) -> InvalidScene:
    return InvalidScene(f"{key}: expected {expected}, got {got}", key=key, expected=expected, got=got)
