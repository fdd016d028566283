"""Where a run begins that goes on from a frame of another one."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import dataclass, field, replace

import numpy as np

from clothsim._arrays import Floats
from clothsim.errors import InvalidInput
from clothsim.recording import Body, Recording
from clothsim.scene import Scene

__all__ = ["Start"]

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Start:
    """The cloth in a frame.

    Attributes
    ----------
    time : float
        Time of the frame [s].
    positions, velocities : (n, 3) float64
        Of all cloth vertices of the scene, in its order [m], [m/s].
    estimated : bool
        The recording has no velocities: these are differences of positions.
    rests : dict of str to (m, 3, 2) float64 or None
        Undeformed shape of each cloth in that recording [m], where it is known.
    """

    time: float
    positions: Floats
    velocities: Floats
    estimated: bool
    rests: dict[str, Floats | None] = field(default_factory=dict)

    @classmethod
    def of(cls, recording: Recording, scene: Scene, frame: int = -1) -> Start:
        """Take frame number ``frame`` (negative: from the end) of a recording with the cloths of ``scene``.

        Velocities that were not recorded are the difference of the frames after and before over their time: exact for
        steady motion, smoothed where something hit in between.

        Raises
        ------
        InvalidInput
            There is no such frame, or the recording has not the scene's cloths.
        """
        count = len(recording)
        if not -count <= frame < count:
            expected = f"a frame of the recording, 0 to {count - 1}" if count else "a recording with frames"
            raise InvalidInput(
                f"frame: expected {expected}, got {frame}", name="frame", expected=expected, got=str(frame)
            )
        at = frame % count
        names = [table["name"] for table in scene.to_dict()["cloth"]]
        known = {body.name: body for body in recording.cloth}
        for name in names:
            if name not in known:
                raise InvalidInput(
                    f"recording: expected the scene's cloth {name!r}, got {', '.join(map(repr, known)) or 'no cloth'}",
                    name="recording",
                )
        before, after = max(at - 1, 0), min(at + 1, count - 1)
        span = float(recording.times[after] - recording.times[before])
        positions, velocities = [], []
        for name in names:
            positions.append(recording.positions(name, at))
            kept = recording.velocities(name, at)
            if kept is None and span > 0.0:
                kept = (recording.positions(name, after) - recording.positions(name, before)) / span
            velocities.append(np.zeros_like(positions[-1]) if kept is None else kept)
        if not recording.has_velocities:
            _logger.warning(
                "the recording has no velocities: they are taken from the differences of its frames "
                "(output.velocities = true keeps them)"
            )
        return cls(
            float(recording.times[at]), np.concatenate(positions), np.concatenate(velocities),
            not recording.has_velocities, {name: recording.rest(name) for name in names},
        )  # fmt: skip

    def undeformed(self, bodies: list[Body]) -> list[Body]:
        """Give cloths that begin deformed, in this frame, the undeformed shape that the recording knew."""
        return [replace(b, rest=self.rests.get(b.name)) if b.rest == "start" else b for b in bodies]

    def digest(self) -> str:
        """Fingerprint of the state."""
        sha = hashlib.sha256(repr(self.time).encode())
        for array in (self.positions, self.velocities):
            sha.update(array.tobytes())
        return sha.hexdigest()
