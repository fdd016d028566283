"""Numbers with units: as people write them, and as they are shown."""

from __future__ import annotations

import math
import re

from clothsim.errors import InvalidInput

__all__ = ["amount", "parse"]

_SCALES = {"": 1.0, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9, "p": 1e-12}


def parse(text: str, unit: str, name: str) -> float:
    """``"1mm"``, ``"0.5 ms"``, ``"2%"`` or a plain number in ``unit``.

    Raises
    ------
    InvalidInput
        It is none of these, or not above zero.
    """
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([a-zA-Zµ%/]*)\s*", text)
    value = math.nan
    if match:
        number, given = match.groups()
        base = unit if unit not in ("", "-") else ""
        try:
            if not given:
                value = float(number)
            elif given == "%" and not base:
                value = 0.01 * float(number)
            elif base and given.endswith(base) and given[: -len(base)] in _SCALES:
                value = float(number) * _SCALES[given[: -len(base)]]
        except ValueError:
            pass
    if not (math.isfinite(value) and value > 0.0):
        expected = f"a number > 0 in {unit}, such as 1m{unit}" if unit not in ("", "-") else "a number > 0, or per cent"
        raise InvalidInput(f'{name}: expected {expected}, got "{text}"', name=name, expected=expected, got=text)
    return value


def amount(value: float | None, unit: str) -> str:
    """A number with a unit of its size: 3.2 mm, 41 ms, 1.5 MB."""
    if value is None:
        return "–"
    if unit in ("m", "s", "J", "m/s"):
        for scale, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p")):
            if abs(value) >= 0.9995 * scale:
                return f"{value / scale:.3g} {prefix}{unit}"
        return f"{value:.2g} {unit}"
    if unit == "B":
        for scale, prefix in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
            if abs(value) >= scale:
                return f"{value / scale:.3g} {prefix}"
        return f"{value:.0f} B"
    return f"{value:.3g}"
