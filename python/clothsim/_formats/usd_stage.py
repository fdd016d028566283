"""Meshes of a USD stage at its time codes, skinned by UsdSkel where they are: read with usd-core.

As a program it reads for `clothsim._formats.usd`: ``python -m clothsim._formats.usd_stage FILE REQUEST FOLDER``.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints, optional
from clothsim._formats.animation import RawAnimation, Request, allocate
from clothsim._formats.polygons import triangulate
from clothsim.errors import MeshError

__all__ = ["MOST_FRAMES", "load"]

# Frames that a stage may have: nine hours at 30 per second.
MOST_FRAMES = 1_000_000


def load(path: Path, request: Request, *, most_frames: int | None = None) -> RawAnimation:
    """Positions [m] of all visible meshes (or those at ``request.part`` and below), one body, in the stage's axes.

    Sampled once per time code from the stage's start to its end, or ``request.fps`` times a second. Polygons become
    triangles in the first frame; subdivision surfaces are taken as their control meshes.
    """
    with _in_words(path):
        return _load(path, request, most_frames)


def _load(path: Path, request: Request, most_frames: int | None) -> RawAnimation:
    usd = optional("pxr.Usd", extra="usd", purpose="reading USD")
    geom = optional("pxr.UsdGeom", extra="usd", purpose="reading USD")
    stage = _open(path)
    unit = float(geom.GetStageMetersPerUnit(stage))
    if not (math.isfinite(unit) and unit > 0.0):
        raise MeshError(f"{path}: metersPerUnit: expected a finite number > 0, got {unit}", kind="file")
    root = stage.GetPseudoRoot()
    if request.part is not None:
        root = stage.GetPrimAtPath(request.part) if request.part.startswith("/") else None
        if not root:
            raise MeshError(
                f"{path}: part: expected the path of a prim, such as /World/body, got {request.part!r}", kind="file"
            )
    _bake(stage)
    prims = [p for p in usd.PrimRange(root, usd.TraverseInstanceProxies()) if p.IsA(geom.Mesh) and _visible(geom, p)]
    codes, fps = _codes(stage, request, path, [geom.Mesh(p) for p in prims])
    if most_frames is not None:
        codes = codes[:most_frames]
    parts = [_Part(geom, prim, path, codes[0]) for prim in prims]
    if not sum(len(part.triangles) for part in parts):
        raise MeshError(f"{path}: expected at least one mesh with a face, got none", kind="empty")
    firsts = np.cumsum([0, *(part.count for part in parts)]).tolist()
    positions = allocate(path, len(codes), firsts[-1])
    for frame, code in enumerate(codes):
        cache = geom.XformCache(code)
        for part, first in zip(parts, firsts, strict=False):
            positions[frame, first : first + part.count] = part.positions(cache, code, frame) * unit
    triangles = np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=False)])
    return RawAnimation(positions, triangles, fps, str(geom.GetStageUpAxis(stage)).lower())


def _open(path: Path) -> Any:
    usd = optional("pxr.Usd", extra="usd", purpose="reading USD")
    if not path.is_file():
        raise MeshError(f"{path}: cannot read the mesh: no such file", kind="file")
    with _in_words(path):
        return usd.Stage.Open(str(path))


@contextmanager
def _in_words(path: Path) -> Iterator[None]:
    """Turn what usd-core raises over a damaged file into a `MeshError` that names it."""
    tf = optional("pxr.Tf", extra="usd", purpose="reading USD")
    try:
        yield
    except MeshError:
        raise
    except (tf.ErrorException, RuntimeError, ValueError, TypeError, OverflowError) as error:
        try:
            reason = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())
        except UnicodeDecodeError:  # it quotes the file's bytes
            reason = "it is damaged"
        raise MeshError(f"{path}: not a USD file that can be read: {reason}", kind="file") from error


def _bake(stage: Any) -> None:
    """Let UsdSkel write the skinned points into the session layer, which is in memory only."""
    skel = optional("pxr.UsdSkel", extra="usd", purpose="reading USD")
    gf = optional("pxr.Gf", extra="usd", purpose="reading USD")
    roots = [prim for prim in stage.Traverse() if prim.IsA(skel.Root)]
    if roots:
        # USD stretches the times of a layer whose rate is not the stage's.
        stage.GetSessionLayer().timeCodesPerSecond = stage.GetTimeCodesPerSecond()
        stage.SetEditTarget(stage.GetSessionLayer())
        for root in roots:
            skel.BakeSkinning(skel.Root(root), gf.Interval.GetFullInterval())


def _visible(geom: Any, prim: Any) -> bool:
    image = geom.Imageable(prim)
    return str(image.ComputePurpose()) in ("default", "render") and str(image.ComputeVisibility()) != "invisible"


def _codes(stage: Any, request: Request, path: Path, meshes: list[Any]) -> tuple[list[float], float]:
    """Time codes to look at, and how many of them make a second."""
    rate = float(stage.GetTimeCodesPerSecond())
    start, end = float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())
    if not stage.HasAuthoredTimeCodeRange():
        times = [t for mesh in meshes for t in _samples(mesh)]
        start, end = (min(times), max(times)) if times else (0.0, 0.0)
    if not (math.isfinite(rate) and rate > 0.0 and math.isfinite(end - start) and end >= start):
        raise MeshError(
            f"{path}: expected timeCodesPerSecond > 0 and startTimeCode ≤ endTimeCode, got {rate}, {start} and {end}",
            kind="file",
        )
    fps = request.fps or rate
    count = math.floor((end - start) / rate * fps + 1e-9) + 1
    if count > MOST_FRAMES:
        raise MeshError(f"{path}: expected at most {MOST_FRAMES} frames, got {count}", kind="file")
    return [start + k * rate / fps for k in range(count)], fps


def _samples(mesh: Any) -> Iterator[float]:
    """Time codes at which the points of a mesh, or what carries it, are given."""
    geom = optional("pxr.UsdGeom", extra="usd", purpose="reading USD")
    yield from mesh.GetPointsAttr().GetTimeSamples()
    prim = mesh.GetPrim()
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(geom.Xformable):
            yield from geom.Xformable(prim).GetTimeSamples()
        prim = prim.GetParent()


class _Part:
    """One mesh prim."""

    def __init__(self, geom: Any, prim: Any, path: Path, code: float) -> None:
        self._prim = prim
        self._where = f"{path}, {prim.GetPath()}"
        self._points = geom.Mesh(prim).GetPointsAttr()
        mesh = geom.Mesh(prim)
        for attribute in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()):
            self._check_fixed(attribute)
        points = self._at(code)
        self.count = len(points)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get(code) or [], dtype=np.int64)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(code) or [], dtype=np.int64)
        self.triangles = self._triangulated(points, counts, corners)
        if str(mesh.GetOrientationAttr().Get()) == "leftHanded":
            self.triangles = self.triangles[:, ::-1]

    def _check_fixed(self, attribute: Any) -> None:
        times = attribute.GetTimeSamples()
        first = attribute.Get(times[0]) if times else None
        for time in times[1:]:
            if attribute.Get(time) != first:
                raise MeshError(
                    f"{self._where}: expected one topology, got {attribute.GetName()} that changes at code {time:g}",
                    kind="topology",
                )

    def _at(self, code: float) -> Floats:
        points = self._points.Get(code)
        return np.zeros((0, 3)) if points is None else np.asarray(points, dtype=np.float64).reshape(-1, 3)

    def _triangulated(self, points: Floats, counts: Ints, corners: Ints) -> Ints:
        if (counts < 0).any() or counts.sum() != len(corners):
            raise MeshError(
                f"{self._where}: expected as many faceVertexIndices as faceVertexCounts say ({counts.sum()}), "
                f"got {len(corners)}",
                kind="topology",
            )
        bad = (corners < 0) | (corners >= len(points))
        if bad.any():
            raise MeshError(
                f"{self._where}: expected faceVertexIndices in 0..{len(points)}, got {int(corners[bad][0])}",
                kind="topology",
            )
        if (counts == 3).all():
            return corners.reshape(-1, 3)
        rows: list[Ints] = []
        for polygon in np.split(corners, np.cumsum(counts)[:-1]):
            rows.extend(polygon[list(local)] for local in triangulate(points[polygon]))
        return np.stack(rows) if rows else np.zeros((0, 3), dtype=np.int64)

    def positions(self, cache: Any, code: float, frame: int) -> Floats:
        """World positions in the stage's units."""
        points = self._at(code)
        if len(points) != self.count:
            raise MeshError(
                f"{self._where}: expected {self.count} points in every frame, got {len(points)} in frame {frame} "
                f"(time code {code:g})",
                kind="topology",
            )
        matrix = np.array(cache.GetLocalToWorldTransform(self._prim), dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused for the whole frame
            moved: Floats = points @ matrix[:3, :3] + matrix[3, :3]
        return moved


def _answer(path: Path, request: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Read, write the arrays into the folder, and say the rest, or what is wrong with the file."""
    most_frames = request.pop("most_frames")
    try:
        raw = load(path, Request(**request), most_frames=most_frames)
    except MeshError as error:
        return {"error": str(error), "kind": error.kind}
    np.save(folder / "positions.npy", raw.positions)
    np.save(folder / "triangles.npy", raw.triangles)
    return {"fps": raw.fps, "up": raw.up}


if __name__ == "__main__":
    file, asked, room = sys.argv[1:]
    (Path(room) / "answer.json").write_text(json.dumps(_answer(Path(file), json.loads(asked), Path(room))))
