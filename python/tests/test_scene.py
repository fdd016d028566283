"""Scenes: from Python and from files, and what is refused with file, line and key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE

import clothsim as cs

GRID = {"generator": "grid", "width": 1.0, "height": 1.0, "nx": 5, "ny": 5}


def cloth(**keys: Any) -> dict[str, Any]:
    return {"name": "cloth", "mesh": GRID, "material": "cotton", **keys}


def test_a_scene_says_the_same_after_saving_and_loading(tmp_path: Path) -> None:
    scene = cs.Scene(name="a", duration=0.2, up="z", contact={"thickness": 0.003}, output={"fps": 24})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 4, 4), cs.materials["silk"], velocities=np.ones((16, 3)))
    seam = cs.Mesh(
        [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [2.0, 1 / 3, 5.0]], [[0, 1, 2], [1, 3, 2]],
        [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[5.0, 0.0], [6.0, 0.0], [5.0, 1.1]]],
    )  # fmt: skip
    scene.add_cloth(seam, {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 100.0}}, name="flag/1")
    scene.add_collider("ball", mesh=cs.Mesh.sphere(0.3, 1), position=[0, -2, 0])
    frames = np.stack([cs.Mesh.sphere(0.3, 1).vertices + [0, 0.1 * k - 4, 0] for k in range(3)])
    scene.add_collider("walker", sequence=cs.Animation(frames, cs.Mesh.sphere(0.3, 1).triangles, fps=10))
    scene.save(tmp_path / "a.toml")
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "a.toml", "a_ball.ply", "a_cloth.ply", "a_cloth_velocities.npy", "a_flag_1.obj", "a_walker.npz",
    ]  # fmt: skip
    loaded = cs.Scene.load(tmp_path / "a.toml")
    ours, theirs = cs.Simulation(scene, threads=1), cs.Simulation(loaded, threads=1)
    np.testing.assert_array_equal(ours.positions, theirs.positions)
    np.testing.assert_array_equal(ours.velocities, theirs.velocities)
    np.testing.assert_array_equal(ours.collider_positions, theirs.collider_positions)
    assert loaded.to_dict()["up"] == "z"
    loaded.save(tmp_path / "b.toml")  # beside the files it names: they stay as they are
    assert not list(tmp_path.glob("b_*.ply"))
    (tmp_path / "elsewhere").mkdir()
    loaded.save(tmp_path / "elsewhere" / "c.toml")
    assert cs.Scene.load(tmp_path / "elsewhere" / "c.toml").to_dict()["cloth"][0]["mesh"] == {"file": "c_cloth.ply"}


def test_defaults_are_written_out() -> None:
    scene = cs.Scene(cloth=[cloth()])
    assert scene.to_dict()["time"]["integrator"] == "implicit-euler"
    assert scene.output["fps"] == 60.0
    assert "contact" not in scene.to_dict()


def test_a_failed_addition_changes_nothing() -> None:
    scene = cs.Scene(cloth=[cloth()])
    with pytest.raises(cs.InvalidScene, match=r"cloth\[1\]\.materail: .*did you mean \"material\""):
        scene.add_cloth(GRID, "cotton", name="second", materail="silk")
    with pytest.raises(cs.InvalidScene, match="a name that no other body has"):
        scene.add_cloth(GRID, "cotton")
    assert len(scene.to_dict()["cloth"]) == 1


BAD_KEYS: list[tuple[dict[str, Any], str]] = [
    ({"duration": 0.0}, r"duration: expected .*> 0.*s.*, got 0"),
    ({"duration": float("nan")}, "duration: expected a finite number, got nan"),
    ({"time": {"dt": 0.0}}, r"time\.dt: expected .*> 0"),
    ({"time": {"dt": -0.01}}, r"time\.dt: expected .*> 0.*got -0\.01"),
    ({"time": {"integrator": "euler"}}, r"time\.integrator: expected one of .*implicit-euler"),
    ({"solver": {"tolerance": "small"}}, r"solver\.tolerance: expected a finite number, got \"small\""),
    ({"gravity": [0, -9.81]}, "gravity: expected an array of 3"),
    ({"gravity": [0, np.inf, 0]}, r"gravity\[1\]: expected a finite number, got inf"),
    ({"contact": {"thickness": -0.001}}, r"contact\.thickness: expected .*> 0.*got -0\.001"),
    ({"contact": {"detector": "gird"}}, r"contact\.detector: .*bvh.*did you mean \"grid\""),
    ({"contact": {"friction": -1.0}}, r"contact\.friction"),
    ({"output": {"fps": 0}}, r"output\.fps"),
    ({"cloth": [cloth(material="coton")]}, r"cloth\[0\]\.material: .*did you mean \"cotton\""),
    ({"cloth": [cloth(mesh={**GRID, "width": -1})]}, r"cloth\[0\]\.mesh\.width: .*got -1"),
    ({"cloth": [cloth(pins=[{"vertices": [99]}])]}, r"cloth\[0\]\.pins\[0\]\.vertices"),
    ({"cloth": [cloth(pins=[{"vertices": [0], "collider": "ball"}])]}, r"pins\[0\]\.collider: "),
    ({"cloth": [cloth(rest="uv", mesh={"asset": "missing"})]}, r"cloth\[0\]\.mesh\.asset: "),
    ({"collider": [{"name": "a"}]}, r"collider\[0\]: expected exactly one of shape, mesh, sequence, got none"),
    ({"collider": [{"name": "a", "shape": {"type": "torus"}}]}, r"shape\.type: expected one of .*sphere"),
    ({"cloth": [cloth(velocity=object())]}, r"cloth\[0\]\.velocity: .*got object"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), BAD_KEYS, ids=[b[1][:30] for b in BAD_KEYS])
def test_bad_scenes(change: dict[str, Any], message: str) -> None:
    with pytest.raises(cs.InvalidScene, match=message) as caught:
        cs.Simulation(cs.Scene(**{"cloth": [cloth()], **change}))
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    ("in_plane", "message"),
    [
        ({"model": "baraff-witkin", "warp": -1.0, "weft": 1.0, "shear": 1.0}, r"in_plane\.warp: .*got -1"),
        ({"model": "spring", "stiffness": -5.0}, r"in_plane\.stiffness: .*got -5"),
        ({"model": "spring"}, "stiffness"),
        ({"model": "rubber"}, "rubber"),
    ],
)
def test_bad_materials(in_plane: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cs.Material(0.1, in_plane)
    with pytest.raises(ValueError, match=message):
        cs.Simulation(cs.Scene(cloth=[cloth(material={"areal_density": 0.1, "in_plane": in_plane})]))


def test_a_negative_mass_is_refused() -> None:
    spring = {"model": "spring", "stiffness": 1.0}
    with pytest.raises(cs.InvalidInput, match=r"areal_density: expected .*kg/m².*got -0\.2"):
        cs.Material(-0.2, spring)
    with pytest.raises(cs.InvalidScene, match=r"cloth\[0\]\.material\.areal_density: .*got -0\.2"):
        cs.Scene(cloth=[cloth(material={"areal_density": -0.2, "in_plane": spring})])


def test_the_library_is_a_mapping() -> None:
    assert "cotton" in cs.materials
    assert list(cs.materials) == cs.materials.names()
    assert len(cs.materials) == len(set(cs.materials.names()))
    for material in cs.materials.values():
        assert material.areal_density > 0.0
        assert cs.Material(**material.to_dict()) == material
    with pytest.raises(ValueError, match='cotton.*got "canvas"'):
        cs.materials["canvas"]


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("thickness = 0.006", "thikness = 0.006", 7, "contact.thikness"),
        ("dt = 0.005", "dt = 0", 5, "time.dt"),
        ('material = "cotton"', 'material = "wol"', 11, "cloth[0].material"),
        ("radius = 0.4", "radius = -0.4", 15, "collider[0].shape"),
        ("duration = 0.5", 'duration = "long"', 3, "duration"),
        ("fps = 30", "fps = = 30", 21, ""),
    ],
)
def test_errors_in_files_name_file_line_and_key(tmp_path: Path, old: str, new: str, line: int, key: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(SCENE.replace(old, new, 1))
    with pytest.raises(cs.InvalidScene) as caught:
        cs.Simulation(cs.Scene.load(path))
    assert caught.value.file == str(path)
    assert caught.value.line == line
    assert (caught.value.key or "").startswith(key)
    assert str(caught.value).startswith(f"{path}:{line}: ")


def test_an_unknown_key_comes_with_the_nearest_known_one(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(SCENE.replace("thickness", "thikness"))
    with pytest.raises(cs.InvalidScene, match='did you mean "thickness"') as caught:
        cs.Scene.load(path)
    assert caught.value.nearest == "thickness"


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ("none.obj", r"cloth\[0\]\.mesh\.file: .*none\.obj: cannot read the mesh: No such file"),
        ("flat.obj", r"non-zero area, triangle 0 \(vertices \[0, 1, 2\]\)"),
        ("loose.obj", "every vertex in a triangle, 1 are in none .*vertex 3"),
        ("fan.obj", r"at most two triangles on an edge .*edge \(0, 1\) has 3"),
    ],
)  # fmt: skip
def test_bad_mesh_files_are_named_with_the_line_of_the_scene(tmp_path: Path, mesh: str, message: str) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    (tmp_path / "loose.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\n")
    fan = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n"
    (tmp_path / "fan.obj").write_text(fan)
    path = tmp_path / "scene.toml"
    generator = 'mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 17, ny = 17 }'
    path.write_text(SCENE.replace(generator, f'mesh = {{ file = "{mesh}" }}'))
    with pytest.raises(cs.InvalidScene, match=message) as caught:
        cs.Simulation(cs.Scene.load(path))
    assert caught.value.line == 10


def test_a_non_manifold_edge_is_allowed_where_the_physics_is_defined() -> None:
    fan = cs.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    springs = {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 100.0}}
    cs.Simulation(cs.Scene(cloth=[cloth(mesh=fan, material=springs)])).step()
    with pytest.raises(cs.InvalidScene, match=r"edge \(0, 1\) has 3"):
        cs.Simulation(cs.Scene(cloth=[cloth(mesh=fan, material="cotton")]))


def test_unreadable_scene_files(tmp_path: Path) -> None:
    with pytest.raises(cs.InvalidScene, match=r"none\.toml: cannot read the scene: No such file"):
        cs.Scene.load(tmp_path / "none.toml")
    with pytest.raises(cs.InvalidScene, match="cannot read the scene: Is a directory"):
        cs.Scene.load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(cs.InvalidScene, match="cannot read the scene"):
        cs.Scene.load(tmp_path / "binary.toml")


def test_start_intersections_are_counted_and_named() -> None:
    upright = {"axis": [1, 0, 0], "angle": np.pi / 2}
    bodies = [cloth(), cloth(name="curtain", rotation=upright, position=[0.03, 0.0, 0.02])]
    scene = cs.Scene(cloth=bodies, contact={"thickness": 0.002})
    with pytest.raises(
        cs.IntersectingStart, match=r'(\d+) pairs.*triangle \d+ of "cloth" through .*"curtain"'
    ) as caught:
        cs.Simulation(scene)
    assert caught.value.count > 0
    assert len(caught.value.pairs) == min(caught.value.count, 64)
    sim = cs.Simulation(scene, allow_intersections=True)
    assert len(sim.intersections()) == caught.value.count
    bodies[0]["name"] = "sheet"
    allowed = cs.Scene(cloth=bodies, contact={"thickness": 0.002, "allow_intersections": True})
    assert len(cs.Simulation(allowed).intersections()) == caught.value.count


def test_saved_bodies_whose_names_make_the_same_file_name_keep_their_own_meshes(tmp_path: Path) -> None:
    scene = cs.Scene()
    meshes = [cs.Mesh.grid(1.0, 1.0, n, n) for n in (2, 3, 4)]
    for name, mesh in zip(("a/b", "a b", "A_b"), meshes, strict=True):
        scene.add_cloth(mesh, name=name)
    scene.save(tmp_path / "scene.toml")
    again, _, _ = cs.Scene.load(tmp_path / "scene.toml").assets()
    assert sorted(len(vertices) for vertices, *_ in again.values()) == [4, 9, 16]


@pytest.mark.parametrize("bodies", ["abc", {"name": "a"}, [1]])
def test_bodies_that_are_no_list_of_tables_are_named(bodies: Any) -> None:
    with pytest.raises(cs.InvalidScene, match="cloth: expected a list of tables"):
        cs.Scene(cloth=bodies)
