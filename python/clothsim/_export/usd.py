"""Time-sampled meshes in Universal Scene Description: opens in Blender, Houdini and usdview."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints, optional
from clothsim._export.limits import check_float32
from clothsim._files import replacing
from clothsim.recording import Body, Recording

__all__ = ["body_colour", "region_colour", "time_codes", "triangles_in_no_region", "vertex_normals", "write"]

# Colours of cloths in turns, linear RGB.
_CLOTHS = ((0.62, 0.13, 0.17), (0.13, 0.30, 0.52), (0.80, 0.58, 0.20), (0.20, 0.45, 0.32))
# Frames from a whole number that are rounding: of times of 10^6 frames in float64, and of rates like 24000/1001.
_STEADY = 1e-6
# Blocks of a disk that count as none where a write has failed.
_FEW_BLOCKS = 8


def write(recording: Recording, path: Path) -> None:
    """Write the stage, whole or not at all.

    One ``UsdGeom.Mesh`` per body under ``/World``: points, vertex normals and extent per frame (static bodies once),
    ``primvars:st`` per corner in the cloth's UV, a ``UsdGeom.Subset`` with a material of its own for each region. Names
    that are no identifiers are kept as display names. Metres, the scene's up axis, time codes in frames: that of a
    time t is t × fps, a whole number but for the last frame of a run that ends between two.

    Raises
    ------
    InvalidInput
        A coordinate is above the largest float32.
    """
    pxr = _Pxr()
    check_float32(recording, "USD")
    with replacing(path) as part, _as_os_errors(pxr, part):
        stage = pxr.Usd.Stage.CreateNew(str(part))
        world = pxr.UsdGeom.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(world.GetPrim())
        pxr.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        pxr.UsdGeom.SetStageUpAxis(stage, pxr.UsdGeom.Tokens.z if recording.up == "z" else pxr.UsdGeom.Tokens.y)
        stage.SetTimeCodesPerSecond(recording.fps)
        stage.SetFramesPerSecond(recording.fps)
        codes = time_codes(recording) or [0.0]
        stage.SetStartTimeCode(codes[0])
        stage.SetEndTimeCode(codes[-1])
        stage.SetMetadata("comment", f"clothsim: {recording.name}" if recording.name else "clothsim")
        pxr.Usd.ModelAPI(world).SetKind(pxr.Kind.Tokens.component)
        pxr.UsdGeom.Scope.Define(stage, "/World/Looks")
        used, looks = {"Looks"}, set[str]()
        for number, body in enumerate(recording.bodies):
            prim = _mesh(pxr, stage, f"/World/{_prim_name(pxr, body.name, used)}", recording, body, number)
            _look(pxr, stage, prim, body.name, looks, body_colour(body, number))
            _regions(pxr, stage, prim, body, number, looks)
        stage.GetRootLayer().Save()
        del stage


@contextlib.contextmanager
def _as_os_errors(pxr: _Pxr, path: Path) -> Iterator[None]:
    """USD says that a write failed, and not why."""
    try:
        yield
    except pxr.Tf.ErrorException as error:
        space = os.statvfs(path.parent)
        if space.f_bavail < _FEW_BLOCKS:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
        words = " ".join(str(error).split())
        raise OSError(errno.EIO, f"USD: {words}") from error


def time_codes(recording: Recording) -> list[float]:
    """Each frame's time in frames, t × fps: whole numbers but for rounding, which is taken away, in steady runs."""
    codes = recording.times * recording.fps
    whole = np.rint(codes)
    return [float(code) for code in np.where(np.abs(codes - whole) < _STEADY, whole, codes)]


class _Pxr:
    """The modules of usd-core."""

    def __init__(self) -> None:
        for name in ("Gf", "Kind", "Sdf", "Tf", "Usd", "UsdGeom", "UsdShade", "Vt"):
            setattr(self, name, optional(f"pxr.{name}", extra="usd", purpose="writing USD"))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def _mesh(pxr: _Pxr, stage: Any, prim_path: str, recording: Recording, body: Body, number: int) -> Any:
    mesh = pxr.UsdGeom.Mesh.Define(stage, prim_path)
    mesh.CreateFaceVertexCountsAttr(pxr.Vt.IntArray([3] * len(body.triangles)))
    mesh.CreateFaceVertexIndicesAttr(pxr.Vt.IntArray.FromNumpy(body.triangles.astype(np.int32).reshape(-1)))
    mesh.CreateSubdivisionSchemeAttr(pxr.UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(body.kind == "cloth")
    mesh.CreateDisplayColorAttr([pxr.Gf.Vec3f(*body_colour(body, number))])
    points, extent, normals = mesh.CreatePointsAttr(), mesh.CreateExtentAttr(), mesh.CreateNormalsAttr()
    mesh.SetNormalsInterpolation(pxr.UsdGeom.Tokens.vertex)
    codes = time_codes(recording)
    for frame in range(1 if body.static else len(recording)):
        at = pxr.Usd.TimeCode.Default() if body.static else pxr.Usd.TimeCode(codes[frame])
        x = recording.positions(body, frame).astype(np.float32)
        points.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(x)), at)
        n = vertex_normals(x.astype(np.float64), body.triangles).astype(np.float32)
        normals.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(n)), at)
        corners = np.stack([x.min(axis=0), x.max(axis=0)])
        extent.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(corners)), at)
    if body.uv is not None:
        _uv(pxr, mesh, body.uv)
    _name(mesh.GetPrim(), body.name)
    return mesh.GetPrim()


