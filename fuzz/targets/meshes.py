"""Mesh files: OBJ, PLY, STL, glTF, USD, damaged byte by byte, number by number and, for glTF, value by value.

A file is either a sound mesh, which OBJ holds again to the bit, or refused by an error that names it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim._formats import obj, ply
from clothsim.errors import InvalidInput, MeshError
from fuzz import seeds
from fuzz.mutations import damaged, damaged_tree, edits, tree_edits
from fuzz.target import File, Target
from fuzz.targets.files import read, sound_mesh

__all__ = ["gltf_files", "target", "usd_files"]


def target() -> Target:
    """Mesh files."""
    small = st.builds(_damaged, st.sampled_from(seeds.meshes()), edits())
    return Target(
        "meshes", "mesh files: OBJ, PLY, STL, glTF, USD", st.one_of(small, small, small, _LARGE, gltf_files(),
        usd_files()),
        check, lambda case: (case.suffix, case.content), File, plant, quick=200,
    )  # fmt: skip


def _damaged(seed: File, todo: list[tuple[object, ...]]) -> File:
    return File(seed.suffix, damaged(seed.content, todo))


def gltf_files() -> st.SearchStrategy[File]:
    """GLB and glTF files."""
    tree, blob = seeds.animated_gltf()
    trees = st.builds(damaged_tree, st.just(tree), tree_edits())
    return st.one_of(
        st.builds(lambda t, todo: File(".glb", seeds.binary_gltf(t, damaged(blob, todo))), trees, edits(1)),
        st.builds(lambda t: File(".gltf", seeds.text_gltf(t, blob)), trees),
        st.builds(lambda todo: File(".glb", damaged(seeds.binary_gltf(tree, blob), todo)), edits()),
    )


def usd_files() -> st.SearchStrategy[File]:
    """USD files as text; and as crate, which usd-core reads alone."""
    return st.builds(_damaged, st.sampled_from(seeds.stages()), edits(3))


def _many(kind: str, count: int) -> File:
    """Files of one large thing."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = np.where(np.arange(count) % 2, 1.0, 0.5) if "star" in kind else 1.0
    rows = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    if kind == "spiral":
        rows = np.stack([angle * np.cos(9 * angle), angle * np.sin(9 * angle), 0.0 * angle], axis=1)
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in rows.tolist())
    if kind == "groups":
        return File(".obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"".join(b"g g%d\nf 1 2 3\n" % k for k in range(count)))
    return File(".obj", (text + "f " + " ".join(map(str, range(1, count + 1))) + "\n").encode())


_LARGE = st.builds(_many, st.sampled_from(["star", "circle", "spiral", "groups"]), st.sampled_from([5, 100, 3000]))


def check(case: File) -> None:
    """Read it; write and read what came."""
    mesh = read(case, cs.Mesh.load, MeshError, InvalidInput)
    if mesh is None:
        return
    sound_mesh(mesh)
    raw = cs._formats.RawMesh(mesh.vertices, mesh.triangles, mesh.uv, mesh.groups)
    again = obj.parse(obj.dump(raw), "again.obj")
    assert np.array_equal(again.vertices, mesh.vertices) and np.array_equal(again.triangles, mesh.triangles)
    assert (again.uv is None) == (mesh.uv is None)
    assert again.uv is None or mesh.uv is None or np.array_equal(again.uv, mesh.uv)
    again = ply.parse(ply.dump(raw), "again.ply")
    assert np.array_equal(again.vertices, mesh.vertices) and np.array_equal(again.triangles, mesh.triangles)


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A writer of OBJ that forgets UV."""
    honest = obj.dump
    with mock.patch.object(obj, "dump", lambda mesh: honest(mesh._replace(uv=None))):
        yield
