"""Detection over a sequence of frames of one mesh."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from clothsim import _core
from clothsim._arrays import floats, indices, number
from clothsim._detection import THICKNESS, Detection
from clothsim._device import check_threads
from clothsim.errors import InvalidInput

__all__ = ["SkippingSession"]

Variant = Literal["NoDup", "R-TRI", "nSwD", "SwD"]


class SkippingSession:
    """Find contacts over many frames, with tree update and traversal once per session of several frames.

    The contacts of every frame are those of :func:`detect`, to the bit, whatever the motion; sessions only make
    coherent motion cheaper. Frames may come in any order, and nothing of a session is part of an answer.

    Parameters
    ----------
    triangles : (m, 3) array of int32 or int64
        Vertex indices. They cannot change; the number of vertices is that of the first frame, or of ``rest``.
    rest : (n, 3) array of float64, optional
        Positions that shape the tree [m], such as the flat cloth: what lies together there is boxed together.
        By default those of the first frame.
    bodies : sequence of (int, bool, bool), optional
        Vertex count of each body, whether it is dynamic, and whether it meets itself; triangles come body by body.
        Of two bodies one must be dynamic for them to meet. By default one body that does both.
    variant : {"SwD", "nSwD", "R-TRI", "NoDup"}
        The whole pipeline, or without sessions, also without the distance heuristic, also without boxes of features.
    frames : int, optional
        n_f, frames of a session, 1 to 1000. By default adapted: from ``first_frames``, at most ``most_frames``.
    alpha : float, optional
        α, with ``frames``; by default ``frames`` − 1.
    beta, gamma : float
        β and γ: the room of a vertex is ½(1+α) v Δt + β v′Δt + γ t′, with the mean speed v′ and edge length t′.
    first_frames, most_frames : int
        n_f of the first session (less where the motion is large), and the largest, where it is adapted.
    adapt : {"work", "time"}
        Adapt n_f to counted work, so that runs repeat to the bit, or to measured time.
    low_curvature : bool
        Leave out sub-surfaces of low curvature that cannot meet themselves.
    threads : int, optional
        How many threads; all of the machine's by default.

    Raises
    ------
    InvalidInput
        An argument is not what it should be.

    Examples
    --------
    >>> import clothsim as cs
    >>> sheet = cs.Mesh.grid(1.0, 1.0, 11, 11)
    >>> session = cs.collision.SkippingSession(sheet.triangles, frames=4, threads=1)
    >>> for frame in range(3):
    ...     x_t0 = sheet.vertices + [0.0, 0.001 * frame, 0.0]
    ...     d = session.detect(x_t0, x_t0 + [0.0, 0.001, 0.0], thickness=0.01)
    >>> session.stats["frame"], len(d.vertex_triangle)
    ('skipping', 0)
    """

    def __init__(
        self,
        triangles: ArrayLike,
        *,
        rest: ArrayLike | None = None,
        bodies: Sequence[tuple[int, bool, bool]] | None = None,
        variant: Variant | str = "SwD",
        frames: int | None = None,
        alpha: float | None = None,
        beta: float = 0.2,
        gamma: float = 0.1,
        first_frames: int = 8,
        most_frames: int = 64,
        adapt: Literal["work", "time"] | str = "work",
        low_curvature: bool = True,
        threads: int | None = None,
    ) -> None:
        if alpha is not None and frames is None:
            raise _wrong("alpha", "frames beside it", repr(alpha))
        self._core = _core.SkippingSession(
            indices(triangles, "triangles"),
            None if bodies is None else [_body(body) for body in bodies],
            None if rest is None else floats(rest, "rest", "shape (n, 3)"),
            str(variant),
            None if frames is None else _count(frames, "frames"),
            None if alpha is None else number(alpha, "alpha", "a finite number ≥ 0"),
            _count(first_frames, "first_frames"),
            _count(most_frames, "most_frames"),
            number(beta, "beta", "a finite number ≥ 0"),
            number(gamma, "gamma", "a finite number ≥ 0"),
            str(adapt),
            bool(low_curvature),
            check_threads(threads),
        )
        self._stats: dict[str, Any] = {}

    @property
    def stats(self) -> dict[str, Any]:
        """What the last call did.

        ``frame``: ``"first"`` of a session, ``"skipping"``, or ``"alone"``; ``frames`` and ``alpha``: n_f and α;
        ``pending``, ``admissible``, ``colliding``: pairs on the list, after the distance heuristic, in contact;
        ``dangling_vertices``, ``dangling_triangles``; ``flat_surfaces``, ``flat_triangles``: sub-surfaces left out;
        ``work``: the weighted count that n_f adapts to; ``pair_bytes``: memory of the list [B]; ``seconds``: ``BVHU``
        (tree update), ``BVHT`` (traversal; of a frame alone with its elementary tests), ``ETP`` (elementary tests).
        """
        return self._stats

    def detect(
        self,
        x_t0: ArrayLike,
        x_t1: ArrayLike,
        thickness: float = 0.0,
        mode: Literal["continuous", "discrete"] | str = "continuous",
    ) -> Detection:
        """Find every pair in contact in this frame; see :func:`detect` for the arguments and the result.

        Parameters
        ----------
        x_t0 : (n, 3) array
            Positions at the start of the frame [m].
        x_t1 : (n, 3) array
            Positions at its end [m].
        thickness : float
            Distance that counts as contact [m], ≥ 0.
        mode : {"continuous", "discrete"}
            During the motion, or at ``x_t1`` alone.

        Raises
        ------
        InvalidInput
            An argument is not what it should be, such as another number of vertices than before. The session goes on.
        """
        pairs, stats = self._core.detect(
            floats(x_t0, "x_t0", "shape (n, 3)"),
            floats(x_t1, "x_t1", "shape (n, 3)"),
            number(thickness, "thickness", THICKNESS),
            str(mode),
        )
        self._stats = stats
        return Detection(*pairs, {"method": "session", "device": "cpu", **stats})

    def restart(self) -> None:
        """End the present session: the next frame starts another. No answer depends on it."""
        self._core.restart()


def _wrong(name: str, expected: str, got: str) -> InvalidInput:
    return InvalidInput(f"{name}: expected {expected}, got {got}", name=name, expected=expected, got=got)


def _count(value: int, name: str) -> int:
    try:
        count = operator.index(value)
    except TypeError:
        count = 0
    if not 1 <= count <= 1000 or isinstance(value, bool):
        raise _wrong(name, "a whole number from 1 to 1000", repr(value))
    return count


def _body(body: tuple[int, bool, bool]) -> tuple[int, bool, bool]:
    try:
        count, dynamic, self_collision = body
        count = operator.index(count)
    except (TypeError, ValueError):
        count = -1
        dynamic = self_collision = False
    if count < 0:
        raise _wrong("bodies", "(vertex count, dynamic, self-collision) of each", repr(body))
    return count, bool(dynamic), bool(self_collision)
