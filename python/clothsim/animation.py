"""Animated meshes: what a character or any other body that moves as prescribed is made of."""

from __future__ import annotations

import os

from numpy.typing import ArrayLike

from clothsim._arrays import Floats, Ints, floats, indices, number
from clothsim._files import path_from
from clothsim.errors import InvalidInput

__all__ = ["Animation"]


class Animation:
    """An animated mesh of fixed topology: vertices per frame, linear in between.

    Parameters
    ----------
    positions : (frames, n, 3) array of float64
        Vertex positions [m].
    triangles : (m, 3) array of int32 or int64
        Vertex indices.
    fps : float
        Frames per second.
    """

    def __init__(self, positions: ArrayLike, triangles: ArrayLike, fps: float) -> None:
        self.positions: Floats = floats(positions, "positions", "shape (frames, n, 3)")
        self.triangles: Ints = indices(triangles, "triangles")
        self.fps = number(fps, "fps", "frames per second > 0")
        if self.positions.ndim != 3 or self.positions.shape[2] != 3:
            expected, got = "shape (frames, n, 3)", f"shape {self.positions.shape}"
            raise InvalidInput(
                f"positions: expected {expected}, got {got}", name="positions", expected=expected, got=got
            )

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        fps: float | None = None,
        *,
        scale: float = 1.0,
        up: str | None = None,
        scene_up: str = "y",
        animation: str | None = None,
        part: str | None = None,
    ) -> Animation:
        """Read an animated mesh.

        Parameters
        ----------
        path : path
            A folder or a pattern (``walk/*.obj``) of OBJ, PLY or STL frames; a ``.npz`` archive with ``positions`` and
            ``triangles``; glTF with skin, morph targets or moving nodes; USD.
        fps : float, optional
            Frames per second; needed for single frames and archives. glTF and USD are sampled so often: by default 60
            times, or once per time code.
        scale : float
            Metres per unit of the file, on top of the unit that a USD file names.
        up : {"y", "z"}, optional
            The axis that points up in the file; by default what the file says, else ``scene_up``.
        scene_up : {"y", "z"}
            The axis that points up in the scene.
        animation : str, optional
            Name of the animation in a glTF file; by default the only one.
        part : str, optional
            Name of a glTF node or path of a USD prim: only the meshes at and below it.

        Raises
        ------
        MeshError
            Names the file, and the frame, vertex, node or prim where it is not what it must be.
        InvalidInput
            A parameter is out of range, or ``fps`` is missing.
        MissingDependency
            A USD file without usd-core.
        """
        from clothsim._formats import animation as formats

        request = formats.Request(fps, scale, up, scene_up, animation, part)
        raw = formats.read(path_from(path), request)
        rate = fps if fps is not None else raw.fps
        if rate is None:
            expected = "frames per second > 0, which this file does not say"
            raise InvalidInput(f"fps: expected {expected}, got nothing", name="fps", expected=expected)
        return cls(raw.positions, raw.triangles, rate)
