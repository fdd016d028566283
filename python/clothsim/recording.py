"""Frames of a run: meshes of fixed topology over time, in memory or in a file that grows."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from clothsim._arrays import Floats, Ints, floats, number
from clothsim._files import path_from
from clothsim.errors import InvalidInput

__all__ = ["Body", "Recording", "body_facts", "flattened"]


@dataclass(frozen=True, eq=False)
class Body:
    """One mesh of a recording.

    Attributes
    ----------
    name : str
        As in the scene.
    kind : {"cloth", "collider"}
        Whether it moves by forces.
    vertex_count : int
        Number of vertices.
    triangles : (m, 3) int64
        Indices of this body's own vertices.
    uv : (m, 3, 2) float64 or None
        Material coordinates per corner [m].
    static : bool
        It stands still: its positions are the same in all frames.
    rest : {"uv", "start"} or (m, 3, 2) float64 or None
        The undeformed shape of a cloth: its ``uv``; its positions in the first frame; per triangle, the corners in the
        triangle's own plane [m]; None where it is not known.
    regions : mapping of str to (k,) int64
        Triangles of each region of a cloth that has a material of its own, ascending, none in two of them.
    """

    name: str
    kind: Literal["cloth", "collider"]
    vertex_count: int
    triangles: Ints
    uv: Floats | None = None
    static: bool = False
    rest: Literal["uv", "start"] | Floats | None = None
    regions: Mapping[str, Ints] = field(default_factory=dict)


class Recording:
    """Positions of every body at every frame.

    Parameters
    ----------
    bodies : sequence of Body
        The meshes, cloth first.
    times : (frames,) float64
        Time of each frame [s].
    moving : (frames, n, 3) float64
        Positions [m] of the bodies that are not static, one after the other in the order of ``bodies``.
    standing : (k, 3) float64
        Positions [m] of the static bodies, likewise.
    velocities : (frames, c, 3) float64, optional
        Velocities [m/s] of all cloth vertices, cloth after cloth.
    fps : float
        Frames per second.
    up : {"y", "z"}
        The axis that points up.
    name : str
        The scene's name.
    thickness : float, optional
        Distance up to which two surfaces were in contact [m]; None where there was no contact, or it is not known.

    Examples
    --------
    >>> import numpy as np, clothsim as cs
    >>> triangle = cs.Body("sail", "cloth", 3, np.array([[0, 1, 2]]))
    >>> frames = cs.Recording([triangle], np.arange(2) / 60, np.zeros((2, 3, 3)))
    >>> frames.positions("sail", 1).shape
    (3, 3)
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        times: Floats,
        moving: Floats,
        standing: Floats | None = None,
        *,
        velocities: Floats | None = None,
        fps: float = 60.0,
        up: str = "y",
        name: str = "",
        thickness: float | None = None,
    ) -> None:
        self.bodies = tuple(bodies)
        self.times = floats(times, "times", "shape (frames,)")
        self.fps = number(fps, "fps", "frames per second > 0")
        self.up = up
        self.name = name
        self.thickness = thickness
        self._moving = moving
        self._standing = np.zeros((0, 3)) if standing is None else standing
        self._velocities = velocities
        self._slices = _slices(self.bodies)
        if self.times.ndim != 1:
            raise InvalidInput(f"times: expected shape (frames,), got shape {self.times.shape}", name="times")
        for what, array in (("moving", moving), ("standing", self._standing), ("velocities", velocities)):
            if array is None and what != "moving":
                continue
            if not (isinstance(array, np.ndarray) and array.dtype == np.float64):
                got = str(getattr(array, "dtype", type(array).__name__))
                raise InvalidInput(f"{what}: expected an array of float64, got {got}", name=what, got=got)
        expected = (len(self.times), sum(b.vertex_count for b in self.bodies if not b.static), 3)
        if moving.shape != expected:
            raise InvalidInput(f"moving: expected shape {expected}, got shape {moving.shape}", name="moving")
        expected = (len(self.times), sum(b.vertex_count for b in self.cloth), 3)
        if velocities is not None and velocities.shape != expected:
            raise InvalidInput(
                f"velocities: expected shape {expected}, got shape {velocities.shape}", name="velocities"
            )

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        span = f", {self.times[0]:g} s to {self.times[-1]:g} s" if len(self) else ""
        return f"Recording({len(self)} frames of {', '.join(b.name for b in self.bodies)}{span})"

    def body(self, name: str) -> Body:
        """Return the body of that name.

        Parameters
        ----------
        name : str
            The body's name in the scene.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        known = ", ".join(repr(b.name) for b in self.bodies)
        raise InvalidInput(f"body: expected one of {known}, got {name!r}", name="body")

    def positions(self, body: Body | str, frame: int) -> Floats:
        """Positions [m] of a body in a frame, shape (n, 3); a copy.

        Parameters
        ----------
        body : Body or str
            A body, or its name.
        frame : int
            Number of the frame; negative: from the end.
        """
        found = self.body(body) if isinstance(body, str) else body
        where = self._slices[found.name]
        return np.array(self._standing[where] if found.static else self._moving[frame][where])

    def velocities(self, body: Body | str, frame: int) -> Floats | None:
        """Velocities [m/s] of a cloth in a frame, shape (n, 3), a copy; None for a collider, or where none are kept.

        Parameters
        ----------
        body : Body or str
            A body, or its name.
        frame : int
            Number of the frame; negative: from the end.
        """
        found = self.body(body) if isinstance(body, str) else body
        if self._velocities is None or found.kind != "cloth":
            return None
        return np.array(self._velocities[frame][self._slices[found.name]])

    def rest(self, body: Body | str) -> Floats | None:
        """Undeformed shape of a cloth: corners of each triangle in a plane of its own [m], shape (m, 3, 2).

        Lengths and angles count; where and how a triangle lies in its plane does not.

        Parameters
        ----------
        body : Body or str
            The cloth, or its name.

        Returns
        -------
        (m, 3, 2) float64 or None
            None for a collider, or where the undeformed shape is not known.
        """
        found = self.body(body) if isinstance(body, str) else body
        if found.kind != "cloth" or found.rest is None:
            return None
        if isinstance(found.rest, np.ndarray):
            return np.array(found.rest)
        if found.rest == "uv":
            return None if found.uv is None else np.array(found.uv)
        return flattened(self.positions(found, 0), found.triangles) if len(self) else None

    def reach(self) -> float:
        """Largest coordinate of any body in any frame, in size [m]; 0 where there is none."""
        parts = (a for a in (self._moving, self._standing) if a.size)
        return max((max(float(a.max()), -float(a.min())) for a in parts), default=0.0)

    @property
    def has_velocities(self) -> bool:
        """Whether velocities were kept."""
        return self._velocities is not None

    @property
    def cloth(self) -> tuple[Body, ...]:
        """The bodies that move by forces."""
        return tuple(b for b in self.bodies if b.kind == "cloth")

    # Files -----------------------------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to one ``.npz``, whole or not at all; equal recordings give equal bytes.

        ``positions`` (frames, n, 3), ``triangles`` (m, 3) and ``uv`` (m, 3, 2; NaN where a cloth has none) hold all
        cloths joined, ``velocities`` (frames, n, 3) where they were kept; ``times`` (frames,);
        ``collider_0_positions`` (frames or 1 if static, n, 3) and ``collider_0_triangles`` each collider; ``rest_0``
        (m, 3, 2) the undeformed shape of a cloth where it is neither its ``uv`` nor the first frame; ``regions_0`` (m,)
        the number of the region of each triangle of a cloth that has regions, −1 for none; ``meta`` a JSON text with
        names, ranges, fps, the up axis and the thickness.

        Parameters
        ----------
        path : str or path
            The file.
        """
        from clothsim._export import archive

        archive.write(self, path_from(path))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Recording:
        """Read what `save` wrote.

        Parameters
        ----------
        path : str or path
            The file.

        Raises
        ------
        InvalidInput
            The file cannot be read, is cut off or damaged, or holds something else; it is named.
        """
        from clothsim._formats import recorded

        where = path_from(path)
        try:
            found = recorded.read(where)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InvalidInput(f"{path}: not a recording that can be read: {reason}", name="path") from error
        bodies = [
            Body(
                b.name,
                "cloth" if b.kind == "cloth" else "collider",
                b.vertex_count,
                b.triangles,
                b.uv,
                b.static,
                b.rest,
                b.regions,
            )
            for b in found.bodies
        ]
        return cls(
            bodies, found.times, found.moving, found.standing, velocities=found.velocities, fps=found.fps, up=found.up,
            name=found.name, thickness=found.thickness,
        )  # fmt: skip

    def save_usd(self, path: str | os.PathLike[str]) -> None:
        """Write a USD stage (``.usdc``, ``.usda``, ``.usd``): time-sampled meshes. Needs usd-core.

        Parameters
        ----------
        path : str or path
            The file.
        """
        from clothsim._export import usd

        usd.write(self, path_from(path))

    def save_gltf(self, path: str | os.PathLike[str]) -> None:
        """Write a binary glTF file (``.glb``) whose morph targets are the frames.

        Parameters
        ----------
        path : str or path
            The file.
        """
        from clothsim._export import gltf

        gltf.write(self, path_from(path))

    def save_pc2(self, folder: str | os.PathLike[str]) -> None:
        """Write a mesh and a point cache (PC2) per body into a new folder.

        Parameters
        ----------
        folder : str or path
            The folder.
        """
        from clothsim._export import pc2

        pc2.write(self, path_from(folder, "folder"))

    def save_vtk(self, folder: str | os.PathLike[str]) -> None:
        """Write VTK files and a ParaView collection, ``scene.pvd``, into a new folder. Needs PyVista.

        Parameters
        ----------
        folder : str or path
            The folder.
        """
        from clothsim._export import vtk

        vtk.write(self, path_from(folder, "folder"))

    def save_sequence(self, folder: str | os.PathLike[str], suffix: str = "obj") -> None:
        """Write one mesh file per frame and body into a new folder: ``<body>_0000.obj`` or ``.ply``.

        Parameters
        ----------
        folder : str or path
            The folder.
        suffix : {"obj", "ply"}
            The format.
        """
        from clothsim._export import sequence

        sequence.write(self, path_from(folder, "folder"), suffix)

    def film_strip(self, path: str | os.PathLike[str], *, moments: int = 8) -> None:
        """Render that many moments side by side into a PNG. Needs PyVista.

        Parameters
        ----------
        path : str or path
            The file.
        moments : int
            How many, ≥ 1; more of them where the cloth moves most.
        """
        from clothsim._export import film_strip

        film_strip.write(self, path_from(path), moments=moments)


