"""What clothsim raises.

Every class derives from `ClothSimError`. What is wrong with an argument, a mesh or a scene is also a `ValueError`,
so that code which knows nothing of clothsim can handle it.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = [
    "CheckpointError",
    "ClothSimError",
    "ClusterError",
    "DeviceError",
    "GpuUnavailable",
    "IntersectingStart",
    "InvalidInput",
    "InvalidScene",
    "MeshError",
    "MissingDependency",
    "OutputError",
    "OutputExists",
    "SimulationDiverged",
    "SimulationStuck",
    "SolverFailed",
]


class ClothSimError(Exception):
    """Base of every error that clothsim raises on purpose."""


class InvalidInput(ClothSimError, ValueError):
    """An argument is not what it should be.

    Attributes
    ----------
    name : str
        The parameter.
    expected : str
        What it should be, with its unit.
    got : str
        What came.
    """

    def __init__(self, message: str, *, name: str = "", expected: str = "", got: str = "") -> None:
        super().__init__(message)
        self.name = name
        self.expected = expected
        self.got = got


class InvalidScene(ClothSimError, ValueError):
    """A scene, or the file it comes from, does not say something that can be simulated.

    Attributes
    ----------
    file : str or None
        The scene file.
    line : int or None
        Line in that file, from 1.
    key : str
        Dotted path of the key, e.g. ``cloth[0].material``.
    expected : str
        What it should be.
    got : str
        What came.
    nearest : str or None
        The nearest known name, where a name was not known.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        key: str = "",
        expected: str = "",
        got: str = "",
        nearest: str | None = None,
    ) -> None:
        super().__init__(message)
        self.nearest = nearest
        self.file = file
        self.line = line
        self.key = key
        self.expected = expected
        self.got = got


class MeshError(ClothSimError, ValueError):
    """A mesh has a defect; the element is named where there is one.

    Attributes
    ----------
    kind : str
        ``"not-finite"``, ``"index-out-of-range"``, ``"zero-area"``, ``"non-manifold-edge"``, ``"unreferenced"``,
        ``"duplicate-triangle"``, ``"degenerate"``, ``"uv-length"``, ``"uv-not-finite"``, ``"zero-area-uv"``,
        ``"parameter"``, ``"topology"`` (frames of an animation that differ), ``"empty"`` or ``"file"``.
    vertices : tuple of int
        The vertices concerned: the bad one, the triangle's three, the edge's two.
    triangles : tuple of int
        The triangles concerned.
    """

    def __init__(
        self,
        message: str,
        *,
        kind: str = "",
        vertices: Sequence[int] = (),
        triangles: Sequence[int] = (),
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.vertices = tuple(vertices)
        self.triangles = tuple(triangles)


class IntersectingStart(ClothSimError, ValueError):
    """The start state has triangles that pass through each other.

    Attributes
    ----------
    count : int
        How many pairs of triangles.
    pairs : tuple of (int, int)
        The first of them, as global triangle indices.
    """

    def __init__(self, message: str, *, count: int = 0, pairs: Sequence[tuple[int, int]] = ()) -> None:
        super().__init__(message)
        self.count = count
        self.pairs = tuple((int(a), int(b)) for a, b in pairs)


class SimulationDiverged(ClothSimError):
    """A state became non-finite, even with smaller steps; the simulation holds the last good one.

    Attributes
    ----------
    time : float
        Start of the step that failed [s].
    vertices : tuple of int
        Cloth vertices that became non-finite.
    """

    def __init__(self, message: str, *, time: float = 0.0, vertices: Sequence[int] = ()) -> None:
        super().__init__(message)
        self.time = time
        self.vertices = tuple(vertices)


class SimulationStuck(ClothSimError):
    """No motion without a collision was found, even with smaller steps; the simulation holds the last good state.

    Attributes
    ----------
    time : float
        Start of the step that failed [s].
    vertices : tuple of int
        Vertices that still collide.
    count : int
        How many pairs still collide.
    pairs : tuple of (int, int, int, int)
        The four vertices of each: a vertex and its triangle's, or those of two edges.
    """

    def __init__(
        self,
        message: str,
        *,
        time: float = 0.0,
        vertices: Sequence[int] = (),
        count: int = 0,
        pairs: Sequence[tuple[int, int, int, int]] = (),
    ) -> None:
        super().__init__(message)
        self.time = time
        self.vertices = tuple(vertices)
        self.count = count
        self.pairs = tuple((int(a), int(b), int(c), int(d)) for a, b, c, d in pairs)


class SolverFailed(ClothSimError):
    """A stage of a step broke down for a reason that is not the scene's.

    Attributes
    ----------
    stage : str
        The stage.
    """

    def __init__(self, message: str, *, stage: str = "") -> None:
        super().__init__(message)
        self.stage = stage


class CheckpointError(ClothSimError, ValueError):
    """A checkpoint is damaged, or belongs to another version."""


class DeviceError(ClothSimError, RuntimeError):
    """A GPU gave no answer: lost, hung, or out of memory. The next call opens it anew.

    Attributes
    ----------
    device : str
        The adapter with its driver.
    """

    def __init__(self, message: str, *, device: str = "") -> None:
        super().__init__(message)
        self.device = device


class GpuUnavailable(DeviceError):
    """A GPU was asked for, and there is none that can be used.

    Parameters
    ----------
    message : str
        What is missing, and what to do.
    device : str
        The adapter with its driver, where there is one.
    """


class ClusterError(ClothSimError, ConnectionError):
    """The workers of a sweep cannot be reached, or do not start; what has finished is kept."""


class MissingDependency(ClothSimError, ImportError):
    """An optional package is not installed; the message says how to get it."""


class OutputError(ClothSimError, OSError):
    """An output could not be written; nothing half-written is left behind."""


class OutputExists(ClothSimError, FileExistsError):
    """An output is there already, and overwriting it was not asked for."""
