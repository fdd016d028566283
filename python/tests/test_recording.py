"""Recordings: npz, USD, mesh sequences, pictures."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim._export.film_strip import moments_of
from clothsim._files import whole


@pytest.fixture(scope="module")
def frames() -> cs.Recording:
    """A cloth with a seam and one without UV, a ball that moves and one that stands."""
    sheet, sail = cs.Mesh.grid(1.0, 1.0, 5, 4), cs.Mesh.sphere(0.3, 1)
    ball = cs.Mesh.sphere(0.2, 1)
    bodies = [
        cs.Body("sheet", "cloth", len(sheet.vertices), sheet.triangles, sheet.uv),
        cs.Body("sail 2", "cloth", len(sail.vertices), sail.triangles),
        cs.Body("ball", "collider", len(ball.vertices), ball.triangles),
        cs.Body("post", "collider", len(ball.vertices), ball.triangles, None, True),
    ]
    start = np.concatenate([sheet.vertices, sail.vertices, ball.vertices])
    moving = np.stack([start + [0, -0.1 * k, 0] for k in range(5)])
    return cs.Recording(bodies, np.arange(5) / 24, moving, ball.vertices + [1, 0, 0], fps=24, up="z", name="all kinds")


def assert_same(a: cs.Recording, b: cs.Recording) -> None:
    assert (a.fps, a.up, a.name, len(a)) == (b.fps, b.up, b.name, len(b))
    np.testing.assert_array_equal(a.times, b.times)
    for one, two in zip(a.bodies, b.bodies, strict=True):
        assert (one.name, one.kind, one.static) == (two.name, two.kind, two.static)
        np.testing.assert_array_equal(one.triangles, two.triangles)
        assert (one.uv is None) == (two.uv is None)
        if one.uv is not None and two.uv is not None:
            np.testing.assert_array_equal(one.uv, two.uv)
        for frame in range(len(a)):
            np.testing.assert_array_equal(a.positions(one, frame), b.positions(two, frame))


def test_npz_reads_back_and_equal_recordings_are_equal_bytes(tmp_path: Path, frames: cs.Recording) -> None:
    frames.save(tmp_path / "a.npz")
    loaded = cs.Recording.load(tmp_path / "a.npz")
    assert_same(frames, loaded)
    loaded.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as data:
        assert data["positions"].shape == (5, 20 + 42, 3)
        assert data["triangles"].max() == 61
        assert np.isnan(data["uv"][-1]).all()
        assert data["collider_0_positions"].shape == (5, 42, 3)
        assert data["collider_1_positions"].shape == (1, 42, 3)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "frames.npz")
    with pytest.raises(cs.InvalidInput, match=r"frames\.npz: not a recording that can be read: it is no file"):
        cs.Recording.load(tmp_path / "frames.npz")


def test_usd_says_what_the_recording_says(tmp_path: Path, frames: cs.Recording) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="the extra 'usd' is not installed")
    from pxr import UsdGeom, UsdShade, UsdValidation

    path = tmp_path / "scene.usdc"
    frames.save_usd(path)
    stage = usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 4)
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 24
    assert stage.GetDefaultPrim().GetPath() == "/World"
    names = {p.GetName() for p in stage.GetDefaultPrim().GetChildren() if p.IsA(UsdGeom.Mesh)}
    assert names == {"sheet", "sail_2", "ball", "post"}
    for body, name in zip(frames.bodies, ["sheet", "sail_2", "ball", "post"], strict=True):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}"))
        points, normals = mesh.GetPointsAttr(), mesh.GetNormalsAttr()
        assert points.GetNumTimeSamples() == (0 if body.static else 5)
        for frame in range(5):
            expected = frames.positions(body, frame).astype(np.float32)
            np.testing.assert_array_equal(np.array(points.Get(frame)), expected)
            np.testing.assert_allclose(np.linalg.norm(np.array(normals.Get(frame)), axis=1), 1.0, atol=1e-6)
            extent = np.array(mesh.GetExtentAttr().Get(frame))
            np.testing.assert_array_equal(extent, [expected.min(axis=0), expected.max(axis=0)])
        np.testing.assert_array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), body.triangles)
        assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
        assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
        assert mesh.GetDoubleSidedAttr().Get() == (body.kind == "cloth")
        assert mesh.GetNormalsInterpolation() == "vertex"
        assert UsdShade.MaterialBindingAPI(mesh.GetPrim()).GetDirectBinding().GetMaterial()
        st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
        assert bool(st) == (body.uv is not None)
        if body.uv is not None:
            np.testing.assert_allclose(np.array(st.ComputeFlattened()).reshape(-1, 3, 2), body.uv, atol=1e-7)
            assert st.GetInterpolation() == "faceVarying"
    del mesh, points, normals, st
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetErrorAsString() for error in found] == []


def test_normals_point_where_triangles_face() -> None:
    from clothsim._export.usd import vertex_normals

    ball = cs.Mesh.sphere(1.0, 3)
    normals = vertex_normals(np.array(ball.vertices), ball.triangles)
    assert (np.einsum("ij,ij->i", normals, ball.vertices) > 0.99).all()


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_sequences_read_back(tmp_path: Path, frames: cs.Recording, suffix: str) -> None:
    frames.save_sequence(tmp_path / "seq", suffix)
    assert len(list((tmp_path / "seq").iterdir())) == 3 * 5 + 1
    body = frames.bodies[0]
    mesh = cs.Mesh.load(tmp_path / "seq" / f"sheet_0003.{suffix}")
    np.testing.assert_array_equal(mesh.vertices, frames.positions(body, 3))
    np.testing.assert_array_equal(mesh.triangles, body.triangles)
    assert mesh.uv is not None
    assert body.uv is not None
    np.testing.assert_array_equal(mesh.uv, body.uv)
    with pytest.raises(cs.OutputExists, match="seq"):
        frames.save_sequence(tmp_path / "seq", suffix)


def test_a_film_strip_is_drawn(tmp_path: Path, frames: cs.Recording) -> None:
    pytest.importorskip("pyvista", reason="the extra 'view' is not installed")
    from PIL import Image

    frames.film_strip(tmp_path / "strip.png", moments=2)
    with Image.open(tmp_path / "strip.png") as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    assert pixels.shape[1] > 2 * pixels.shape[0] * 0.8
    blue = pixels[..., 2] > 1.3 * pixels[..., 0]  # the second cloth; everything else is grey or red
    half = pixels.shape[1] // 2
    assert blue[:, :half].mean() > 0.01, "no cloth in the first picture"
    assert blue[:, half:].mean() > 0.01, "no cloth in the second picture"
    assert not np.array_equal(pixels[:, : half - 8], pixels[:, half + 8 :][:, : half - 8])
    assert [p.name for p in tmp_path.iterdir()] == ["strip.png"]


def test_moments_are_spread_over_time_and_motion() -> None:
    triangle = cs.Body("a", "cloth", 3, np.array([[0, 1, 2]]))
    height = np.concatenate([np.linspace(1, 0, 20), np.zeros(80)])  # falls, then rests
    moving = np.zeros((100, 3, 3))
    moving[..., 1] = height[:, None]
    picked = moments_of(cs.Recording([triangle], np.arange(100) / 60, moving), 8)
    assert picked[0] == 0
    assert picked[-1] == 99
    assert len(set(picked)) == 8
    assert sum(f < 20 for f in picked) >= 4, "the fall"
    assert sum(f >= 20 for f in picked) >= 3, "the rest"
    assert moments_of(cs.Recording([triangle], np.arange(3) / 60, moving[:3]), 8) == [0, 1, 2]
    still = cs.Recording([triangle], np.arange(100) / 60, np.zeros((100, 3, 3)))
    assert len(set(moments_of(still, 8))) == 8


def test_files_appear_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(cs.OutputError, match="no space left"), whole(path) as file:
        file.write(b"new")
        raise OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(RuntimeError), whole(path) as file:
        file.write(b"new")
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    with whole(path) as file:
        file.write(b"new")
    assert path.read_bytes() == b"new"
    with pytest.raises(cs.OutputError, match="No such file"), whole(tmp_path / "none" / "a"):
        pass


@pytest.mark.parametrize(("module", "call"), [
    ("pxr.Gf", lambda r, p: r.save_usd(p / "a.usdc")),
    ("pyvista", lambda r, p: r.film_strip(p / "a.png")),
    ("pyvista", lambda r, p: r.save_vtk(p / "vtk")),
])  # fmt: skip
def test_a_missing_package_is_named_with_the_way_to_get_it(
    tmp_path: Path, frames: cs.Recording, monkeypatch: pytest.MonkeyPatch, module: str, call: Any
) -> None:
    monkeypatch.setitem(__import__("sys").modules, module, None)
    with pytest.raises(cs.MissingDependency, match="pip install 'clothsim"):
        call(frames, tmp_path)
    assert list(tmp_path.iterdir()) == []
