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
from clothsim._files import replacing
from clothsim.recording import Body, Recording

__all__ = ["body_colour", "vertex_normals", "write"]

# Blocks of a disk that count as none where a write has failed.
_FEW_BLOCKS = 8


def write(recording: Recording, path: Path) -> None:
    """Write the stage, whole or not at all.

    One ``UsdGeom.Mesh`` per body under ``/World``: points, vertex normals and extent per frame (static bodies once),
    ``primvars:st`` per corner in the cloth's UV. Metres, the scene's up axis, one time code per frame.
    """
    pxr = _Pxr()
    with replacing(path) as part, _as_os_errors(pxr, part):
        stage = pxr.Usd.Stage.CreateNew(str(part))
        world = pxr.UsdGeom.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(world.GetPrim())
        pxr.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        pxr.UsdGeom.SetStageUpAxis(stage, pxr.UsdGeom.Tokens.z if recording.up == "z" else pxr.UsdGeom.Tokens.y)
        stage.SetTimeCodesPerSecond(recording.fps)
        stage.SetFramesPerSecond(recording.fps)
        first = first_code(recording)
        stage.SetStartTimeCode(first)
        stage.SetEndTimeCode(first + max(0, len(recording) - 1))
        stage.SetMetadata("comment", f"clothsim: {recording.name}" if recording.name else "clothsim")
        used: set[str] = set()
        for number, body in enumerate(recording.bodies):
            name = _prim_name(pxr, body.name, used)
            material = _material(pxr, stage, f"/World/Looks/{name}", body_colour(body, number))
            prim = _mesh(pxr, stage, f"/World/{name}", recording, body, body_colour(body, number))
            pxr.UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)
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


def first_code(recording: Recording) -> int:
    """Time code of the first frame: 0, or in a run that went on from a frame the number of that."""
    return round(float(recording.times[0]) * recording.fps) if len(recording) else 0


class _Pxr:
    """The modules of usd-core."""

    def __init__(self) -> None:
        for name in ("Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdShade", "Vt"):
            setattr(self, name, optional(f"pxr.{name}", extra="usd", purpose="writing USD"))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def _mesh(
    pxr: _Pxr, stage: Any, prim_path: str, recording: Recording, body: Body, colour: tuple[float, float, float]
) -> Any:
    mesh = pxr.UsdGeom.Mesh.Define(stage, prim_path)
    mesh.CreateFaceVertexCountsAttr(pxr.Vt.IntArray([3] * len(body.triangles)))
    mesh.CreateFaceVertexIndicesAttr(pxr.Vt.IntArray.FromNumpy(body.triangles.astype(np.int32).reshape(-1)))
    mesh.CreateSubdivisionSchemeAttr(pxr.UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(body.kind == "cloth")
    mesh.CreateDisplayColorAttr([pxr.Gf.Vec3f(*colour)])
    points, extent, normals = mesh.CreatePointsAttr(), mesh.CreateExtentAttr(), mesh.CreateNormalsAttr()
    mesh.SetNormalsInterpolation(pxr.UsdGeom.Tokens.vertex)
    for frame in range(1 if body.static else len(recording)):
        at = pxr.Usd.TimeCode.Default() if body.static else pxr.Usd.TimeCode(first_code(recording) + frame)
        x = recording.positions(body, frame).astype(np.float32)
        points.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(x)), at)
        n = vertex_normals(x.astype(np.float64), body.triangles).astype(np.float32)
        normals.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(n)), at)
        corners = np.stack([x.min(axis=0), x.max(axis=0)])
        extent.Set(pxr.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(corners)), at)
    if body.uv is not None:
        _uv(pxr, mesh, body.uv)
    return mesh.GetPrim()


def _uv(pxr: _Pxr, mesh: Any, uv: Floats) -> None:
    """``st`` per corner, equal values stored once."""
    values, index = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)
    primvar = pxr.UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", pxr.Sdf.ValueTypeNames.TexCoord2fArray, pxr.UsdGeom.Tokens.faceVarying
    )
    primvar.Set(pxr.Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32)))
    primvar.SetIndices(pxr.Vt.IntArray.FromNumpy(index.reshape(-1).astype(np.int32)))


def _material(pxr: _Pxr, stage: Any, prim_path: str, colour: tuple[float, float, float]) -> Any:
    material = pxr.UsdShade.Material.Define(stage, prim_path)
    shader = pxr.UsdShade.Shader.Define(stage, f"{prim_path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", pxr.Sdf.ValueTypeNames.Color3f).Set(pxr.Gf.Vec3f(*colour))
    shader.CreateInput("roughness", pxr.Sdf.ValueTypeNames.Float).Set(0.8)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def body_colour(body: Body, number: int) -> tuple[float, float, float]:
    """Base colour of a body (linear RGB): grey for colliders, one of four for the cloths."""
    if body.kind == "collider":
        return (0.55, 0.56, 0.58)
    cloths = ((0.62, 0.13, 0.17), (0.13, 0.30, 0.52), (0.80, 0.58, 0.20), (0.20, 0.45, 0.32))
    return cloths[number % len(cloths)]


def _prim_name(pxr: _Pxr, name: str, used: set[str]) -> str:
    """A legal, unused prim name."""
    base = pxr.Tf.MakeValidIdentifier(name) or "body"
    if base == "Looks":
        base = "Looks_"
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
