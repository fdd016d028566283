"""Animated characters from files of other programs: frames, glTF skins and morphs, USD; and what is refused."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim._arrays import Floats

SHEET = cs.Mesh.grid(1.0, 1.0, 4, 4)


def write_frames(folder: Path, frames: Floats, suffix: str = "obj") -> None:
    folder.mkdir()
    for number, x in enumerate(frames):
        cs.Mesh(x, SHEET.triangles).save(folder / f"walk_{number + 8}.{suffix}")


def waves() -> Floats:
    """Five frames of the sheet."""
    x = np.repeat(SHEET.vertices[None], 5, axis=0)
    x[..., 1] += np.arange(5)[:, None] * 0.1 * SHEET.vertices[:, 0]
    return x


# A folder or a pattern of frames ----------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_frames_come_in_the_order_of_their_numbers(tmp_path: Path, suffix: str) -> None:
    write_frames(tmp_path / "walk", waves(), suffix)  # walk_8 … walk_12: not the order of their letters
    for source in (tmp_path / "walk", tmp_path / "walk" / f"*.{suffix}"):
        animation = cs.Animation.load(source, fps=24)
        np.testing.assert_array_equal(animation.positions, waves())
        np.testing.assert_array_equal(animation.triangles, SHEET.triangles)
    scaled = cs.Animation.load(tmp_path / "walk", fps=24, scale=0.01, up="z")
    np.testing.assert_allclose(scaled.positions[..., 1], 0.01 * waves()[..., 2], rtol=1e-15)
    np.testing.assert_allclose(scaled.positions[..., 2], -0.01 * waves()[..., 1], rtol=1e-15)
    back = cs.Animation.load(tmp_path / "walk", fps=24, up="y", scene_up="z")
    np.testing.assert_array_equal(back.positions[..., 2], waves()[..., 1])


def test_frames_that_do_not_fit_are_named(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    write_frames(folder, waves())
    with pytest.raises(cs.InvalidInput, match="fps: expected frames per second"):
        cs.Animation.load(folder)
    cs.Mesh.grid(1.0, 1.0, 5, 4).save(folder / "walk_10.obj")
    with pytest.raises(
        cs.MeshError, match=r"walk_10\.obj: expected the topology of walk_8\.obj \(16 vert.*got 20"
    ) as e:
        cs.Animation.load(folder, fps=24)
    assert e.value.kind == "topology"
    turned = np.array(SHEET.triangles)
    turned[5] = turned[5, ::-1]
    cs.Mesh(SHEET.vertices, turned).save(folder / "walk_10.obj")
    with pytest.raises(cs.MeshError, match=r"walk_10\.obj: .*triangle 5 with vertices"):
        cs.Animation.load(folder, fps=24)
    text = (folder / "walk_9.obj").read_text()
    (folder / "walk_10.obj").write_text(text.replace("v ", "v nan", 1).replace("v nan", "v nan ", 1))
    with pytest.raises(cs.MeshError, match=r"walk_10\.obj"):
        cs.Animation.load(folder, fps=24)
    (folder / "walk_10.obj").write_text(text[: len(text) // 2])
    with pytest.raises(cs.MeshError, match=r"walk_10\.obj"):
        cs.Animation.load(folder, fps=24)
    (folder / "walk_10.ply").write_bytes(b"ply")
    with pytest.raises(cs.MeshError, match=r"expected frames of one kind, got \.obj, \.ply"):
        cs.Animation.load(folder, fps=24)
    with pytest.raises(cs.MeshError, match=r"none/\*\.obj: expected frames"):
        cs.Animation.load(tmp_path / "none" / "*.obj", fps=24)


def test_archives_that_do_not_fit_are_named(tmp_path: Path) -> None:
    path = tmp_path / "walk.npz"
    np.savez(path, positions=waves(), triangles=SHEET.triangles)
    np.testing.assert_array_equal(cs.Animation.load(path, fps=24).positions, waves())
    content = path.read_bytes()
    path.write_bytes(content[:-200])
    with pytest.raises(cs.MeshError, match=r"walk\.npz: not an archive"):
        cs.Animation.load(path, fps=24)
    np.savez(path, positions=waves())
    with pytest.raises(cs.MeshError, match=r"walk\.npz: .*triangles missing"):
        cs.Animation.load(path, fps=24)
    np.savez(path, positions=waves()[0], triangles=SHEET.triangles)
    with pytest.raises(cs.MeshError, match=r"walk\.npz: positions: expected shape"):
        cs.Animation.load(path, fps=24)
    bad = waves()
    bad[3, 7, 1] = np.inf
    np.savez(path, positions=bad, triangles=SHEET.triangles)
    with pytest.raises(cs.MeshError, match="at frame 3, vertex 7"):
        cs.Animation.load(path, fps=24)


# glTF ---------------------------------------------------------------------------------------------------------------


class Gltf:
    """A small glTF file, array by array."""

    def __init__(self) -> None:
        self.blob = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "bufferViews": [], "accessors": [],
        }  # fmt: skip

    def array(self, values: Any, dtype: str, kind: str) -> int:
        content = np.asarray(values, dtype=dtype)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": content.nbytes}
        self.blob += content.tobytes() + b"\0" * (-content.nbytes % 4)
        self.json["bufferViews"].append(view)
        codes = {"f4": 5126, "u2": 5123, "u1": 5121, "u4": 5125}
        self.json["accessors"].append(
            {
                "bufferView": len(self.json["bufferViews"]) - 1,
                "componentType": codes[dtype],
                "count": len(content),
                "type": kind,
            }
        )
        return len(self.json["accessors"]) - 1

    def save(self, path: Path) -> None:
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(self.blob)}]}).encode()
        text += b" " * (-len(text) % 4)
        parts = [
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(self.blob), b"BIN\0"),
            self.blob,
        ]
        body = b"".join(parts)
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)


# A strip of five rows along y; the upper joint at (0, 1, 0) turns by a quarter about z within a second.
STRIP = np.array([[x, y, 0.0] for y in (0.0, 0.5, 1.0, 1.5, 2.0) for x in (-0.5, 0.5)])
SHARES = np.array([[1.0, 0], [1, 0], [0.75, 0.25], [0.75, 0.25], [0.5, 0.5], [0.5, 0.5], [0.25, 0.75], [0.25, 0.75],
                   [0, 1], [0, 1]])  # fmt: skip
STRIP_TRIANGLES = np.array([t for r in range(0, 8, 2) for t in ([r, r + 1, r + 3], [r, r + 3, r + 2])])


def skinned(keys: int = 2) -> Gltf:
    """The strip and its joints, with so many keys of the quarter turn."""
    gltf = Gltf()
    half = np.linspace(0, np.pi / 4, keys)
    turns = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)
    joints = np.zeros((10, 4))
    joints[:, 1] = 1
    inverse = np.array([np.eye(4), np.eye(4)])
    inverse[1, 3, 1] = -1.0  # columns: back from (0, 1, 0)
    gltf.json |= {
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "body", "mesh": 0, "skin": 0},
            {"name": "root", "children": [2], "translation": [0.0, 0.0, 0.0]},
            {"name": "elbow", "translation": [0.0, 1.0, 0.0]},
        ],
        "meshes": [{
            "primitives": [{
                "attributes": {
                    "POSITION": gltf.array(STRIP, "f4", "VEC3"),
                    "JOINTS_0": gltf.array(joints, "u1", "VEC4"),
                    "WEIGHTS_0": gltf.array(np.pad(SHARES, ((0, 0), (0, 2))), "f4", "VEC4"),
                },
                "indices": gltf.array(STRIP_TRIANGLES.reshape(-1), "u2", "SCALAR"),
            }]
        }],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": gltf.array(inverse.reshape(2, 16), "f4", "MAT4")}],
        "animations": [{
            "name": "bend",
            "samplers": [{
                "input": gltf.array(np.linspace(0.0, 1.0, keys), "f4", "SCALAR"),
                "output": gltf.array(turns, "f4", "VEC4"),
            }],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
        }],
    }  # fmt: skip
    return gltf


def bent(angle: float) -> Floats:
    """The strip with its upper joint turned: each vertex is blended of where the two joints take it."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = (STRIP - [0, 1, 0]) @ turn.T + [0, 1, 0]
    out: Floats = SHARES[:, :1] * STRIP + SHARES[:, 1:] * turned
    return out


