"""Mesh files: what is written reads back, and files of other programs are understood."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import clothsim as cs
from clothsim._formats.polygons import triangulate

trimesh = pytest.importorskip("trimesh", reason="trimesh, a reader that is not ours, is not installed")

# Two panels that share the edge (1, 2) and have their own UV there: a seam.
SEAM = cs.Mesh(
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.25], [2.0, 1 / 3, -1e-17]],
    [[0, 1, 2], [1, 3, 2]],
    [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[5.0, 0.0], [6.0, 0.0], [5.0, 1.1]]],
)


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_what_is_saved_reads_back_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(1)
    grid = cs.Mesh.grid(1.0, 1.0, 7, 5)
    mesh = cs.Mesh(grid.vertices + rng.normal(size=grid.vertices.shape) * 1e-3, grid.triangles, grid.uv)
    mesh.save(tmp_path / f"a.{suffix}")
    assert cs.Mesh.load(tmp_path / f"a.{suffix}") == mesh


def test_a_seam_stays_closed_in_obj(tmp_path: Path) -> None:
    SEAM.save(tmp_path / "seam.obj")
    loaded = cs.Mesh.load(tmp_path / "seam.obj")
    assert loaded == SEAM
    # The reason for an OBJ reader of our own: trimesh cuts the seam, or drops the UV of one of its sides.
    assert len(trimesh.load_mesh(tmp_path / "seam.obj", process=False).vertices) == 6
    kept = trimesh.load_mesh(tmp_path / "seam.obj", process=False, maintain_order=True)
    assert kept.visual.uv.shape == (4, 2)


def test_ply_leaves_out_uv_that_it_cannot_hold(tmp_path: Path) -> None:
    SEAM.save(tmp_path / "seam.ply")
    loaded = cs.Mesh.load(tmp_path / "seam.ply")
    assert loaded.uv is None
    np.testing.assert_array_equal(loaded.triangles, SEAM.triangles)


def test_our_files_are_what_trimesh_reads(tmp_path: Path) -> None:
    mesh = cs.Mesh.sphere(1.0, 2)
    for suffix in ("obj", "ply"):
        mesh.save(tmp_path / f"a.{suffix}")
        theirs = trimesh.load_mesh(tmp_path / f"a.{suffix}", process=False)
        np.testing.assert_allclose(theirs.vertices, mesh.vertices, rtol=0, atol=0)
        np.testing.assert_array_equal(theirs.faces, mesh.triangles)


OBJ = """# a comment
mtllib none.mtl
o thing
v 0 0 0
v 1 0 0 0.5 0.5 0.5
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
g group
s off
usemtl red
f 1/1/1 2/2/1 3/3/1 \\
 4/4/1