def flattened(x: Floats, triangles: Ints) -> Floats:
    """Each triangle of vertices ``x`` (n, 3) laid into a plane of its own [m], shape (m, 3, 2).

    Its first corner is the origin, its first side the axis u: lengths and angles are kept.
    """
    side, other = x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    length = np.linalg.norm(side, axis=1)
    along = np.einsum("ij,ij->i", side, other) / np.where(length > 0.0, length, 1.0)
    across = np.linalg.norm(np.cross(side, other), axis=1) / np.where(length > 0.0, length, 1.0)
    flat = np.zeros((len(triangles), 3, 2))
    flat[:, 1, 0], flat[:, 2, 0], flat[:, 2, 1] = length, along, across
    return flat


def _slices(bodies: Sequence[Body]) -> dict[str, slice]:
    """Where each body lies in the array of the moving or of the static ones."""
    at = {True: 0, False: 0}
    out: dict[str, slice] = {}
    for body in bodies:
        out[body.name] = slice(at[body.static], at[body.static] + body.vertex_count)
        at[body.static] += body.vertex_count
    return out


def body_facts(body: Body) -> dict[str, Any]:
    """Names and sizes of a body, for a report."""
    facts = asdict(body)
    facts["triangle_count"] = len(facts.pop("triangles"))
    facts.pop("uv")
    facts.pop("rest")
    facts["regions"] = {name: len(triangles) for name, triangles in body.regions.items()}
    return facts
