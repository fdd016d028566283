"""Regions, odd names and odd times in what is written, read back by usd-core, pygltflib, trimesh and an XML parser."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import RunCli
from test_export import accessor

import clothsim as cs

NAMES = ["Hemd Ärmel.001", "1st/cloth", "def", "DEF", "World", "Looks", "体", "a\x00b\n\x1bc"]


def shirt() -> cs.Simulation:
    """Quads and a collar of another material, by group, by vertices and by box; a ball; z up, 24 frames a second."""
    grid = cs.Mesh.grid(1.0, 1.0, 5, 5)
    mesh = cs.Mesh(grid.vertices, grid.triangles, grid.uv, groups={"Kragen 1": np.arange(8)})
    box = {"min": [-1, -1, 0.2], "max": [1, 1, 1]}
    scene = cs.Scene(name="shirt", duration=0.1, up="z", gravity=[0, 0, -9.81], output={"fps": 24})
    scene.add_cloth(
        mesh, "cotton", name="Hemd Ärmel.001",
        regions=[
            {"group": "Kragen 1", "material": "denim"},
            {"vertices": [0, 1, 5, 6], "material": "silk"},
            {"box": box, "material": "silk"},
        ],
    )  # fmt: skip
    scene.add_cloth(cs.Mesh.grid(0.2, 0.3, 3, 4), "silk", name="plain", position=(3, 0, 0))
    scene.add_collider("ball", shape={"type": "sphere", "radius": 0.1, "tolerance": 0.01}, position=(0, 0, -2))
    return cs.Simulation(scene)


@pytest.fixture(scope="module")
def frames() -> cs.Recording:
    return cs.record(shirt(), 0.1, fps=24, progress=False)


@pytest.fixture(scope="module")
def expected(frames: cs.Recording) -> dict[str, list[int]]:
    """Triangles of each region, from the meshes alone: later ones go before."""
    body = frames.bodies[0]
    x = frames.positions(body, 0)
    boxed = [t for t in range(32) if (x[body.triangles[t]][:, 2] >= 0.2).all()]
    corner = [t for t in range(32) if set(body.triangles[t].tolist()) <= {0, 1, 5, 6}]
    assert len(corner) == 2
    rest = {"silk": [t for t in corner if t not in boxed], "silk 2": boxed}
    taken = [*rest["silk"], *boxed]
    return {"Kragen 1": [t for t in range(8) if t not in taken], **rest}


def test_a_recording_knows_its_regions(frames: cs.Recording, expected: dict[str, list[int]], tmp_path: Path) -> None:
    frames.save(tmp_path / "a.npz")
    again = cs.Recording.load(tmp_path / "a.npz")
    for recording in (frames, again):
        regions = recording.bodies[0].regions
        assert {name: own.tolist() for name, own in regions.items()} == {k: v for k, v in expected.items() if v}
        assert not recording.bodies[1].regions
    again.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    data = dict(np.load(tmp_path / "a.npz"))
    for broken, words in ((data["regions_0"] + 5, r"regions in −1\.\.\d"), (data["regions_0"][:3], "shape")):
        np.savez(tmp_path / "c.npz", **{**data, "regions_0": broken})
        with pytest.raises(cs.InvalidInput, match=f"regions_0: expected .*{words}"):
            cs.Recording.load(tmp_path / "c.npz")


def test_usd_has_a_subset_with_a_material_for_each_region(frames: cs.Recording, tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="the extra 'usd' is not installed")
    from pxr import UsdGeom, UsdShade, UsdValidation

    frames.save_usd(tmp_path / "a.usdc")
    stage = usd.Stage.Open(str(tmp_path / "a.usdc"))
    body, prim = frames.bodies[0], stage.GetPrimAtPath("/World/Hemd___rmel_001")
    assert prim.GetDisplayName() == "Hemd Ärmel.001"
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    shown = [s.GetPrim().GetDisplayName() or s.GetPrim().GetName() for s in subsets]
    assert shown == [body.name, *body.regions], "what is in no region has a subset, too: Blender looks at nothing else"
    rest = np.setdiff1d(np.arange(32), np.concatenate([*body.regions.values()]))
    own, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    colours = set()
    for subset, triangles in zip(subsets, [rest, *body.regions.values()], strict=True):
        np.testing.assert_array_equal(subset.GetIndicesAttr().Get(), triangles)
        assert subset.GetElementTypeAttr().Get() == "face"
        material, _ = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()
        assert (material.GetPath() == own.GetPath()) == (subset == subsets[0])
        shader = material.ComputeSurfaceSource()[0]
        colours.add(tuple(shader.GetInput("diffuseColor").Get()))
    assert len(colours) == 4
    assert UsdGeom.Subset.GetFamilyType(UsdGeom.Imageable(prim), "materialBind") == "partition"
    assert not UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/World/plain")).GetMaterialBindSubsets()
    assert stage.GetPrimAtPath("/World/Looks").GetTypeName() == "Scope"
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetErrorAsString() for error in found] == []
    # The validators see what is wrong with subsets: one triangle in two of them.
    subsets[0].GetIndicesAttr().Set(list(range(32)))
    assert UsdValidation.ValidationContext(validators).Validate(stage)


def test_gltf_has_a_primitive_with_a_material_for_each_region(frames: cs.Recording, tmp_path: Path) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    trimesh = pytest.importorskip("trimesh")
    frames.save_gltf(tmp_path / "a.glb")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    primitives, body = gltf.meshes[0].primitives, frames.bodies[0]
    names = [gltf.materials[p.material].name for p in primitives]
    assert names == [body.name, *(f"{body.name} {region}" for region in body.regions)]
    assert len(gltf.materials) == len(names) + 2
    assert len({tuple(gltf.materials[p.material].pbrMetallicRoughness.baseColorFactor) for p in primitives}) == 4
    x = accessor(gltf, primitives[0].attributes.POSITION)
    corners = []
    for primitive in primitives:
        assert primitive.attributes.POSITION == primitives[0].attributes.POSITION, "the vertices are there once"
        assert primitive.targets == primitives[0].targets
        entry = gltf.accessors[primitive.indices]
        start = gltf.bufferViews[entry.bufferView].byteOffset
        corners.append(np.frombuffer(gltf.binary_blob(), "<u4", entry.count, start).reshape(-1, 3))
    for found, own in zip(corners[1:], body.regions.values(), strict=True):
        np.testing.assert_array_equal(x[found], frames.positions(body, 0).astype(np.float32)[body.triangles[own]])
    assert sum(map(len, corners)) == 32
    assert len(trimesh.load_scene(tmp_path / "a.glb", process=False).geometry) == 6
    # We read our own as one body again.
    walk = cs.Animation.load(tmp_path / "a.glb", fps=24)
    assert walk.triangles.shape == (32 + 12 + len(frames.bodies[2].triangles), 3)


def test_obj_files_keep_regions_as_groups(frames: cs.Recording, tmp_path: Path) -> None:
    frames.save_sequence(tmp_path / "obj", "obj")
    frames.save_pc2(tmp_path / "pc2")
    expected = {"_".join(name.split()): own.tolist() for name, own in frames.bodies[0].regions.items()}
    for path in (tmp_path / "obj" / "Hemd_Ärmel_001_0002.obj", tmp_path / "pc2" / "Hemd_Ärmel_001.obj"):
        assert {name: own.tolist() for name, own in cs.Mesh.load(path).groups.items()} == expected
    assert not cs.Mesh.load(tmp_path / "obj" / "plain_0001.obj").groups


def odd() -> cs.Recording:
    """Names that file names, USD and XML cannot hold; at 24 frames a second, the last between two."""
    bodies = [cs.Body(name, "cloth", 3, np.array([[0, 1, 2]])) for name in NAMES]
    x = np.random.default_rng(3).normal(size=(4, 3 * len(NAMES), 3))
    return cs.Recording(bodies, np.array([0, 1, 2, 2.5]) / 24, x, fps=24.0, name='1/2 "<&>"')


def test_names_of_any_kind_are_told_apart_and_kept(tmp_path: Path) -> None:
    frames = odd()
    usd = pytest.importorskip("pxr.Usd", reason="the extra 'usd' is not installed")
    from pxr import UsdGeom, UsdShade

    frames.save_usd(tmp_path / "a.usda")
    stage = usd.Stage.Open(str(tmp_path / "a.usda"))
    meshes = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    shown = [mesh.GetDisplayName() or mesh.GetName() for mesh in meshes]
    assert [name.split("\x00")[0] for name in shown] == [name.split("\x00")[0] for name in NAMES]
    bound = [UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].GetPath() for mesh in meshes]
    assert len(set(bound)) == len(NAMES)
    for body, mesh in zip(frames.bodies, meshes, strict=True):
        points = np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get(1))
        np.testing.assert_array_equal(points, frames.positions(body, 1).astype(np.float32))
    if_there: Any = pytest.importorskip("pyvista", reason="the extra 'view' is not installed")
    frames.save_vtk(tmp_path / "vtk")
    labels = [entry.get("name") for entry in ET.parse(tmp_path / "vtk" / "scene.pvd").getroot().iter("DataSet")]
    assert labels[:: len(frames)][:-1] == NAMES[:-1]
    assert "\N{REPLACEMENT CHARACTER}" in str(labels[-1])
    assert len(if_there.get_reader(str(tmp_path / "vtk" / "scene.pvd")).read()) == len(NAMES)


def test_a_last_frame_between_two_is_at_its_time(tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="the extra 'usd' is not installed")
    from pxr import UsdGeom

    odd().save_usd(tmp_path / "a.usdc")
    stage = usd.Stage.Open(str(tmp_path / "a.usdc"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 2.5)
    mesh = next(UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    assert mesh.GetPointsAttr().GetTimeSamples() == [0.0, 1.0, 2.0, 2.5]
    # Rates that are no whole numbers, and times that were added up, give whole codes.
    rate = 60000 / 1001
    triangle = cs.Body("a", "cloth", 3, np.array([[0, 1, 2]]))
    times = 7 / rate + np.cumsum(np.full(400, 1 / rate))
    cs.Recording([triangle], times, np.zeros((400, 3, 3)), fps=rate).save_usd(tmp_path / "b.usdc")
    stage = usd.Stage.Open(str(tmp_path / "b.usdc"))
    codes = UsdGeom.Mesh(stage.GetPrimAtPath("/World/a")).GetPointsAttr().GetTimeSamples()
    assert codes == [8.0 + k for k in range(400)]


@pytest.mark.parametrize(("form", "package"), [("usd", "pxr"), ("gltf", ""), ("pc2", "")])
def test_coordinates_that_a_format_cannot_hold_are_refused(
    tmp_path: Path, run_cli: RunCli, form: str, package: str
) -> None:
    if package:
        pytest.importorskip(package)
    triangle = cs.Body("a", "cloth", 3, np.array([[0, 1, 2]]))
    cs.Recording([triangle], np.zeros(1), 1e300 * np.eye(3)[None]).save(tmp_path / "afar.npz")
    done = run_cli("export", tmp_path / "afar.npz", "-f", form, "--to", tmp_path / "to")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("clothsim: recording: expected coordinates up to 3.4e+38 m to write")
    assert not list((tmp_path / "to").iterdir())
    largest = float(np.finfo(np.float32).max)
    cs.Recording([triangle], np.zeros(1), largest * np.eye(3)[None]).save(tmp_path / "afar.npz")
    assert run_cli("export", tmp_path / "afar.npz", "-f", form, "--to", tmp_path / "to").returncode == 0


def test_what_cannot_be_written_is_named(tmp_path: Path, run_cli: RunCli) -> None:
    cs.Recording([], np.zeros(1), np.zeros((1, 0, 3))).save(tmp_path / "nobody.npz")
    with pytest.raises(cs.InvalidInput, match="at least one body to write glTF"):
        cs.Recording.load(tmp_path / "nobody.npz").save_gltf(tmp_path / "a.glb")
    (tmp_path / "file").write_text("")
    done = run_cli("export", tmp_path / "nobody.npz", "-f", "obj", "--to", tmp_path / "file" / "folder")
    assert done.returncode == 1
    assert f"cannot write {tmp_path / 'file' / 'folder'}: Not a directory" in done.stderr
