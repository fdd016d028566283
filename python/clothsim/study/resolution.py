"""How finely a cloth is meshed, as one number."""

from __future__ import annotations

import copy
import re
from typing import Any

from clothsim.errors import InvalidInput

__all__ = ["counted", "refined", "set_resolution"]

# What counts the cells of a generated mesh: the first key is the one that a resolution names. Vertices where True.
_COUNTS = {
    "grid": (("nx", "ny"), True),
    "ribbon": (("nx", "ny"), True),
    "disc": (("rings",), False),
    "cylinder": (("segments", "rows"), False),
}


def set_resolution(data: dict[str, Any], value: Any) -> None:
    """Set vertices along x (grid, ribbon), rings (disc) or segments (cylinder) of the first cloth; ``"2x"``: times two.

    Other cloths change in proportion, as do the cells across; pins by index move to the vertices at their place.

    Raises
    ------
    InvalidInput
        A cloth's mesh is not generated, the value is no resolution, or a pinned vertex has no place in the mesh.
    """
    factor = None
    for i, cloth in enumerate(data["cloth"]):
        mesh = cloth["mesh"]
        keys, vertices = _COUNTS.get(mesh.get("generator"), ((), False))
        if not keys:
            what = mesh.get("file") or mesh.get("asset") or mesh.get("generator")
            raise InvalidInput(
                f"resolution: expected cloths meshed by one of {', '.join(_COUNTS)}, got {cloth['name']} ({what})",
                name="resolution",
            )
        before = [mesh[k] - vertices for k in keys]
        if factor is None:
            factor = _factor(value, before[0], vertices)
        after = [max(1 if vertices else 3 if k == "segments" else 1, round(factor * n)) for k, n in zip(keys, before)]  # noqa: B905
        mesh.update({k: n + vertices for k, n in zip(keys, after, strict=True)})
        for pin in cloth.get("pins", []):
            if pin.get("vertices"):
                pin["vertices"] = [_moved(v, before, after, i, mesh["generator"]) for v in pin["vertices"]]


def _factor(value: Any, cells_before: int, vertices: bool) -> float:
    if isinstance(value, str) and (match := re.fullmatch(r"([0-9]*\.?[0-9]+)x", value.strip())):
        factor = float(match.group(1))
    elif isinstance(value, int) and not isinstance(value, bool):
        factor = (value - vertices) / cells_before
    else:
        factor = 0.0
    if factor <= 0.0:
        expected = "a whole number of vertices ≥ 2, or a factor such as 2x"
        raise InvalidInput(f"resolution: expected {expected}, got {value!r}", name="resolution", expected=expected)
    return factor


def _moved(vertex: int, before: list[int], after: list[int], cloth: int, generator: str) -> int:
    """Number of the vertex that lies where ``vertex`` lay, in another grid."""
    if generator in ("grid", "ribbon"):
        row, column = divmod(vertex, before[0] + 1)
        at = (column * after[0], row * after[1])
        if at[0] % before[0] == 0 and at[1] % before[1] == 0:
            return at[1] // before[1] * (after[0] + 1) + at[0] // before[0]
    elif vertex == 0:
        return 0
    raise InvalidInput(
        f"resolution: cloth[{cloth}] pins vertex {vertex}, which has no place in the other mesh; pin by box",
        name="resolution",
    )


def counted(data: dict[str, Any], value: Any) -> Any:
    """A resolution as a number; what is none stays as it is, to be refused where it is used."""
    made = copy.deepcopy(data)
    try:
        set_resolution(made, value)
    except InvalidInput:
        return value
    mesh = made["cloth"][0]["mesh"]
    return int(mesh[_COUNTS[mesh["generator"]][0][0]])


def refined(data: dict[str, Any]) -> int:
    """The resolution with twice as many cells."""
    mesh = data["cloth"][0]["mesh"]
    keys, vertices = _COUNTS[mesh["generator"]]
    return int(2 * (mesh[keys[0]] - vertices) + vertices)
