"""Triangle meshes: arrays, generators, files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim import _core, _formats
from clothsim._arrays import Floats, Ints, floats, indices, number
from clothsim._files import path_from, write_whole
from clothsim._formats import RawMesh
from clothsim.errors import InvalidInput

__all__ = ["Mesh"]


class Mesh:
    """A triangle mesh: positions [m], triangles, and optionally material coordinates [m].

    The arrays are copies and read-only: a mesh does not change.

    Parameters
    ----------
    vertices : (n, 3) array of float64
        Positions [m], finite. float32 and integers are widened.
    triangles : (m, 3) array of int32 or int64
        Vertex indices, counter-clockwise seen from the front.
    uv : (n, 2) or (m, 3, 2) array of float64, optional
        Material coordinates, u along the warp and v along the weft [m]: per vertex, or per triangle corner where a
        vertex lies on a seam and belongs to two panels.
    groups : mapping of str to (k,) array of int, optional
        Named groups of triangles, for regions of another material.

    Raises
    ------
    InvalidInput
        An array has the wrong shape or type, a coordinate is not finite, an index is out of range.
    MeshError
        No triangle, a triangle without area, a vertex in no triangle; the element is named.

    Examples
    --------
    >>> import clothsim as cs
    >>> mesh = cs.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh
    Mesh(3 vertices, 1 triangle)
    >>> mesh.area
    0.5
    """

    __slots__ = ("_groups", "_triangles", "_uv", "_vertices")

    def __init__(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        uv: ArrayLike | None = None,
        groups: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        points = floats(vertices, "vertices", "shape (n, 3)").copy()
        corners = indices(triangles, "triangles").copy()
        corner_uv = None if uv is None else _per_corner(floats(uv, "uv"), len(points), corners)
        _core.check_mesh(points, corners, corner_uv)
        self._adopt(points, corners, corner_uv, _groups(groups or {}, len(corners)))

    def _adopt(
        self, vertices: Floats, triangles: Ints, uv: Floats | None, groups: Mapping[str, Ints] | None = None
    ) -> None:
        self._groups = dict(groups or {})
        for array in (vertices, triangles, uv, *self._groups.values()):
            if array is not None:
                array.flags.writeable = False
        self._vertices = vertices
        self._triangles = triangles
        self._uv = uv

    @classmethod
    def _made(cls, arrays: tuple[Floats, Ints, Floats | None]) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._adopt(*arrays)
        return mesh

    @property
    def vertices(self) -> Floats:
        """Positions [m], shape (n, 3), read-only."""
        return self._vertices

    @property
    def triangles(self) -> Ints:
        """Vertex indices, shape (m, 3), int64, read-only."""
        return self._triangles

    @property
    def uv(self) -> Floats | None:
        """Material coordinates of each triangle's corners [m], shape (m, 3, 2), read-only; None if there are none."""
        return self._uv

    @property
    def groups(self) -> dict[str, Ints]:
        """Triangles of each named group, ascending, int64, read-only; OBJ's ``g``, ``o`` and ``usemtl``."""
        return dict(self._groups)

    @property
    def area(self) -> float:
        """Total area of the triangles [m²]."""
        a, b, c = (self._vertices[self._triangles[:, k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest coordinates [m], each of shape (3,)."""
        return self._vertices.min(axis=0), self._vertices.max(axis=0)

    def transformed(self, matrix: ArrayLike) -> Mesh:
        """Return a copy with its vertices moved by a 4×4 matrix (row-major, acts on column vectors).

        Parameters
        ----------
        matrix : (4, 4) array
            The map of homogeneous coordinates; its upper 3 × 3 part may scale and mirror.

        Examples
        --------
        >>> import clothsim as cs, numpy as np
        >>> up = np.eye(4)
        >>> up[1, 3] = 2.0
        >>> cs.Mesh.grid(1.0, 1.0, 2, 2).transformed(up).bounds[0].tolist()
        [-0.5, 2.0, -0.5]
        """
        m = floats(matrix, "matrix", "shape (4, 4)")
        if m.shape != (4, 4):
            raise InvalidInput(f"matrix: expected shape (4, 4), got shape {m.shape}", name="matrix")
        return Mesh(self._vertices @ m[:3, :3].T + m[:3, 3], self._triangles, self._uv, self._groups)

    # Generators ------------------------------------------------------------------------------------------------

    @classmethod
    def grid(cls, width: float, height: float, nx: int, ny: int) -> Mesh:
        """Make a ``width`` × ``height`` [m] rectangle in the xz-plane, centred, normal +y, with UV in metres.

        ``nx`` × ``ny`` vertices, row by row from −z to +z and within a row from −x to +x.

        Parameters
        ----------
        width : float
            Along x [m].
        height : float
            Along z [m].
        nx : int
            Vertices along x, ≥ 2.
        ny : int
            Vertices along z, ≥ 2.

        Examples
        --------
        >>> import clothsim as cs
        >>> cs.Mesh.grid(2.0, 2.0, 101, 101)
        Mesh(10201 vertices, 20000 triangles, uv)
        """
        return cls._made(
            _core.grid(number(width, "width"), number(height, "height"), _whole("nx", nx), _whole("ny", ny))
        )

    @classmethod
    def disc(cls, radius: float, rings: int) -> Mesh:
        """Make a flat disc [m] in the xz-plane, centred, normal +y, with UV in metres.

        Parameters
        ----------
        radius : float
            Radius [m].
        rings : int
            Rings of triangles about the middle, ≥ 1.
        """
        return cls._made(_core.disc(number(radius, "radius"), _whole("rings", rings)))

    @classmethod
    def ribbon(cls, length: float, width: float, nx: int, ny: int, twist: float = 0.0) -> Mesh:
        """Make a strip along x [m], turned about x by ``twist`` [rad] from end to end; UV is the flat strip.

        Parameters
        ----------
        length : float
            Along x [m].
        width : float
            Across [m].
        nx : int
            Vertices along, ≥ 2.
        ny : int
            Vertices across, ≥ 2.
        twist : float
            Angle between the ends [rad], right-handed about x.
        """
        size = number(length, "length"), number(width, "width")
        return cls._made(_core.ribbon(*size, _whole("nx", nx), _whole("ny", ny), number(twist, "twist")))

    @classmethod
    def cylinder(cls, radius: float, height: float, segments: int, rows: int, *, caps: bool = False) -> Mesh:
        """Make a cylinder about y, centred [m]: open with UV, or closed by caps without.

        Parameters
        ----------
        radius : float
            Radius [m].
        height : float
            Along y [m].
        segments : int
            Vertices around, ≥ 3.
        rows : int
            Rows of squares along, ≥ 1.
        caps : bool
            Close both ends.
        """
        size = number(radius, "radius"), number(height, "height")
        return cls._made(_core.cylinder(*size, _whole("segments", segments), _whole("rows", rows), caps))

    @classmethod
    def cone(cls, radius: float, height: float, segments: int) -> Mesh:
        """Make a closed cone about y [m]: base at −height/2, apex at +height/2.

        Parameters
        ----------
        radius : float
            Radius of the base [m].
        height : float
            Along y [m].
        segments : int
            Vertices around, ≥ 3.
        """
        return cls._made(_core.cone(number(radius, "radius"), number(height, "height"), _whole("segments", segments)))

    @classmethod
    def capsule(cls, radius: float, half_height: float, segments: int, rings: int) -> Mesh:
        """Make a closed capsule about y [m]: a tube of length 2·``half_height`` with a half sphere at both ends.

        Parameters
        ----------
        radius : float
            Radius [m].
        half_height : float
            Half the length of the tube [m].
        segments : int
            Vertices around, ≥ 3.
        rings : int
            Rings of each half sphere, ≥ 1.
        """
        size = number(radius, "radius"), number(half_height, "half_height")
        return cls._made(_core.capsule(*size, _whole("segments", segments), _whole("rings", rings)))

    @classmethod
    def sphere(cls, radius: float, subdivisions: int = 4) -> Mesh:
        """Make a sphere [m]: an icosahedron cut into four ``subdivisions`` times, 20·4ⁿ nearly equal triangles.

        Parameters
        ----------
        radius : float
            Radius [m].
        subdivisions : int
            How often each triangle is cut into four.
        """
        return cls._made(_core.sphere(number(radius, "radius"), _whole("subdivisions", subdivisions)))

    @classmethod
    def box(cls, size: tuple[float, float, float], cells: tuple[int, int, int] = (1, 1, 1)) -> Mesh:
        """Make a closed box [m], centred, with ``cells`` squares of two triangles along each axis.

        Parameters
        ----------
        size : (float, float, float)
            Lengths along x, y and z [m].
        cells : (int, int, int)
            Squares along each axis, ≥ 1.
        """
        lengths = floats(size, "size", "shape (3,) in m")
        if lengths.shape != (3,):
            expected, got = "three lengths in m", f"shape {lengths.shape}"
            raise InvalidInput(f"size: expected {expected}, got {got}", name="size", expected=expected, got=got)
        if not isinstance(cells, (tuple, list, np.ndarray)) or len(cells) != 3:
            expected, got = "three whole numbers", repr(cells)
            raise InvalidInput(f"cells: expected {expected}, got {got}", name="cells", expected=expected, got=got)
        return cls._made(_core.cuboid(lengths.tolist(), [_whole("cells", count) for count in cells]))

    # Files -----------------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Mesh:
        """Read an OBJ, PLY, STL, glTF, GLB or USD file; coordinates are taken as metres (USD: as the stage says).

        Vertices keep the file's order (STL and glTF, which repeat vertices: the order in which triangles first name
        them, equal positions joined). Polygons are triangulated. UV is kept per corner, so seams do not cut the
        cloth. Groups of OBJ faces are kept. USD needs usd-core, ``pip install 'clothsim[usd]'``.

        Parameters
        ----------
        path : str or path
            The file; its suffix says the format.

        Raises
        ------
        MeshError
            The file is missing, unreadable or damaged, or what it holds is no usable mesh.
        """
        where = path_from(path)
        raw = _formats.read(where)
        try:
            return cls(*raw)
        except ValueError as error:
            error.args = (f"{where}: {error.args[0]}", *error.args[1:])
            raise

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write OBJ (UV per corner, groups) or binary PLY (UV if each vertex has one), whole or not at all.

        Parameters
        ----------
        path : str or path
            The file, ``.obj`` or ``.ply``; replaced if it is there.
        """
        where = path_from(path)
        write_whole(where, _formats.write(where, RawMesh(self._vertices, self._triangles, self._uv, self._groups)))

    def __repr__(self) -> str:
        n, m = len(self._vertices), len(self._triangles)
        uv = "" if self._uv is None else ", uv"
        return f"Mesh({n} {'vertex' if n == 1 else 'vertices'}, {m} {'triangle' if m == 1 else 'triangles'}{uv})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        if (self._uv is None) != (other._uv is None):
            return False
        same_uv = self._uv is None or other._uv is None or np.array_equal(self._uv, other._uv)
        return (
            same_uv
            and np.array_equal(self._vertices, other._vertices)
            and np.array_equal(self._triangles, other._triangles)
            and self._groups.keys() == other._groups.keys()
            and all(np.array_equal(self._groups[name], other._groups[name]) for name in self._groups)
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return (Mesh, (self._vertices, self._triangles, self._uv, self._groups))


def _per_corner(uv: Floats, vertex_count: int, triangles: Ints) -> Floats:
    if uv.ndim == 2 and uv.shape == (vertex_count, 2):
        if triangles.size and (triangles.min() < 0 or triangles.max() >= vertex_count):
            return np.zeros((len(triangles), 3, 2))  # check_mesh names the index
        return uv[triangles]
    if uv.shape == (len(triangles), 3, 2):
        return uv.copy()
    expected = f"shape ({vertex_count}, 2) per vertex or ({len(triangles)}, 3, 2) per triangle corner"
    raise InvalidInput(
        f"uv: expected {expected}, got shape {uv.shape}", name="uv", expected=expected, got=f"shape {uv.shape}"
    )


def _groups(groups: Mapping[str, ArrayLike], triangle_count: int) -> dict[str, Ints]:
    """Each group's triangles, ascending and once each."""
    out = {}
    for name, members in groups.items():
        key = f"groups[{name!r}]"
        listed = np.unique(indices(members, key, "shape (k,)"))
        if listed.size and (listed[0] < 0 or listed[-1] >= triangle_count):
            expected, got = f"triangles in 0..{triangle_count}", str(listed[0] if listed[0] < 0 else listed[-1])
            raise InvalidInput(f"{key}: expected {expected}, got {got}", name=key, expected=expected, got=got)
        out[name] = listed
    return out


def _whole(name: str, value: int) -> int:
    """Accept a count for an unsigned parameter."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 0 <= value < 2**32:
        raise InvalidInput(
            f"{name}: expected a whole number ≥ 0, got {value!r}",
            name=name,
            expected="a whole number ≥ 0",
            got=repr(value),
        )
    return int(value)
