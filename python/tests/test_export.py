"""What is written is read back by readers that are not ours: pygltflib, trimesh, VTK, NumPy for the point cache."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import RunCli

import clothsim as cs
from clothsim._arrays import Floats


def recording(*, velocities: bool = False, up: str = "y", first: float = 0.0) -> cs.Recording:
    """Two cloths, one with a seam of UV, a moving and a standing collider; five frames of noise."""
    rng = np.random.default_rng(7)
    grid = cs.Mesh.grid(1.0, 2.0, 4, 5)
    assert grid.uv is not None
    uv = np.array(grid.uv)
    uv[10:] += (3.0, 0.5)  # a second panel
    ball = cs.Mesh.sphere(0.3, 1)
    bodies = [
        cs.Body("sheet", "cloth", 20, grid.triangles, uv),
        cs.Body("sail 2", "cloth", 20, grid.triangles),
        cs.Body("ball", "collider", 42, ball.triangles),
        cs.Body("post", "collider", 42, ball.triangles, None, True),
    ]
    return cs.Recording(
        bodies,
        first + np.arange(5) / 24,
        rng.normal(size=(5, 82, 3)),
        rng.normal(size=(42, 3)),
        velocities=rng.normal(size=(5, 40, 3)) if velocities else None,
        fps=24.0,
        up=up,
        name="noise",
    )


def accessor(gltf: Any, index: int) -> Floats:
    """Values of a float accessor, by the offsets that pygltflib parsed."""
    entry = gltf.accessors[index]
    view = gltf.bufferViews[entry.bufferView]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[entry.type]
    start = (view.byteOffset or 0) + (entry.byteOffset or 0)
    values = np.frombuffer(gltf.binary_blob(), "<f4", entry.count * width, start)
    return values.reshape(-1, width).astype(np.float64)


def test_gltf_morphs_are_the_frames(tmp_path: Path) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    frames = recording(up="z")
    frames.save_gltf(tmp_path / "a.glb")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert [node.name for node in gltf.nodes] == ["noise", "sheet", "sail 2", "ball", "post"]
    assert gltf.nodes[0].children == [1, 2, 3, 4]
    np.testing.assert_allclose(gltf.nodes[0].rotation, [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    for number, body in enumerate(frames.bodies):
        primitive = gltf.meshes[number].primitives[0]
        base = accessor(gltf, primitive.attributes.POSITION)[: body.vertex_count]
        np.testing.assert_array_equal(base, frames.positions(body, 0).astype(np.float32))
        assert len(primitive.targets or []) == (0 if body.static else 4)
        for frame, target in enumerate(primitive.targets or [], start=1):
            moved = base + accessor(gltf, target["POSITION"])[: body.vertex_count]
            # Two roundings of float32 numbers of size 4.
            np.testing.assert_allclose(moved, frames.positions(body, frame), rtol=0, atol=1e-6)
            normals = accessor(gltf, primitive.attributes.NORMAL) + accessor(gltf, target["NORMAL"])
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert [channel.target.node for channel in gltf.animations[0].channels] == [1, 2, 3]
    for channel, sampler in zip(gltf.animations[0].channels, gltf.animations[0].samplers, strict=True):
        assert channel.target.path == "weights"
        np.testing.assert_allclose(accessor(gltf, sampler.input)[:, 0], frames.times, atol=1e-7)
        weights = accessor(gltf, sampler.output).reshape(5, 4)
        np.testing.assert_array_equal(weights, np.eye(5)[:, 1:])


def test_gltf_keeps_triangles_and_both_sides_of_a_seam(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    frames = recording()
    frames.save_gltf(tmp_path / "a.glb")
    scene = trimesh.load_scene(tmp_path / "a.glb", process=False)
    for body in frames.bodies:
        mesh = scene.geometry[body.name]
        expected = frames.positions(body, 0)[body.triangles].astype(np.float32)
        np.testing.assert_array_equal(np.asarray(mesh.vertices)[mesh.faces], expected)
    body = frames.bodies[0]
    assert body.uv is not None
    sheet = scene.geometry["sheet"]
    assert len(sheet.vertices) > 20, "a vertex on the seam is there once per panel"
    np.testing.assert_allclose(sheet.visual.uv[sheet.faces], body.uv, atol=1e-6)


def test_gltf_of_one_frame_has_no_animation(tmp_path: Path) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    triangle = cs.Body("a", "cloth", 3, np.array([[0, 1, 2]]))
    cs.Recording([triangle], np.zeros(1), np.eye(3)[None]).save_gltf(tmp_path / "a.glb")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert not gltf.animations
    assert not gltf.meshes[0].primitives[0].targets
    with pytest.raises(cs.InvalidInput, match="at least one frame"):
        cs.Recording([triangle], np.zeros(0), np.zeros((0, 3, 3))).save_gltf(tmp_path / "b.glb")
    assert [p.name for p in tmp_path.iterdir()] == ["a.glb"]


def test_vtk_is_what_paraview_reads(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    frames = recording(velocities=True)
    frames.save_vtk(tmp_path / "vtk")
    reader = pyvista.get_reader(str(tmp_path / "vtk" / "scene.pvd"))
    np.testing.assert_allclose(reader.time_values, frames.times, rtol=1e-15)
    for frame, time in enumerate(reader.time_values):
        reader.set_active_time_value(time)
        blocks = reader.read()
        for number, body in enumerate(frames.bodies):
            np.testing.assert_array_equal(blocks[number].points, frames.positions(body, frame))
            np.testing.assert_array_equal(blocks[number].faces.reshape(-1, 4)[:, 1:], body.triangles)
            velocities = frames.velocities(body, frame)
            assert ("velocity" in blocks[number].point_data) == (velocities is not None)
            if velocities is not None:
                np.testing.assert_array_equal(blocks[number].point_data["velocity"], velocities)
    with pytest.raises(cs.OutputExists, match="vtk"):
        frames.save_vtk(tmp_path / "vtk")


def test_a_point_cache_is_laid_out_as_its_readers_expect(tmp_path: Path) -> None:
    frames = recording(first=2.0)
    frames.save_pc2(tmp_path / "pc2")
    names = sorted(p.name for p in (tmp_path / "pc2").iterdir())
    assert names == ["ball.obj", "ball.pc2", "post.obj", "sail_2.obj", "sail_2.pc2", "sheet.obj", "sheet.pc2"]
    header = np.dtype(
        [("magic", "S12"), ("version", "<i4"), ("points", "<i4"), ("start", "<f4"), ("rate", "<f4"), ("samples", "<i4")]
    )
    assert header.itemsize == 32
    for body, stem in zip(frames.bodies[:3], ("sheet", "sail_2", "ball"), strict=True):
        path = tmp_path / "pc2" / f"{stem}.pc2"
        head = np.fromfile(path, header, 1)[0]
        assert head.tolist() == (b"POINTCACHE2", 1, body.vertex_count, 48.0, 1.0, 5)
        samples = np.fromfile(path, "<f4", offset=32).reshape(5, body.vertex_count, 3)
        for frame in range(5):
            np.testing.assert_array_equal(samples[frame], frames.positions(body, frame).astype(np.float32))
        mesh = cs.Mesh.load(path.with_suffix(".obj"))
        np.testing.assert_array_equal(mesh.vertices, frames.positions(body, 0))
        np.testing.assert_array_equal(mesh.triangles, body.triangles)


def test_velocities_are_kept_and_a_damaged_archive_is_named(tmp_path: Path) -> None:
    frames = recording(velocities=True)
    path = tmp_path / "frames.npz"
    frames.save(path)
    again = cs.Recording.load(path)
    for body in ("sheet", "sail 2"):
        np.testing.assert_array_equal(again.velocities(body, 3), frames.velocities(body, 3))
    assert again.velocities("ball", 3) is None
    assert not recording().has_velocities
    whole = path.read_bytes()
    np.save(tmp_path / "one.npy", np.zeros(3))
    for content in (b"", whole[: len(whole) // 2], b"\x00" * 100, (tmp_path / "one.npy").read_bytes()):
        path.write_bytes(content)
        with pytest.raises(cs.InvalidInput, match=r"frames\.npz: not a recording that can be read"):
            cs.Recording.load(path)
    np.savez(path, times=np.zeros(1))
    with pytest.raises(cs.InvalidInput, match=r"frames\.npz: .*meta"):
        cs.Recording.load(path)
    with pytest.raises(cs.InvalidInput, match=r"none\.npz: .*No such file"):
        cs.Recording.load(tmp_path / "none.npz")


def test_the_command_writes_each_format_beside_the_frames(tmp_path: Path, run_cli: RunCli) -> None:
    recording().save(tmp_path / "frames.npz")
    formats = ["usd", "gltf", "pc2", "vtk", "obj", "ply"]
    arguments = [word for name in formats for word in ("-f", name)]
    done = run_cli("export", tmp_path, *arguments, "--json")
    assert done.returncode == 0, done.stderr
    written = json.loads(done.stdout)["written"]
    names = ["scene.usdc", "scene.glb", "pc2", "vtk", "obj", "ply"]
    assert written == [str(tmp_path / name) for name in names]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*names, "frames.npz"])
    again = run_cli("export", tmp_path, "-f", "gltf")
    assert again.returncode == 2
    assert "--overwrite replaces it" in again.stderr
    assert run_cli("export", tmp_path, "-f", "gltf", "--overwrite").returncode == 0
    elsewhere = run_cli("export", tmp_path / "frames.npz", "-f", "pc2", "--to", tmp_path / "deep" / "er")
    assert elsewhere.returncode == 0, elsewhere.stderr
    assert (tmp_path / "deep" / "er" / "pc2" / "sheet.pc2").exists()
    missing = run_cli("export", tmp_path / "vtk", "-f", "gltf")
    assert missing.returncode == 2
    assert "frames.npz: expected the frames of a run" in missing.stderr
