"""Meshes: what is accepted, what is refused and how."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import clothsim as cs

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
FACES = np.array([[0, 1, 2], [2, 1, 3]])


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_both_integer_types_are_taken(dtype: type) -> None:
    mesh = cs.Mesh(CORNERS, FACES.astype(dtype))
    assert mesh.triangles.dtype == np.int64
    assert mesh.vertices.dtype == np.float64
    np.testing.assert_array_equal(mesh.triangles, FACES)


def test_non_contiguous_and_narrow_input_is_taken_exactly() -> None:
    wide = np.zeros((4, 6), dtype=np.float32)
    wide[:, ::2] = CORNERS
    mesh = cs.Mesh(wide[:, ::2], np.asfortranarray(FACES))
    np.testing.assert_array_equal(mesh.vertices, CORNERS)
    np.testing.assert_array_equal(mesh.triangles, FACES)


def test_a_mesh_neither_aliases_its_input_nor_changes() -> None:
    corners = CORNERS.copy()
    mesh = cs.Mesh(corners, FACES)
    corners[0] = 7.0
    assert mesh.vertices[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1.0
    assert pickle.loads(pickle.dumps(mesh)) == mesh


def test_uv_per_vertex_becomes_uv_per_corner() -> None:
    uv = CORNERS[:, :2]
    mesh = cs.Mesh(CORNERS, FACES, uv)
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, uv[FACES])


BAD: list[tuple[str, Any, Any, Any, type[Exception], str]] = [
    ("shape of vertices", np.zeros((12, 4)), FACES, None, cs.InvalidInput,
     r"vertices: expected shape \(n, 3\) and float64, got shape \(12, 4\), float64"),
    ("type of vertices", CORNERS.astype(complex), FACES, None, cs.InvalidInput, "vertices: .*complex128"),
    ("objects", np.array([["a"] * 3] * 3), FACES, None, cs.InvalidInput, "vertices: .*<U1"),
    ("type of triangles", CORNERS, np.zeros((12, 4)), None, cs.InvalidInput,
     r"triangles: expected shape \(m, 3\) and int32 or int64, got shape \(12, 4\), float64"),
    ("shape of triangles", CORNERS, np.zeros((2, 4), dtype=int), None, cs.InvalidInput,
     r"triangles: .*got shape \(2, 4\), int64"),
    ("one dimension", CORNERS, np.zeros(3, dtype=int), None, cs.InvalidInput, r"triangles: .*got shape \(3,\), int64"),
    ("unsigned", CORNERS, FACES.astype(np.uint8), None, cs.InvalidInput, "triangles: .*uint8"),
    ("NaN", np.where(CORNERS == 1, np.nan, CORNERS), FACES, None, cs.InvalidInput,
     r"vertices: expected finite coordinates, got \(NaN, 0, 0\) at vertex 1"),
    ("infinite", np.where(CORNERS == 1, np.inf, CORNERS), FACES, None, cs.InvalidInput,
     "vertices: .*inf.* at vertex 1"),
    ("index too high", CORNERS, [[0, 1, 2], [0, 1, 4]], None, cs.InvalidInput,
     r"triangles: expected indices in 0\.\.4, got 4 in triangle 1"),
    ("negative index", CORNERS, [[0, 1, -1]], None, cs.InvalidInput, "triangles: .*-1 in triangle 0"),
    ("zero area", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], None, cs.MeshError, r"area, triangle 0 .*0, 1, 2"),
    ("repeated vertex", CORNERS, [[0, 1, 2], [1, 3, 3]], None, cs.MeshError, r"triangle 1 .*1, 3, 3"),
    ("unreferenced", CORNERS, [[0, 1, 2]], None, cs.MeshError, "every vertex in a triangle.*vertex 3"),
    ("empty", CORNERS, np.zeros((0, 3), dtype=int), None, cs.MeshError, "at least one triangle"),
    ("shape of uv", CORNERS, FACES, np.zeros((3, 2)), cs.InvalidInput,
     r"uv: expected shape \(4, 2\) .*got shape \(3, 2\)"),
    ("uv not finite", CORNERS, FACES, np.full((4, 2), np.nan), cs.InvalidInput, "uv: expected finite"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("vertices", "triangles", "uv", "error", "message"), [b[1:] for b in BAD], ids=[b[0] for b in BAD]
)
def test_bad_meshes_are_refused(vertices: Any, triangles: Any, uv: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        cs.Mesh(vertices, triangles, uv)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, cs.ClothSimError)


def test_a_mesh_error_names_the_element_in_attributes() -> None:
    with pytest.raises(cs.MeshError) as caught:
        cs.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert (caught.value.kind, caught.value.triangles, caught.value.vertices) == ("zero-area", (0,), (0, 1, 2))


GENERATED = {
    "grid": lambda: cs.Mesh.grid(2.0, 1.0, 5, 4),
    "disc": lambda: cs.Mesh.disc(0.5, 6),
    "ribbon": lambda: cs.Mesh.ribbon(1.0, 0.1, 11, 3, twist=0.5),
    "cylinder": lambda: cs.Mesh.cylinder(0.3, 1.0, 16, 4, caps=True),
    "tube": lambda: cs.Mesh.cylinder(0.3, 1.0, 16, 4),
    "cone": lambda: cs.Mesh.cone(0.3, 1.0, 16),
    "capsule": lambda: cs.Mesh.capsule(0.2, 0.5, 16, 4),
    "sphere": lambda: cs.Mesh.sphere(1.0, 3),
    "box": lambda: cs.Mesh.box((1.0, 2.0, 3.0), (2, 2, 2)),
}


@pytest.mark.parametrize("name", GENERATED)
def test_generators_make_meshes_that_pass_the_checks(name: str) -> None:
    made = GENERATED[name]()
    again = cs.Mesh(made.vertices, made.triangles, made.uv)
    assert again == made
    assert (made.uv is not None) == (name in {"grid", "disc", "ribbon", "tube"})
    with pytest.raises(ValueError, match="read-only"):
        made.vertices[0] = 0.0


def test_sizes_of_generators_are_metres() -> None:
    low, high = cs.Mesh.grid(2.0, 1.0, 5, 4).bounds
    np.testing.assert_allclose(high - low, [2.0, 0.0, 1.0])
    assert cs.Mesh.grid(2.0, 1.0, 5, 4).area == pytest.approx(2.0)
    np.testing.assert_allclose(np.linalg.norm(cs.Mesh.sphere(0.7, 2).vertices, axis=1), 0.7)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cs.Mesh.grid(-1.0, 1.0, 5, 5), "width: .*positive.* got -1"),
        (lambda: cs.Mesh.grid(1.0, float("nan"), 5, 5), "height: .*NaN"),
        (lambda: cs.Mesh.grid(1.0, 1.0, 1, 5), "nx"),
        (lambda: cs.Mesh.grid(1.0, 1.0, -5, 5), "nx: expected a whole number ≥ 0, got -5"),
        (lambda: cs.Mesh.grid(1.0, 1.0, 2.5, 5), "nx: expected a whole number"),  # type: ignore[arg-type]
        (lambda: cs.Mesh.sphere(1.0, 40), "subdivisions"),
    ],
)
def test_bad_sizes_are_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
