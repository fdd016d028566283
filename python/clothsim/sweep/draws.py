"""Values that are drawn at random for every run, from its seed alone."""

from __future__ import annotations

import math
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._nearest import hint
from clothsim.errors import InvalidInput
from clothsim.study.axes import Axis, axis

__all__ = ["KINDS", "Draw", "draw"]

# Distribution, and what its list holds.
KINDS = {
    "uniform": "low and high",
    "log_uniform": "low and high, both > 0",
    "normal": "mean and standard deviation ≥ 0",
    "integers": "the least and the largest whole number",
    "choice": "values",
}


@dataclass(frozen=True)
class Draw:
    """A key of the scene and the distribution that each seed draws it from."""

    name: str
    key: str
    kind: str
    values: tuple[Any, ...]

    def value(self, seed: int) -> Any:
        """The draw of a seed: it depends on seed and name alone, not on other draws or how many runs there are."""
        random = np.random.default_rng([seed % 2**64, zlib.crc32(self.name.encode())])
        if self.kind == "choice":
            return self.values[int(random.integers(len(self.values)))]
        first, second = self.values
        if self.kind == "integers":
            return int(random.integers(first, second, endpoint=True))
        if self.kind == "normal":
            return float(random.normal(first, second))
        if self.kind == "log_uniform":
            return float(math.exp(random.uniform(math.log(first), math.log(second))))
        return float(random.uniform(first, second))

    def axis(self) -> Axis:
        """As an axis, to be set in a scene."""
        return Axis(self.name, self.key, self.values)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {"name": self.name, "key": self.key, self.kind: list(self.values)}


def draw(name: str, table: Any) -> Draw:
    """Check a distribution: ``{"uniform": [low, high]}`` and its like.

    Raises
    ------
    InvalidInput
        The name is no key of a scene, or there is no such distribution; the nearest is named.
    """
    parameter = name or "draw"
    expected = "one distribution: " + ", ".join(f"{kind} = [{what}]" for kind, what in KINDS.items())
    if not isinstance(table, Mapping) or len(table) != 1:
        raise InvalidInput(f"draw {name}: expected {expected}, got {table!r}", name=parameter, expected=expected)
    kind, values = next(iter(table.items()))
    if kind not in KINDS:
        raise InvalidInput(
            f'draw {name}: expected {expected}, got "{kind}"{hint(kind, KINDS)}', name=parameter, got=str(kind)
        )
    if isinstance(values, str) or not isinstance(values, Sequence) or not values:
        raise InvalidInput(f"draw {name}: {kind} takes a list of {KINDS[kind]}, got {values!r}", name=parameter)
    if kind != "choice":
        _check_numbers(name, kind, values)
    key = axis(name, [0]).key
    return Draw(name, key, kind, tuple(values))


def _check_numbers(name: str, kind: str, values: Sequence[Any]) -> None:
    types = (int,) if kind == "integers" else (int, float)
    good = len(values) == 2 and all(isinstance(v, types) and not isinstance(v, bool) for v in values)
    if good and all(abs(v) <= sys.float_info.max for v in values):
        first, second = values
        ordered = second >= 0 if kind == "normal" else first <= second
        if ordered and (kind != "log_uniform" or first > 0):
            return
    raise InvalidInput(
        f"draw {name}: {kind} takes {KINDS[kind]}, got {list(values)}", name=name or "draw", got=str(values)
    )
