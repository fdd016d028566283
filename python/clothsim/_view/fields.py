"""What colour maps show, computed from the frames of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats, Ints
from clothsim._view.colours import nice_ceiling
from clothsim.collision import SkippingSession
from clothsim.errors import InvalidInput
from clothsim.recording import Body, Recording, flattened

__all__ = ["REACH", "Fields", "principal_strain"]

# Contact keeps surfaces one thickness apart, so that what rests lies at it and not below it: a quarter more finds it.
REACH = 1.25

# Frames from which the range of a colour map is taken, and the share of the values that lies below its end: single
# triangles that were hit hard, or the moment of fastest fall, do not set the scale.
_SAMPLES = 40
_SHARE = 0.98


def principal_strain(x: Floats, triangles: Ints, rest: Floats) -> Floats:
    """Largest principal strain λ₁ − 1 of each triangle, shape (m,), dimensionless; positive where it is stretched.

    λ₁² is the larger eigenvalue of C = FᵀF, with F = [x₁−x₀, x₂−x₀] [u₁−u₀, u₂−u₀]⁻¹ the deformation gradient from the
    undeformed triangle ``rest`` (m, 3, 2) [m] to ``x`` (n, 3) [m]. NaN where the undeformed triangle has no area.
    """
    u, v = rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0]
    p, q = x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])[:, None]
        first = (p * v[:, 1:] - q * u[:, 1:]) * inverse  # the columns of F
        second = (q * u[:, :1] - p * v[:, :1]) * inverse
        a, b, c = (np.einsum("ij,ij->i", s, t) for s, t in ((first, first), (first, second), (second, second)))
        larger = 0.5 * (a + c) + np.hypot(0.5 * (a - c), b)
        return np.asarray(np.sqrt(larger) - 1.0)


class Fields:
    """Strain, contact, speed and height of every cloth in every frame.

    Parameters
    ----------
    recording : Recording
        The frames.
    thickness : float, optional
        Distance that counts as contact [m]; by default `REACH` times the thickness of the run.
    """

    def __init__(self, recording: Recording, thickness: float | None = None) -> None:
        self._recording = recording
        self._reach = thickness
        self._session: SkippingSession | None = None
        self._triangles = np.zeros((0, 3), np.int64)
        self._rest: dict[str, Floats] = {}
        self.up = 2 if recording.up == "z" else 1

    @property
    def strain_since(self) -> str:
        """What strain is measured against: the rest shape, or the first frame where the rest shape is not known."""
        known = all(self._recording.rest(body) is not None for body in self._recording.cloth)
        return "the undeformed shape" if known else "the first frame (the run kept no undeformed shape)"

    @property
    def reach(self) -> float:
        """Distance up to which surfaces count as in contact [m].

        Raises
        ------
        InvalidInput
            The run had no contact, or was recorded without its thickness.
        """
        if self._reach is not None:
            return self._reach
        if self._recording.thickness is None:
            raise InvalidInput(
                "--color contact: expected a run with contact, got one without, or frames that do not tell its "
                "thickness; --thickness METRES gives a distance that counts as contact",
                name="--color",
            )
        return REACH * self._recording.thickness

    @property
    def has_contact(self) -> bool:
        """Whether contact can be shown."""
        return self._reach is not None or self._recording.thickness is not None

    def strain(self, body: Body, frame: int) -> Floats:
        """Largest principal strain of each triangle [-], shape (m,); 0 where the undeformed triangle has no area."""
        if body.name not in self._rest:
            rest = self._recording.rest(body)
            first = self._recording.positions(body, 0)
            self._rest[body.name] = flattened(first, body.triangles) if rest is None else rest
        x = self._recording.positions(body, frame)
        return np.nan_to_num(principal_strain(x, body.triangles, self._rest[body.name]), nan=0.0, posinf=0.0)

    def speed(self, body: Body, frame: int) -> Floats:
        """Speed of each vertex [m/s], shape (n,); the difference of frames where velocities were not kept."""
        recording = self._recording
        kept = recording.velocities(body, frame)
        if kept is None:
            before, after = max(frame - 1, 0), min(frame + 1, len(recording) - 1)
            span = float(recording.times[after] - recording.times[before])
            if not span > 0.0:
                return np.zeros(body.vertex_count)
            kept = (recording.positions(body, after) - recording.positions(body, before)) / span
        return np.asarray(np.linalg.norm(kept, axis=1))

    def height(self, body: Body, frame: int) -> Floats:
        """Height of each vertex along the scene's up axis [m], shape (n,)."""
        return self._recording.positions(body, frame)[:, self.up]

    def contact(self, frame: int) -> dict[str, NDArray[np.uint8]]:
        """What each vertex of each cloth touches: 0 nothing, 1 cloth, 2 a collider; by body, shape (n,).

        A vertex counts where one of its features (itself, an edge or a triangle at it that comes nearest) is within
        `reach` of another surface.
        """
        bodies = self._recording.bodies
        firsts = np.cumsum([0, *(body.vertex_count for body in bodies)])
        if self._session is None:
            self._triangles = np.concatenate([b.triangles + n for b, n in zip(bodies, firsts, strict=False)])
            kinds = [(b.vertex_count, b.kind == "cloth", True) for b in bodies]
            self._session = SkippingSession(self._triangles, bodies=kinds)
        x = np.concatenate([self._recording.positions(body, frame) for body in bodies])
        found = self._session.detect(x, x, self.reach, mode="discrete")
        cloth = sum(body.vertex_count for body in bodies if body.kind == "cloth")
        touches = np.zeros(len(x), np.uint8)
        corners = self._triangles[found.vertex_triangle[:, 1]]
        sides = [(found.vertex_triangle[:, :1], corners), (found.edge_edge[:, :2], found.edge_edge[:, 2:])]
        for one, other in [*sides, *((b, a) for a, b in sides)]:
            kind = np.where(other[:, 0] < cloth, 1, 2).astype(np.uint8)
            np.maximum.at(touches, one, kind[:, None])
        return {b.name: touches[n : n + b.vertex_count] for b, n in zip(bodies, firsts, strict=False)
                if b.kind == "cloth"}  # fmt: skip

    def values(self, name: str, body: Body, frame: int) -> Floats:
        """Strain, speed or height of each vertex in SI, shape (n,); strain is the mean of the vertex's triangles."""
        if name == "strain":
            return _vertex_means(self.strain(body, frame), body)
        found: Floats = {"speed": self.speed, "height": self.height}[name](body, frame)
        return found

    def span(self, name: str) -> tuple[float, float]:
        """Range of a colour map over the run, in SI: of strain and speed from zero to a round number."""
        count = len(self._recording)
        frames = np.unique(np.linspace(0, count - 1, _SAMPLES).astype(int))
        values = [self.values(name, body, int(f)) for body in self._recording.cloth for f in frames]
        if not values:
            return 0.0, 1.0
        if name == "height":
            low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
            return (low, high) if high > low else (low, low + 1.0)
        top = float(np.quantile(np.concatenate(values), _SHARE))
        if name == "strain":
            return 0.0, nice_ceiling(max(100.0 * top, 0.01)) / 100.0
        return 0.0, nice_ceiling(max(top, 1e-3))


def _vertex_means(values: Floats, body: Body) -> Floats:
    """Mean over each vertex's triangles."""
    corners = body.triangles.reshape(-1)
    count = np.bincount(corners, minlength=body.vertex_count)
    total = np.bincount(corners, weights=np.repeat(values, 3), minlength=body.vertex_count)
    return np.asarray(total / np.maximum(count, 1))