def _uv(pxr: _Pxr, mesh: Any, uv: Floats) -> None:
    """``st`` per corner, equal values stored once."""
    values, index = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)
    primvar = pxr.UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", pxr.Sdf.ValueTypeNames.TexCoord2fArray, pxr.UsdGeom.Tokens.faceVarying
    )
    primvar.Set(pxr.Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32)))
    primvar.SetIndices(pxr.Vt.IntArray.FromNumpy(index.reshape(-1).astype(np.int32)))


def _regions(pxr: _Pxr, stage: Any, mesh: Any, body: Body, number: int, looks: set[str]) -> None:
    """A subset with a material of its own for each region, and one with the mesh's for the rest.

    Not all readers give triangles that are in no subset the material of the mesh; so each is in one.
    """
    if not body.regions:
        return
    binding, used = pxr.UsdShade.MaterialBindingAPI(mesh), set[str]()
    material = binding.GetDirectBinding().GetMaterial()
    rest = triangles_in_no_region(body)
    if rest.size:
        _subset(pxr, mesh, body.name, used, rest).Bind(material)
    for region, (name, triangles) in enumerate(body.regions.items(), start=1):
        subset = _subset(pxr, mesh, name, used, triangles)
        _look(pxr, stage, subset.GetPrim(), f"{body.name} {name}", looks, region_colour(body, number, region))
    binding.SetMaterialBindSubsetsFamilyType(pxr.UsdGeom.Tokens.partition)


def _subset(pxr: _Pxr, mesh: Any, name: str, used: set[str], triangles: Ints) -> Any:
    """Triangles of a mesh that have one material, ready to be bound to it."""
    faces = pxr.Vt.IntArray.FromNumpy(triangles.astype(np.int32))
    made = pxr.UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset(_prim_name(pxr, name, used), faces)
    _name(made.GetPrim(), name)
    return pxr.UsdShade.MaterialBindingAPI.Apply(made.GetPrim())


def _name(prim: Any, name: str) -> None:
    """Show the name as it is where a prim's own cannot hold it."""
    if name != prim.GetName():
        prim.SetDisplayName(name)


def _look(pxr: _Pxr, stage: Any, prim: Any, name: str, used: set[str], colour: tuple[float, float, float]) -> None:
    """Bind a new material of that name to a mesh or to some of its triangles."""
    path = f"/World/Looks/{_prim_name(pxr, name, used)}"
    material = pxr.UsdShade.Material.Define(stage, path)
    _name(material.GetPrim(), name)
    shader = pxr.UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", pxr.Sdf.ValueTypeNames.Color3f).Set(pxr.Gf.Vec3f(*colour))
    shader.CreateInput("roughness", pxr.Sdf.ValueTypeNames.Float).Set(0.8)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    pxr.UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def body_colour(body: Body, number: int) -> tuple[float, float, float]:
    """Base colour of a body (linear RGB): grey for colliders, one of four for the cloths."""
    if body.kind == "collider":
        return (0.55, 0.56, 0.58)
    return _CLOTHS[number % len(_CLOTHS)]


def triangles_in_no_region(body: Body) -> Ints:
    """What is left to a body's own material, ascending."""
    return np.setdiff1d(np.arange(len(body.triangles)), np.concatenate([np.zeros(0, np.int64), *body.regions.values()]))


def region_colour(body: Body, number: int, region: int) -> tuple[float, float, float]:
    """Base colour of region 1, 2, … of a body (linear RGB): that of the body, lighter and darker in turns."""
    lighter, share = region % 2 == 1, 1.0 - 0.5 ** ((region + 1) // 2)
    r, g, b = (c + share * ((1.0 if lighter else 0.0) - c) for c in body_colour(body, number))
    return r, g, b


def _prim_name(pxr: _Pxr, name: str, used: set[str]) -> str:
    """A legal, unused prim name."""
    base = pxr.Tf.MakeValidIdentifier(name) or "body"
    candidate, number = base, 1
    while candidate in used:
        number += 1
        candidate = f"{base}_{number}"
    used.add(candidate)
    return str(candidate)


def vertex_normals(x: Floats, triangles: Ints) -> Floats:
    """Unit normals of the vertices: area-weighted sum of the triangles' normals; +y where there is none."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    normals = np.zeros_like(x)
    for k in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(triangles[:, k], weights=face[:, axis], minlength=len(x))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Floats = np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), (0.0, 1.0, 0.0))
    return unit
