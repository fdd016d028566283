"""What touches what, on any pair of frames of one mesh."""

from __future__ import annotations

import logging
from typing import Any, Literal

from numpy.typing import ArrayLike, NDArray

from clothsim import _core
from clothsim._arrays import Floats, Ints, floats, indices, number
from clothsim._detection import THICKNESS, Detection
from clothsim._device import check_threads
from clothsim._session import SkippingSession

__all__ = ["Detection", "SkippingSession", "detect", "edge_edge_ccd", "self_intersections", "vertex_triangle_ccd"]

Method = Literal["brute", "bvh", "session", "grid", "virtual-subdivision", "octree-single", "octree", "auto"]
Mode = Literal["continuous", "discrete"]
Distribution = Literal["binary-search", "segmented-scan"]
Duplicates = Literal["one-sort", "all"]

_logger = logging.getLogger(__name__)


def detect(
    x_t0: ArrayLike,
    x_t1: ArrayLike,
    triangles: ArrayLike,
    method: Method | str = "bvh",
    mode: Mode | str = "continuous",
    thickness: float = 0.0,
    device: str = "cpu",
    threads: int | None = None,
    *,
    cell_factor: float | None = None,
    distribution: Distribution | str | None = None,
    duplicates: Duplicates | str | None = None,
) -> Detection:
    """Find every vertex-triangle and edge-edge pair that shares no vertex and comes within ``thickness``.

    Vertices move in straight lines from ``x_t0`` to ``x_t1``. No pair is missed: what cannot be decided counts as a
    contact. The result has the same bits for any method, any device and any number of threads.

    Parameters
    ----------
    x_t0, x_t1 : (n, 3) array of float64
        Positions at both ends of the step [m].
    triangles : (m, 3) array of int32 or int64
        Vertex indices.
    method : {"bvh", "brute", "session", "grid", "virtual-subdivision", "octree-single", "octree", "auto"}
        On the CPU: ``"bvh"``, a tree of boxes; ``"brute"``, every pair, the oracle, for small meshes; ``"session"``,
        for many frames (:class:`SkippingSession`), of one what ``"bvh"`` does. On a GPU: ``"grid"``, a uniform grid;
        ``"virtual-subdivision"``, a finer one in which large triangles count in parts;
        ``"octree-single"`` and ``"octree"``, adaptive octrees of one and two stages.
        ``"auto"``: ``"bvh"`` on the CPU, ``"virtual-subdivision"`` on a GPU.
    mode : {"continuous", "discrete"}
        The motion, or the end positions ``x_t1`` alone.
    thickness : float
        Distance up to which two features are in contact [m], ≥ 0.
    device : {"cpu", "gpu", "auto"}
        Where to compute. ``"gpu"``: any Vulkan, Metal or DX12 adapter, a software adapter too; opened once per process.
        ``"auto"``: a GPU that is no software adapter, for ``"auto"`` and the GPU's methods; without one, or if it
        fails, ``"bvh"`` on the CPU, with the reason in the log (logger ``clothsim.collision``).
    threads : int, optional
        How many threads; all of the machine's by default.
    cell_factor : float, optional
        λ of ``"virtual-subdivision"`` (thesis Eq. 5.1), 0.1 to 100: cells are 3 λ times the average radius.
        By default 1.2. The contacts do not depend on it.
    distribution : {"binary-search", "segmented-scan"}, optional
        How ``"grid"`` and ``"virtual-subdivision"`` find the tests of each invocation (thesis 5.3.4): by binary search
        in the sums of the tests' counts, the default, or by a scan over all tests, two words of memory per test. The
        contacts and the counts do not depend on it.
    duplicates : {"one-sort", "all"}, optional
        How ``"virtual-subdivision"`` finds several parts of one triangle in one cell (thesis 5.3.3): after one sort, by
        cell, the default, or after sorts by triangle and by cell. The contacts do not depend on it.

    Returns
    -------
    Detection

    Raises
    ------
    InvalidInput
        An argument is not what it should be.
    GpuUnavailable
        ``device="gpu"``, and there is no adapter.
    DeviceError
        ``device="gpu"``, and it gave no answer.

    Examples
    --------
    A vertex falls through a triangle, reaching it half-way:

    >>> import clothsim as cs
    >>> x_t0 = [[0, 0, 0], [1, 0, 0], [0, 0, 1], [0.2, 1, 0.2], [1.2, 1, 0.2], [0.2, 1, 1.2]]
    >>> x_t1 = [[0, 0, 0], [1, 0, 0], [0, 0, 1], [0.2, -1, 0.2], [1.2, 1, 0.2], [0.2, 1, 1.2]]
    >>> d = cs.collision.detect(x_t0, x_t1, [[0, 1, 2], [3, 4, 5]])
    >>> d.vertex_triangle.tolist()
    [[3, 0]]
    >>> round(float(d.time_vertex_triangle[0]), 6)
    0.5
    """
    vertex_triangle, time_vertex_triangle, edge_edge, time_edge_edge, stats, fallback = _core.detect(
        floats(x_t0, "x_t0", "shape (n, 3)"),
        floats(x_t1, "x_t1", "shape (n, 3)"),
        indices(triangles, "triangles"),
        str(method),
        str(mode),
        number(thickness, "thickness", THICKNESS),
        str(device),
        check_threads(threads),
        None if cell_factor is None else number(cell_factor, "cell_factor", "λ from 0.1 to 100"),
        None if distribution is None else str(distribution),
        None if duplicates is None else str(duplicates),
    )
    if fallback is not None:
        has_failed, reason = fallback
        _logger.log(logging.WARNING if has_failed else logging.INFO, "on the CPU instead of a GPU: %s", reason)
    return Detection(vertex_triangle, time_vertex_triangle, edge_edge, time_edge_edge, stats)