def test_a_skin_moves_with_its_joints(tmp_path: Path) -> None:
    path = tmp_path / "body.glb"
    skinned().save(path)
    animation = cs.Animation.load(path, fps=8)
    assert (animation.fps, len(animation.positions)) == (8, 9)
    np.testing.assert_array_equal(animation.triangles, STRIP_TRIANGLES)
    for frame, x in enumerate(animation.positions):
        # float32 keys and weights.
        np.testing.assert_allclose(x, bent(np.pi / 2 * frame / 8), atol=1e-6)
    assert not np.allclose(animation.positions[4], bent(np.pi / 4 + 0.01), atol=1e-3), "the comparison sees an angle"
    assert cs.Animation.load(path).fps == 60
    with pytest.raises(cs.MeshError, match=r"animation: expected one of \['bend'\], got 'walk'"):
        cs.Animation.load(path, animation="walk")
    with pytest.raises(cs.MeshError, match="part: expected the name of one node, of .*got 'hand'"):
        cs.Animation.load(path, part="hand")
    np.testing.assert_array_equal(cs.Animation.load(path, fps=8, part="body").positions, animation.positions)
    with pytest.raises(cs.MeshError, match="at least one triangle"):
        cs.Animation.load(path, fps=8, part="elbow")


def test_moving_nodes_of_all_interpolations(tmp_path: Path) -> None:
    times = np.array([0.0, 1.0, 2.0])
    values = np.array([[0.0, 0, 0], [1.0, 2.0, 0], [1.0, 0, 4.0]])
    tangents = np.array([[1.0, 0, 0], [0.0, 3.0, 0], [0, 0, 1.0]])
    cubic = np.stack([tangents, values, tangents], axis=1).reshape(-1, 3)

    def hermite(t: float) -> Floats:
        k = min(int(t), 1)
        s = t - k
        out: Floats = (
            (2 * s**3 - 3 * s**2 + 1) * values[k] + (s**3 - 2 * s**2 + s) * tangents[k]
            + (3 * s**2 - 2 * s**3) * values[k + 1] + (s**3 - s**2) * tangents[k + 1]
        )  # fmt: skip
        return out

    expected: dict[str, Callable[[float], Floats]] = {
        "LINEAR": lambda t: np.array([np.interp(t, times, values[:, k]) for k in range(3)]),
        "STEP": lambda t: values[int(t)],
        "CUBICSPLINE": hermite,
    }
    for mode, at in expected.items():
        gltf = Gltf()
        corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
        sampler = {
            "input": gltf.array(times, "f4", "SCALAR"),
            "output": gltf.array(cubic if mode == "CUBICSPLINE" else values, "f4", "VEC3"),
            "interpolation": mode,
        }
        gltf.json |= {
            "nodes": [{"children": [1], "scale": [2.0, 2.0, 2.0]}, {"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": gltf.array(corners, "f4", "VEC3")}}]}],
            "animations": [{"samplers": [sampler],
                            "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}],
        }  # fmt: skip
        gltf.save(tmp_path / "a.glb")
        x = cs.Animation.load(tmp_path / "a.glb", fps=4).positions
        assert len(x) == 9
        for frame in range(9):
            np.testing.assert_allclose(x[frame], 2.0 * (corners + at(frame / 4)), atol=1e-6, err_msg=mode)


def test_our_own_morphs_read_back_with_seams_closed(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    assert SHEET.uv is not None
    uv = np.array(SHEET.uv)
    uv[9:] += 2.0
    body = cs.Body("sheet", "cloth", 16, SHEET.triangles, uv)
    frames = cs.Recording([body], np.arange(5) / 24, rng.normal(size=(5, 16, 3)), fps=24)
    frames.save_gltf(tmp_path / "a.glb")
    animation = cs.Animation.load(tmp_path / "a.glb", fps=24)
    assert animation.positions.shape == (5, 16, 3), "the seam is closed again"
    for frame in range(5):
        expected = frames.positions(body, frame)[body.triangles]
        np.testing.assert_allclose(animation.positions[frame][animation.triangles], expected, atol=2e-6)


def damage(change: Callable[[dict[str, Any]], None]) -> Gltf:
    gltf = skinned()
    change(gltf.json)
    return gltf


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j["asset"].update(version="1.0"), "asset.version 2"),
        (lambda j: j.update(extensionsRequired=["KHR_draco_mesh_compression"]), "without compression"),
        (lambda j: j["accessors"][0].update(count=10**12), r"accessors\[0\]: expected 1000000000000 rows"),
        (lambda j: j["accessors"][0].update(count=-3), r"accessors\[0\]"),
        (lambda j: j["accessors"][0].update(count="many"), "count: expected a whole number"),
        (lambda j: j["accessors"][0].update(type="VEC4"), "POSITION: expected VEC3, got 'VEC4'"),
        (lambda j: j["accessors"][0].update(bufferView=77), r"bufferViews\[77\] does not exist"),
        (lambda j: j["bufferViews"][0].update(byteOffset=-8), r"accessors\[0\]"),
        (lambda j: j["bufferViews"][0].update(byteLength=10**9), r"accessors\[0\]|buffer"),
        (lambda j: j["nodes"][0].update(mesh=5), r"meshes\[5\] does not exist"),
        (lambda j: j["nodes"][0].update(mesh="body"), "meshes"),
        (lambda j: j["nodes"][2].update(children=[1]), "its own ancestor"),
        (lambda j: j["nodes"][0].update(children=[2]), "expected one parent"),
        (lambda j: j["nodes"][1].update(translation=[0.0, float("nan"), 0.0]), "3 finite numbers"),
        (lambda j: j["nodes"][1].update(scale=[1.0]), "3 finite numbers"),
        (lambda j: j["skins"][0].update(joints=[1]), r"expected joints 0 to 0 of skins\[0\], got 1"),
        (lambda j: j["skins"][0].update(joints=[1, 99]), r"nodes\[99\] does not exist"),
        (lambda j: j["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"), r"accessors\[None\]"),
        (lambda j: j["meshes"][0]["primitives"][0]["attributes"].pop("JOINTS_0"), "expected JOINTS_0"),
        (lambda j: j["meshes"][0]["primitives"][0].update(indices=0), "indices: expected SCALAR"),
        (lambda j: j["animations"][0]["samplers"][0].update(interpolation="MAGIC"), "expected interpolation LINEAR"),
        (lambda j: j["animations"][0]["samplers"][0].update(output=0), "output: expected VEC4"),
        (lambda j: j["animations"][0]["channels"][0].update(sampler=3), "one of 1 samplers, got 3"),
        (lambda j: j["animations"].append(j["animations"][0]), "expected the name of one of its animations"),
        (lambda j: j.update(nodes=5), "nodes: expected a list"),
        (lambda j: j.update(scenes=[None]), "expected a table"),
    ],
)
def test_damaged_gltf_is_refused_by_name(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], message: str
) -> None:
    damage(change).save(tmp_path / "body.glb")
    with pytest.raises(cs.MeshError, match=message) as caught:
        cs.Animation.load(tmp_path / "body.glb")
    assert "body.glb" in str(caught.value)


