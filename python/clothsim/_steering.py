"""What a pin is steered to, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from numpy.typing import ArrayLike

from clothsim._arrays import floats, number, shape_text
from clothsim.errors import InvalidInput

__all__ = ["steering"]

_Three: TypeAlias = tuple[float, float, float]


def steering(
    names: Sequence[str], cloth: str, pin: int, position: ArrayLike, rotation: Mapping[str, Any] | None, seconds: float
) -> tuple[int, int, _Three, tuple[_Three, float] | None, float]:
    """Cloth by its place in ``names``, pin, displacement [m], axis and angle [rad], and pause [s] for the engine.

    Raises
    ------
    InvalidInput
        There is no such cloth, or a value is not what `Simulation.steer` takes; it is named.
    """
    if cloth not in names:
        expected = f"one of {', '.join(map(repr, names)) or 'no cloth'}"
        raise InvalidInput(f"cloth: expected {expected}, got {cloth!r}", name="cloth", expected=expected)
    if not isinstance(pin, int) or pin < 0:
        raise InvalidInput(f"pin: expected the number of a pin, got {pin!r}", name="pin")
    turn = None
    if rotation is not None:
        if not isinstance(rotation, Mapping) or set(rotation) - {"axis", "angle"} or "angle" not in rotation:
            raise InvalidInput(f"rotation: expected axis and angle, got {rotation!r}", name="rotation")
        axis = _three(rotation.get("axis", (0.0, 1.0, 0.0)), "rotation.axis")
        turn = (axis, number(rotation["angle"], "rotation.angle", "a number [rad]"))
    pause = number(seconds, "seconds", "a finite number > 0 [s]")
    return names.index(cloth), pin, _three(position, "position"), turn, pause


def _three(value: ArrayLike, name: str) -> _Three:
    array = floats(value, name, "shape (3,)")
    if array.shape != (3,):
        raise InvalidInput(f"{name}: expected shape (3,), got {shape_text(array)}", name=name)
    return (float(array[0]), float(array[1]), float(array[2]))
