"""What formats of float32 numbers can hold."""

from __future__ import annotations

import numpy as np

from clothsim.errors import InvalidInput
from clothsim.recording import Recording

__all__ = ["check_float32"]


def check_float32(recording: Recording, form: str) -> None:
    """Refuse coordinates that would be infinite in a file of this format.

    Raises
    ------
    InvalidInput
        A coordinate is above the largest float32.
    """
    largest, reach = float(np.finfo(np.float32).max), recording.reach()
    if reach > largest:
        expected = f"coordinates up to {largest:.2g} m to write {form}, whose numbers are float32"
        raise InvalidInput(
            f"recording: expected {expected}, got {reach:.2g} m",
            name="recording",
            expected=expected,
            got=f"{reach:.2g}",
        )