v 2 0 0
vt 2 0
f -4/2 -1/5 -3/3
l 1 2
"""


def test_obj_of_other_programs(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    mesh = cs.Mesh.load(tmp_path / "a.obj")
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 2]]
    assert mesh.uv is not None
    assert mesh.uv[2].tolist() == [[1, 0], [2, 0], [1, 1]]
    (tmp_path / "b.obj").write_bytes(OBJ.replace("\n", "\r\n").encode())
    assert cs.Mesh.load(tmp_path / "b.obj") == mesh


def test_obj_that_starts_with_a_byte_order_mark(tmp_path: Path) -> None:
    text = "v 1 2 3\nv 2 2 3\nv 1 3 3\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text, encoding="utf-8-sig")
    assert cs.Mesh.load(tmp_path / "a.obj").vertices.tolist() == [[1, 2, 3], [2, 2, 3], [1, 3, 3]]


def ply(fmt: str, faces: list[list[int]]) -> bytes:
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.5], [2.0, 1.0, 0.25]]
    header = (
        f"ply\nformat {fmt} 1.0\ncomment made by a test\nelement vertex {len(corners)}\nproperty float x\n"
        "property float y\nproperty float z\nproperty uchar red\nproperty double s\nproperty double t\n"
        f"element face {len(faces)}\nproperty uchar flag\nproperty list uchar int vertex_indices\n"
        "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    ).encode()
    if fmt == "ascii":
        rows = [f"{x} {y} {z} 7 {x} {y}" for x, y, z in corners]
        rows += [f"1 {len(f)} {' '.join(map(str, f))}" for f in faces] + ["0 1"]
        return header + ("\n".join(rows) + "\n").encode()
    e = "<" if fmt == "binary_little_endian" else ">"
    body = b"".join(struct.pack(f"{e}3fB2d", *p, 7, p[0], p[1]) for p in corners)
    body += b"".join(struct.pack(f"{e}BB{len(f)}i", 1, len(f), *f) for f in faces)
    return header + body + struct.pack(f"{e}2i", 0, 1)


@pytest.mark.parametrize("fmt", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(
    ("faces", "triangles"),
    [
        ([[0, 1, 2], [0, 2, 3], [1, 4, 5]], [[0, 1, 2], [0, 2, 3], [1, 4, 5]]),
        ([[0, 1, 2, 3], [1, 4, 5, 2]], [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]),
        ([[1, 4, 5], [0, 1, 2, 3]], [[1, 4, 5], [0, 1, 2], [0, 2, 3]]),
    ],
    ids=["triangles", "quads", "mixed"],
)
def test_ply_of_all_three_kinds(tmp_path: Path, fmt: str, faces: list[list[int]], triangles: list[list[int]]) -> None:
    (tmp_path / "a.ply").write_bytes(ply(fmt, faces))
    mesh = cs.Mesh.load(tmp_path / "a.ply")
    assert mesh.triangles.tolist() == triangles
    assert mesh.vertices[4].tolist() == [2, 0, 0.5]
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, mesh.vertices[mesh.triangles][..., :2])


@pytest.mark.parametrize("ascii_", [False, True], ids=["binary", "ascii"])
def test_stl_corners_become_one_vertex_again(tmp_path: Path, ascii_: bool) -> None:
    mesh = cs.Mesh.box((1.0, 2.0, 3.0), (2, 1, 1))
    soup = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    (tmp_path / "a.stl").write_bytes(
        soup.export(file_type="stl_ascii").encode() if ascii_ else soup.export(file_type="stl")
    )
    loaded = cs.Mesh.load(tmp_path / "a.stl")
    assert len(loaded.vertices) == len(mesh.vertices)
    np.testing.assert_allclose(loaded.vertices[loaded.triangles], mesh.vertices[mesh.triangles], atol=1e-6)


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
def test_gltf_keeps_transforms_seams_and_uv(tmp_path: Path, suffix: str) -> None:
    corners = SEAM.vertices[SEAM.triangles].reshape(-1, 3)
    assert SEAM.uv is not None
    visual = trimesh.visual.TextureVisuals(uv=SEAM.uv.reshape(-1, 2))
    part = trimesh.Trimesh(corners, np.arange(6).reshape(2, 3), visual=visual, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(part, transform=trimesh.transformations.translation_matrix([0, 2, 0]))
    if suffix == "glb":
        (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb"))
    else:
        for name, content in scene.export(file_type="gltf").items():
            (tmp_path / ("a.gltf" if name.endswith(".gltf") else name)).write_bytes(content)
    loaded = cs.Mesh.load(tmp_path / f"a.{suffix}")
    assert len(loaded.vertices) == 4
    np.testing.assert_allclose(loaded.vertices[loaded.triangles], SEAM.vertices[SEAM.triangles] + [0, 2, 0], atol=1e-6)
    assert loaded.uv is not None
    np.testing.assert_allclose(loaded.uv, SEAM.uv, atol=1e-6)


def test_a_concave_polygon_is_cut_inside() -> None:
    dart = np.array([[0.0, 0, 0], [2, 2, 0], [0, 1, 0], [-2, 2, 0]])  # concave at corner 2
    cut = {frozenset(t) for t in triangulate(dart)}
    assert cut == {frozenset({0, 1, 2}), frozenset({0, 2, 3})}
    turned = np.roll(dart, 1, axis=0)  # a fan from its first corner would leave the polygon
    assert {frozenset(t) for t in triangulate(turned)} == {frozenset({1, 2, 3}), frozenset({1, 3, 0})}
    star = np.array(
        [[np.cos(a) * r, 0, -np.sin(a) * r] for a, r in zip(np.arange(10) * np.pi / 5, [1, 0.4] * 5, strict=True)]
    )
    area = sum(0.5 * np.linalg.norm(np.cross(star[b] - star[a], star[c] - star[a])) for a, b, c in triangulate(star))
    assert area == pytest.approx(5 * 0.4 * np.sin(np.pi / 5))
    # Same side as the polygon.
    assert all(np.cross(star[b] - star[a], star[c] - star[a])[1] > 0 for a, b, c in triangulate(star))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"v 0 0\n", "a.obj, line 1: cannot understand 'v 0 0'"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "line 2: .*vertex 2 does not exist"),
        ("a.obj", b"v 0 0 0\n", "at least one face"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a.obj: vertices: expected finite"),
        ("a.ply", b"PLY?", "a.ply: not a PLY file"),
        ("a.ply", ply("binary_little_endian", [[0, 1, 2]])[:-40], "ends before its last element"),
        ("a.ply", ply("ascii", [[0, 1, 9]]), "face index 9 does not exist"),
        ("a.stl", b"not an stl", "a.stl: "),
        ("a.glb", b"not a glb", "a.glb: not a mesh file"),
        ("a.fbx", b"", "expected a mesh file .*got suffix '.fbx'"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        cs.Mesh.load(tmp_path / name)


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(cs.MeshError, match=r"none\.obj: cannot read the mesh: No such file"):
        cs.Mesh.load(tmp_path / "none.obj")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(cs.MeshError, match="cannot read the mesh"):
        cs.Mesh.load(tmp_path / "folder.obj")


def test_an_unknown_suffix_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(cs.MeshError, match=r"can be written \(\.obj, \.ply\), got '\.stl'"):
        SEAM.save(tmp_path / "a.stl")
    assert list(tmp_path.iterdir()) == []


def test_fractional_face_indices_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "fraction.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar float vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2.5\n"
    )
    with pytest.raises(cs.MeshError, match=r"whole numbers as face indices, got \[0.0, 1.0, 2.5\]"):
        cs.Mesh.load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [("hello", "expected JSON"), ("ply\nformat weird 1.0\nend_header\n", "header line 'format weird 1.0'")],
)
def test_junk_is_named(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / ("junk.ply" if content.startswith("ply") else "junk.gltf")
    path.write_text(content)
    with pytest.raises(cs.MeshError, match=message):
        cs.Mesh.load(path)