def vertex_triangle_ccd(queries: ArrayLike, thickness: float = 0.0) -> tuple[NDArray[Any], Floats]:
    """Say for each query whether a moving vertex and a moving triangle come within ``thickness``, and when first.

    Parameters
    ----------
    queries : (n, 8, 3) array of float64
        Positions [m] of the vertex and the triangle's corners at t0, then the same four at t1.
    thickness : float
        Distance that counts as contact [m], ≥ 0.

    Returns
    -------
    hit : (n,) bool
        False only where there certainly is no contact.
    time : (n,) float64
        Fraction of the step in [0, 1], never later than the true first time; infinity where there is no contact.

    Examples
    --------
    >>> import clothsim as cs
    >>> still = [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
    >>> cs.collision.vertex_triangle_ccd([[[0.2, 1, 0.2], *still, [0.2, 0.5, 0.2], *still]])[0].tolist()
    [False]
    """
    return _core.vertex_triangle_ccd(
        floats(queries, "queries", "shape (n, 8, 3)"), number(thickness, "thickness", THICKNESS)
    )


def edge_edge_ccd(queries: ArrayLike, thickness: float = 0.0) -> tuple[NDArray[Any], Floats]:
    """Say for each query whether two moving edges come within ``thickness``, and when first.

    Parameters
    ----------
    queries : (n, 8, 3) array of float64
        Positions [m] of the ends of the one edge and of the other at t0, then the same four at t1.
    thickness : float
        Distance that counts as contact [m], ≥ 0.

    Returns
    -------
    hit : (n,) bool
        False only where there certainly is no contact.
    time : (n,) float64
        Fraction of the step in [0, 1], never later than the true first time; infinity where there is no contact.
    """
    return _core.edge_edge_ccd(floats(queries, "queries", "shape (n, 8, 3)"), number(thickness, "thickness", THICKNESS))


def self_intersections(x: ArrayLike, triangles: ArrayLike, *, threads: int | None = None) -> Ints:
    """Find the pairs of triangles that pass through each other.

    Parameters
    ----------
    x : (n, 3) array of float64
        Positions [m].
    triangles : (m, 3) array of int32 or int64
        Vertex indices.
    threads : int, optional
        How many threads; all of the machine's by default.

    Returns
    -------
    (k, 2) int64
        Triangles, the lower index first, sorted.

    Examples
    --------
    >>> import clothsim as cs
    >>> x = [[0, 0, 0], [2, 0, 0], [0, 0, 2], [0.5, -1, 0.5], [0.5, 1, 0.5], [0.6, 1, 0.5]]
    >>> cs.collision.self_intersections(x, [[0, 1, 2], [3, 4, 5]]).tolist()
    [[0, 1]]
    """
    return _core.self_intersections(
        floats(x, "x", "shape (n, 3)"), indices(triangles, "triangles"), check_threads(threads)
    )