def test_numbers_of_a_gltf_file_are_looked_at(tmp_path: Path) -> None:
    path = tmp_path / "body.glb"
    for position, values, message in [
        (0, [[np.nan, 0, 0]], "POSITION: expected finite numbers"),
        (2, [[-1.0, 2.0, 0, 0]], "weights ≥ 0 with a sum above 0"),
        (2, [[0.0, 0.0, 0, 0]], "weights ≥ 0 with a sum above 0"),
        (5, [1.0, 0.0], "times that increase"),
        (5, [0.0, 1e30], "at most 1000000 frames"),
    ]:
        gltf = skinned()
        start = gltf.json["bufferViews"][position]["byteOffset"]
        content = np.asarray(values, "f4").tobytes()
        gltf.blob = gltf.blob[:start] + content + gltf.blob[start + len(content) :]
        gltf.save(path)
        with pytest.raises(cs.MeshError, match=message):
            cs.Animation.load(path)
    skinned().save(path)
    whole = path.read_bytes()
    for length in (0, 3, 11, 19, 40, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(cs.MeshError, match=r"body\.glb"):
            cs.Animation.load(path)


# USD ----------------------------------------------------------------------------------------------------------------


def test_usd_in_its_own_unit_axis_and_rate(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Gf, Usd, UsdGeom

    path = tmp_path / "walk.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    stage.SetTimeCodesPerSecond(12)
    stage.SetStartTimeCode(100)
    stage.SetEndTimeCode(104)
    root = UsdGeom.Xform.Define(stage, "/World")
    root.AddTranslateOp().Set(Gf.Vec3d(10, 0, 0), 100)
    root.GetOrderedXformOps()[0].Set(Gf.Vec3d(50, 0, 0), 104)
    mesh = UsdGeom.Mesh.Define(stage, "/World/quad")
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    quad = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]])
    for code in range(100, 105):
        mesh.CreatePointsAttr().Set((quad + [0, 0, code - 100]).tolist(), code)
    hidden = UsdGeom.Mesh.Define(stage, "/World/hidden")
    hidden.CreateFaceVertexCountsAttr([3])
    hidden.CreateFaceVertexIndicesAttr([0, 1, 2])
    hidden.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    hidden.CreateVisibilityAttr("invisible")
    stage.Save()
    animation = cs.Animation.load(path)
    assert (animation.fps, animation.positions.shape) == (12, (5, 4, 3))
    assert animation.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    for frame, x in enumerate(animation.positions):
        world = 0.01 * (quad + [10 + 10 * frame, 0, frame])
        np.testing.assert_allclose(x, np.stack([world[:, 0], world[:, 2], -world[:, 1]], axis=1), atol=1e-6)
    assert len(cs.Animation.load(path, fps=24, scene_up="z").positions) == 9
    np.testing.assert_allclose(cs.Mesh.load(path).vertices, 0.01 * (quad + [10, 0, 0]), atol=1e-6)
    with pytest.raises(cs.MeshError, match="part: expected the path of a prim, such as .*got '/World/arm'"):
        cs.Animation.load(path, part="/World/arm")
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3], 100)
    mesh.GetFaceVertexIndicesAttr().Set([0, 2, 1, 3], 102)
    stage.Save()
    with pytest.raises(cs.MeshError, match=r"walk\.usda, /World/quad: .*faceVertexIndices that changes at code 102"):
        cs.Animation.load(path)
    mesh.GetFaceVertexIndicesAttr().Clear()
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 9])
    stage.Save()
    with pytest.raises(cs.MeshError, match=r"/World/quad: expected faceVertexIndices in 0\.\.4, got 9"):
        cs.Animation.load(path)
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3])
    mesh.GetPointsAttr().Set(quad[:3].tolist() * 2, 103)
    stage.Save()
    with pytest.raises(cs.MeshError, match=r"/World/quad: expected 4 points in every frame, got 6 in frame 3"):
        cs.Animation.load(path)
    mesh.GetPointsAttr().Set([(np.nan, 0, 0)] * 4, 103)
    stage.Save()
    with pytest.raises(cs.MeshError, match=r"walk\.usda: expected finite coordinates .*at frame 3, vertex 0"):
        cs.Animation.load(path)
    stage.SetEndTimeCode(1e18)
    stage.Save()
    with pytest.raises(cs.MeshError, match="at most 1000000 frames"):
        cs.Animation.load(path)
    text = path.read_text()
    for content in ("", "PXR-USDC", text[: len(text) // 2], "#usda 1.0\n"):
        broken = tmp_path / "broken.usda"
        broken.write_text(content)
        with pytest.raises(cs.MeshError, match=r"broken\.usda"):
            cs.Animation.load(broken)
    with pytest.raises(cs.MeshError, match=r"none\.usdc: cannot read"):
        cs.Animation.load(tmp_path / "none.usdc")


def test_usd_without_a_range_of_time_takes_that_of_what_moves(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Gf, Usd, UsdGeom

    path = tmp_path / "sliding.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.SetTimeCodesPerSecond(24)
    move = UsdGeom.Xform.Define(stage, "/World").AddTranslateOp()
    move.Set(Gf.Vec3d(0, 0, 0), 3)
    move.Set(Gf.Vec3d(6, 0, 0), 9)
    mesh = UsdGeom.Mesh.Define(stage, "/World/triangle")
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    stage.Save()
    animation = cs.Animation.load(path)
    assert animation.positions[:, 0, 0].tolist() == pytest.approx([0, 1, 2, 3, 4, 5, 6], abs=1e-6)


def test_usd_skeletons_are_baked(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

    path = tmp_path / "body.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.SetTimeCodesPerSecond(8)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(8)
    root = UsdSkel.Root.Define(stage, "/Body")
    skeleton = UsdSkel.Skeleton.Define(stage, "/Body/Skeleton")
    joints = ["root", "root/elbow"]
    bind = [Gf.Matrix4d(1.0), Gf.Matrix4d(1.0).SetTranslate(Gf.Vec3d(0, 1, 0))]
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateBindTransformsAttr(bind)
    skeleton.CreateRestTransformsAttr(bind)
    motion = UsdSkel.Animation.Define(stage, "/Body/Skeleton/Bend")
    motion.CreateJointsAttr(joints)
    motion.CreateTranslationsAttr([(0, 0, 0), (0, 1, 0)])
    motion.CreateScalesAttr([(1, 1, 1), (1, 1, 1)])
    for code in range(9):
        half = np.pi / 4 * code / 8
        turn = Gf.Quatf(float(np.cos(half)), Gf.Vec3f(0, 0, float(np.sin(half))))
        motion.CreateRotationsAttr().Set([Gf.Quatf(1, Gf.Vec3f(0)), turn], code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    mesh = UsdGeom.Mesh.Define(stage, "/Body/strip")
    mesh.CreatePointsAttr(STRIP.tolist())
    mesh.CreateFaceVertexCountsAttr([3] * len(STRIP_TRIANGLES))
    mesh.CreateFaceVertexIndicesAttr(STRIP_TRIANGLES.reshape(-1).tolist())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 2).Set(Vt.IntArray([0, 1] * 10))
    binding.CreateJointWeightsPrimvar(False, 2).Set(Vt.FloatArray(SHARES.reshape(-1).tolist()))
    del root
    stage.Save()
    animation = cs.Animation.load(path)
    assert animation.positions.shape == (9, 10, 3)
    for frame, x in enumerate(animation.positions):
        np.testing.assert_allclose(x, bent(np.pi / 2 * frame / 8), atol=1e-5)


def test_a_missing_package_for_usd_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    monkeypatch.setitem(__import__("sys").modules, "pxr.Usd", None)
    monkeypatch.setitem(__import__("sys").modules, "pxr.UsdGeom", None)
    (tmp_path / "a.usdc").write_bytes(b"")
    with pytest.raises(cs.MissingDependency, match=r"reading USD needs the package pxr: pip install 'clothsim\[usd\]'"):
        cs.Animation.load(tmp_path / "a.usdc")


# In a scene ---------------------------------------------------------------------------------------------------------

SCENE = """
duration = 0.5
[contact]
thickness = 0.01
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 0.6, height = 0.6, nx = 9, ny = 9 }
material = "cotton"
position = [0.0, 3.0, 2.0]
[[collider]]
name = "arm"
sequence = { file = "body.glb", fps = 8, start = 0.1, scale = 2.0 }
[[collider]]
name = "other arm"
sequence = { file = "body.glb", fps = 4, part = "body" }
position = [5.0, 0.0, 0.0]
"""


def test_a_scene_reads_its_characters(tmp_path: Path) -> None:
    skinned().save(tmp_path / "body.glb")
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    scene = cs.Scene.load(path)
    sim = cs.Simulation(scene, threads=1)
    sim.advance(0.1 + 0.125)  # one frame after the start of the first; 0.9 of a frame of the other
    first, second = sim.collider_positions[:10], sim.collider_positions[10:]
    np.testing.assert_allclose(first, 2 * bent(np.pi / 16), atol=1e-5)
    between = 0.1 * STRIP + 0.9 * bent(np.pi / 8)  # linear between two frames
    np.testing.assert_allclose(second, between + [5, 0, 0], atol=1e-5)
    # Saved elsewhere, the frames go along and nothing is applied twice.
    (tmp_path / "copy").mkdir()
    scene.save(tmp_path / "copy" / "scene.toml")
    again = cs.Simulation(cs.Scene.load(tmp_path / "copy" / "scene.toml"), threads=1)
    again.advance(0.225)
    np.testing.assert_array_equal(again.collider_positions, sim.collider_positions)
    resumed = tmp_path / "a.checkpoint"
    sim.save_checkpoint(resumed)
    sim.advance(0.1)
    back = cs.Simulation.resume(resumed, threads=1)
    back.advance(0.1)
    np.testing.assert_array_equal(back.positions, sim.positions)
    np.testing.assert_array_equal(back.collider_positions, sim.collider_positions)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('file = "body.glb", fps = 8', 'file = "none.glb", fps = 8', r"collider\[0\].sequence.file: .*none\.glb"),
        ("scale = 2.0", "scale = 0", r"scene\.toml:12: collider\[0\].sequence.scale: .*> 0"),
        ("scale = 2.0", 'animation = "walk"', r"collider\[0\].sequence.file: .*expected one of \['bend'\]"),
        ('file = "body.glb", fps = 8', 'asset = "body"', r"collider\[0\].sequence.scale: expected nothing without"),
        ('file = "body.glb", fps = 8', 'file = "walk/*.obj", fps = 8', r"walk/\*\.obj: expected frames"),
        ("fps = 8", "fps = 1e7", r"collider\[0\].sequence.file: .*at most 1000000 frames"),
        ("scale = 2.0", 'up = "x"', "sequence.up"),
    ],
)
def test_a_scene_names_the_key_of_a_character_that_cannot_be_used(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    skinned().save(tmp_path / "body.glb")
    path = tmp_path / "scene.toml"
    assert old in SCENE
    path.write_text(SCENE.replace(old, new))
    with pytest.raises(cs.InvalidScene, match=message):
        cs.Scene.load(path)


def test_frames_without_a_rate_are_refused(tmp_path: Path) -> None:
    write_frames(tmp_path / "walk", waves())
    path = tmp_path / "scene.toml"
    start, _ = SCENE.split("[[collider]]", maxsplit=1)
    path.write_text(start + '[[collider]]\nname = "w"\nsequence = { file = "walk" }\n')
    with pytest.raises(cs.InvalidScene, match=r"collider\[0\].sequence.fps: expected frames per second"):
        cs.Simulation(cs.Scene.load(path))
