"""Garments: materials by region, seams that close, attachments to bodies that move."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim._arrays import Floats, Ints

GRID = cs.Mesh.grid(1.0, 1.0, 5, 5)


def panels(gap: float, n: int = 9) -> tuple[cs.Mesh, Ints, Ints]:
    """Two square panels of 0.4 m beside each other in one mesh, and their facing edges."""
    one = cs.Mesh.grid(0.4, 0.4, n, n)
    two = one.vertices + [0.4 + gap, 0, 0]
    mesh = cs.Mesh(np.concatenate([one.vertices, two]), np.concatenate([one.triangles, one.triangles + n * n]))
    right, left = np.arange(n) * n + n - 1, n * n + np.arange(n) * n
    return mesh, right, left


# Regions ----------------------------------------------------------------------------------------------------------


def obj(tmp_path: Path) -> Path:
    """A grid whose first triangles are of the group `cuff` and the material `heavy stuff`."""
    lines = [f"v {x} {y} {z}" for x, y, z in GRID.vertices]
    faces = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in GRID.triangles]
    lines += ["o shirt", "g cuff left", "usemtl heavy stuff", *faces[:8], "g", "usemtl light", *faces[8:]]
    path = tmp_path / "shirt.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_groups_of_an_obj_file_are_read_and_written(tmp_path: Path) -> None:
    mesh = cs.Mesh.load(obj(tmp_path))
    expected = {
        "shirt": range(32), "cuff": range(8), "left": range(8), "heavy stuff": range(8), "light": range(8, 32),
    }  # fmt: skip
    assert {name: members.tolist() for name, members in mesh.groups.items()} == {k: [*v] for k, v in expected.items()}
    mesh.save(tmp_path / "again.obj")
    again = cs.Mesh.load(tmp_path / "again.obj")
    assert {k.replace(" ", "_"): v.tolist() for k, v in mesh.groups.items()} == {
        k: v.tolist() for k, v in again.groups.items()
    }
    # Faces in no group are in the one that the format calls so; a "g" without a name is not read everywhere.
    cs.Mesh(GRID.vertices, GRID.triangles, groups={"hem": np.array([3]), "default": np.array([5])}).save(
        tmp_path / "d.obj"
    )
    lines = [line for line in (tmp_path / "d.obj").read_text().splitlines() if line.startswith("g")]
    assert lines == ["g default", "g hem", "g default", "g default_", "g default"]
    assert {k: v.tolist() for k, v in cs.Mesh.load(tmp_path / "d.obj").groups.items()} == {"hem": [3], "default_": [5]}
    with pytest.raises(cs.InvalidInput, match=r"groups\['a'\]: expected triangles in 0..32, got 32"):
        cs.Mesh(GRID.vertices, GRID.triangles, groups={"a": np.array([1, 32])})


LIGHT = {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 50.0}}
HEAVY = {"areal_density": 1.1, "in_plane": {"model": "baraff-witkin", "warp": 90.0, "weft": 80.0, "shear": 5.0},
         "bending": {"model": "hinge", "rigidity": 1e-4}}  # fmt: skip


def masses_with(*triangles: tuple[Any, Any]) -> Floats:
    """Lumped masses of the grid with areal densities of triangles."""
    masses = np.zeros(25)
    for which, density in triangles:
        for t in which:
            masses[GRID.triangles[t]] += density * (1.0 / 32) / 3
    return masses


def test_regions_have_their_own_materials(tmp_path: Path) -> None:
    mesh = cs.Mesh.load(obj(tmp_path))
    corners = {v for t in range(8) for v in GRID.triangles[t].tolist()}
    assert [t for t in range(32) if set(GRID.triangles[t].tolist()) <= corners] == [*range(8)]
    for region in (
        {"group": "cuff"},
        {"group": "heavy stuff"},
        {"triangles": [*range(8)]},
        {"vertices": sorted(corners)},
        {"box": {"min": [-1, -1, -0.51], "max": [1, 1, -0.24]}},
    ):
        scene = cs.Scene(duration=0.1)
        scene.add_cloth(mesh, LIGHT, regions=[{"material": HEAVY, **region}])
        sim = cs.Simulation(scene, threads=1)
        np.testing.assert_allclose(sim.masses, masses_with((range(8), 1.1), (range(8, 32), 0.1)), rtol=1e-12)
        on = {effect["name"]: effect["elements"] for effect in sim.plan["effects"] if effect["on"]}
        assert (on["baraff-witkin"], on["hinge"] > 0, on["spring"] > 0) == (8, True, True)
    # The later one counts, and a region may cover all.
    scene = cs.Scene(duration=0.1)
    regions = [{"material": "cotton", "triangles": [*range(32)]}, {"material": HEAVY, "triangles": [3, 4]}]
    scene.add_cloth(mesh, LIGHT, regions=regions)
    sim = cs.Simulation(scene, threads=1)
    cotton = cs.materials["cotton"].to_dict()["areal_density"]
    others = [t for t in range(32) if t not in (3, 4)]
    np.testing.assert_allclose(sim.masses, masses_with(([3, 4], 1.1), (others, cotton)), rtol=1e-12)
    assert not any(effect["name"] == "spring" and effect["on"] for effect in sim.plan["effects"])


def test_a_region_of_the_same_material_changes_nothing_but_rounding() -> None:
    def end(regions: list[dict[str, Any]]) -> Floats:
        scene = cs.Scene(duration=0.2)
        scene.add_cloth(GRID, LIGHT, pins=[{"vertices": [0, 4]}], regions=regions)
        sim = cs.Simulation(scene, threads=1)
        sim.advance(0.2)
        return sim.positions

    whole = end([])
    split = end([{"material": LIGHT, "triangles": [*range(0, 32, 3)]}])
    # The solver's tolerance of 1e-4 of each step's motion.
    np.testing.assert_allclose(split, whole, atol=1e-4)
    stiffer = {**LIGHT, "in_plane": {"model": "spring", "stiffness": 5.0}}
    assert np.abs(end([{"material": stiffer, "triangles": [*range(0, 32, 3)]}]) - whole).max() > 1e-2


def test_groups_go_with_a_saved_scene_and_a_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    obj(tmp_path)
    path.write_text(
        'duration = 0.1\n[[cloth]]\nname = "shirt"\nmesh = { file = "shirt.obj" }\nmaterial = "cotton"\n'
        '[[cloth.regions]]\ngroup = "cuff"\nmaterial = "denim"\n'
    )
    scene = cs.Scene.load(path)
    masses = cs.Simulation(scene).masses
    (tmp_path / "copy").mkdir()
    scene.save(tmp_path / "copy" / "scene.toml")
    np.testing.assert_array_equal(cs.Simulation(cs.Scene.load(tmp_path / "copy" / "scene.toml")).masses, masses)
    cs.Simulation(scene).save_checkpoint(tmp_path / "a.checkpoint")
    np.testing.assert_array_equal(cs.Simulation.resume(tmp_path / "a.checkpoint").masses, masses)
    assert (
        masses.max()
        > 1.5 * cs.Simulation(cs.Scene(cloth=[{"name": "a", "mesh": GRID, "material": "cotton"}])).masses.max()
    )


@pytest.mark.parametrize(
    ("region", "message"),
    [
        ({"group": "cuf"}, r"regions\[0\].group: expected one of the mesh's groups .*did you mean \"cuff\""),
        ({"triangles": [32]}, r"regions\[0\].triangles\[0\]: expected a triangle of \"cloth\", 0 to 31, got 32"),
        ({"vertices": [1, 25]}, r"regions\[0\].vertices\[1\]: expected a vertex of \"cloth\", 0 to 24, got 25"),
        ({"vertices": [1, 2]}, r"regions\[0\].vertices: expected at least one triangle"),
        ({"triangles": []}, r"regions\[0\].triangles: expected at least one triangle"),
        ({"box": {"min": [5, 5, 5], "max": [6, 6, 6]}}, r"regions\[0\].box: expected at least one triangle"),
        ({"box": {"min": [5, 5, 5], "max": [4, 6, 6]}}, r"regions\[0\].box: expected min ≤ max"),
        ({}, r"regions\[0\]: expected exactly one of group, triangles, vertices, box, got none"),
        ({"group": "cuff", "triangles": [1]}, r"regions\[0\]: expected exactly one of .*got more than one"),
        ({"group": "cuff", "material": "cottn"}, r"regions\[0\].material: .*did you mean \"cotton\""),
        ({"group": "cuff", "material": {**LIGHT, "areal_density": -1}}, r"regions\[0\].material.areal_density"),
    ],
)
def test_bad_regions_are_named(tmp_path: Path, region: dict[str, Any], message: str) -> None:
    scene = cs.Scene(duration=0.1)
    with pytest.raises(cs.InvalidScene, match=message):
        scene.add_cloth(cs.Mesh.load(obj(tmp_path)), "cotton", regions=[{"material": HEAVY, **region}])
        cs.Simulation(scene)


# Seams ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", ["pairs", "edges"])
def test_a_seam_closes_in_its_time_and_holds_a_load(by: str) -> None:
    mesh, right, left = panels(0.1)
    pairs = np.stack([right, left], axis=1).tolist()
    runs = [[int(right[0]), int(right[-1])], [int(left[0]), int(left[-1])]]
    seam = {"pairs": pairs} if by == "pairs" else {"edges": runs}
    scene = cs.Scene(duration=1.5, time={"dt": 0.005}, contact={"thickness": 0.004}, air={"damping": 4.0})
    # Hangs by its upper panel's far edge; the seam carries the lower panel.
    top = np.arange(9) * 9
    turn = {"axis": [0, 0, 1], "angle": -np.pi / 2}
    scene.add_cloth(
        mesh, "cotton", rotation=turn, pins=[{"vertices": top.tolist()}],
        seams=[{**seam, "start": 0.1, "duration": 0.4}],
    )  # fmt: skip
    sim = cs.Simulation(scene, threads=1)
    gaps = [np.linalg.norm(sim.positions[right] - sim.positions[left], axis=1).max()]
    for _ in range(15):
        sim.advance(0.1)
        gaps.append(np.linalg.norm(sim.positions[right] - sim.positions[left], axis=1).max())
        assert len(sim.intersections()) == 0
    assert gaps[0] == pytest.approx(0.1)
    assert gaps[1] == pytest.approx(0.1, rel=0.05), "it has not begun"
    assert 0.02 < gaps[3] < 0.09, "half way"
    # At rest each of nine stitches holds its share of the lower panel; those at the ends have half of it or more.
    load = 9.81 * sim.masses[81:].sum() / 9
    stiffness = max(cs.materials["cotton"].to_dict()["in_plane"][k] for k in ("warp", "weft"))
    assert gaps[-1] < 4 * load / stiffness
    assert gaps[-1] < 1e-3
    assert {e["name"]: e["elements"] for e in sim.plan["effects"] if e["on"]}["stitches"] == 9


def test_contact_does_not_fight_a_seam_and_still_keeps_the_rest_apart() -> None:
    """A band is sewn to a tube around a capsule; the band meets itself nowhere but at the seam."""
    n = 25
    flat = cs.Mesh.grid(0.7, 0.15, n, 6)
    angle = (flat.vertices[:, 0] / 0.7) * (2 * np.pi - 0.35)
    radius = 0.7 / (2 * np.pi - 0.35) + 0.012
    tube = np.stack([radius * np.sin(angle), flat.vertices[:, 2], radius * np.cos(angle)], axis=1)
    mesh = cs.Mesh(tube, flat.triangles, np.array(flat.uv))
    first, last = np.arange(6) * n, np.arange(6) * n + n - 1
    scene = cs.Scene(
        duration=0.8, time={"dt": 0.005}, contact={"thickness": 0.004, "friction": 0.4}, air={"damping": 2.0}
    )
    scene.add_cloth(
        mesh, "cotton", name="band", rest="uv",
        seams=[{"edges": [[int(first[0]), int(first[-1])], [int(last[0]), int(last[-1])]], "duration": 0.3}],
    )  # fmt: skip
    scene.add_collider("limb", shape={"type": "capsule", "radius": 0.1, "half_height": 0.3, "tolerance": 0.001})
    sim = cs.Simulation(scene, threads=1)
    for _ in range(8):
        sim.advance(0.1)
        assert len(sim.intersections()) == 0
    gap = np.linalg.norm(sim.positions[first] - sim.positions[last], axis=1)
    assert gap.max() < 0.5 * 0.004, "closer than the thickness: contact leaves the seam alone"
    distance = np.linalg.norm(sim.positions[:, [0, 2]], axis=1)
    assert distance.min() > 0.1 - 0.001
    assert distance.max() < 0.125, "it is drawn onto the limb"
    # Without the seam it springs open.
    open_scene = cs.Scene(duration=0.8, time={"dt": 0.005}, contact={"thickness": 0.004})
    open_scene.add_cloth(mesh, "cotton", name="band", rest="uv")
    loose = cs.Simulation(open_scene, threads=1)
    loose.advance(0.8)
    assert np.linalg.norm(loose.positions[first] - loose.positions[last], axis=1).min() > 5 * gap.max()
    assert not any(e["name"] == "stitches" and e["on"] for e in loose.plan["effects"])


def test_edges_cut_differently_are_matched_by_their_share() -> None:
    """Nine vertices on five of the same length: every second has a partner, and contact keeps out of the rest too."""
    fine, coarse = cs.Mesh.grid(0.4, 0.4, 5, 9), cs.Mesh.grid(0.4, 0.4, 5, 5)
    mesh = cs.Mesh(
        np.concatenate([fine.vertices, coarse.vertices + [0.5, 0, 0]]),
        np.concatenate([fine.triangles, coarse.triangles + 45]),
    )
    right, left = np.arange(9) * 5 + 4, 45 + np.arange(5) * 5
    runs = [[int(right[0]), int(right[-1])], [int(left[0]), int(left[-1])]]
    for edges in (runs, runs[::-1]):
        scene = cs.Scene(duration=1.0, gravity=[0, 0, 0], air={"damping": 4.0}, contact={"thickness": 0.004})
        scene.add_cloth(mesh, "cotton", seams=[{"edges": edges, "duration": 0.2}])
        sim = cs.Simulation(scene, threads=1)
        assert {e["name"]: e["elements"] for e in sim.plan["effects"] if e["on"]}["stitches"] == 5
        sim.advance(1.0)
        assert np.linalg.norm(sim.positions[right[::2]] - sim.positions[left], axis=1).max() < 1e-3
        between = 0.5 * (sim.positions[left[1:]] + sim.positions[left[:-1]])
        assert np.linalg.norm(sim.positions[right[1::2]] - between, axis=1).max() < 0.004


def test_a_seam_is_part_of_a_checkpoint_to_the_same_bits(tmp_path: Path) -> None:
    mesh, right, left = panels(0.1, 5)
    scene = cs.Scene(duration=1.0, contact={"thickness": 0.004})
    scene.add_cloth(
        mesh, "cotton", pins=[{"vertices": [0, 20]}], seams=[{"pairs": np.stack([right, left], 1).tolist()}]
    )
    sim = cs.Simulation(scene, threads=2)
    sim.advance(0.3)
    sim.save_checkpoint(tmp_path / "a")
    sim.advance(0.3)
    again = cs.Simulation.resume(tmp_path / "a", threads=1)
    again.advance(0.3)
    np.testing.assert_array_equal(again.positions, sim.positions)
    assert again.energy == sim.energy


@pytest.mark.parametrize(
    ("seam", "message"),
    [
        ({}, r"seams\[0\]: expected exactly one of pairs, edges, got neither"),
        ({"pairs": [[0, 1]], "edges": [[0, 1], [2, 3]]}, r"seams\[0\]: .*got both"),
        ({"pairs": []}, r"seams\[0\].pairs: expected at least one pair"),
        (
            {"pairs": [[0, 1], [2, 162]]},
            r"seams\[0\].pairs\[1\]\[1\]: expected a vertex of \"cloth\", 0 to 161, got 162",
        ),
        ({"pairs": [[3, 3]]}, r"seams\[0\].pairs\[0\]: expected two different vertices"),
        ({"pairs": [[0, 1, 2]]}, r"seams\[0\].pairs\[0\]"),
        ({"pairs": [[0, -1]]}, r"seams\[0\].pairs"),
        ({"edges": [[0], [81, 82]]}, r"seams\[0\].edges\[0\]: expected two vertices at least"),
        ({"edges": [[0, 40], [81, 82]]}, r"seams\[0\].edges\[0\]\[1\]: expected a vertex on the boundary .*got 40"),
        ({"edges": [[0, 81], [81, 82]]}, r"seams\[0\].edges\[0\]\[1\]: expected a vertex on the same boundary as 0"),
        ({"edges": [[0, 8, 0], [81, 82]]}, r"seams\[0\].edges\[0\]: expected a run that meets each vertex once"),
        ({"edges": [[0, 8], [81, 81]]}, r"seams\[0\].edges\[1\]: expected a run to another vertex, got \[81, 81\]"),
        ({"edges": [[0, 8], [0, 8]]}, r"seams\[0\].edges: expected two runs of different vertices, .*the same"),
        ({"pairs": [[0, 81]], "duration": -1}, r"seams\[0\].duration: .*≥ 0"),
        ({"pairs": [[0, 81]], "start": 1e30}, r"seams\[0\].start"),
        ({"pairs": [[0, 81]], "stiffness": 0}, r"seams\[0\].stiffness: .*> 0"),
        ({"pairs": [[0, 81]], "stiffness": 1e40}, r"seams\[0\].stiffness"),
        ({"pairs": [[0, 81]], "time": 1}, r"seams\[0\].time: expected one of the keys"),
    ],
)
def test_bad_seams_are_named(seam: dict[str, Any], message: str) -> None:
    scene = cs.Scene(duration=0.1)
    with pytest.raises(cs.InvalidScene, match=message):
        scene.add_cloth(panels(0.1)[0], "cotton", seams=[seam])
        cs.Simulation(scene)


def test_runs_of_unlike_lengths_are_warned_of() -> None:
    def warnings(second: list[int]) -> list[str]:
        scene = cs.Scene(duration=0.1)
        scene.add_cloth(panels(0.1)[0], "cotton", seams=[{"edges": [[0, 8], second]}])
        return [text for text in cs.Simulation(scene).plan["warnings"] if "runs" in text]

    assert warnings([81, 89]) == []
    assert warnings([81, 84]) == []
    (text,) = warnings([81, 83])
    assert text.startswith('cloth[0].seams[0].edges: the runs of "cloth" are ')


# Attachments ------------------------------------------------------------------------------------------------------


def test_an_attachment_follows_the_surface_of_a_character() -> None:
    """The corners of a cape go with a body that turns and walks, given frame by frame."""
    body = cs.Mesh.sphere(0.3, 2)

    def moved(x: Floats, angle: float) -> Floats:
        c, s = np.cos(angle), np.sin(angle)
        out: Floats = x @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + [0.1 * angle, 0, 0]
        return out

    frames = [moved(np.array(body.vertices), angle) for angle in np.linspace(0, 1.2, 13)]
    scene = cs.Scene(duration=0.5, contact={"thickness": 0.004})
    scene.add_collider("body", sequence=cs.Animation(np.array(frames), body.triangles, 24.0))
    scene.add_cloth(
        cs.Mesh.grid(0.3, 0.3, 9, 9),
        "cotton",
        position=(0.0, 0.33, 0.0),
        pins=[{"vertices": [0, 8], "collider": "body"}],
    )
    sim = cs.Simulation(scene, threads=1)
    start = sim.positions[[0, 8]]
    sim.advance(0.5)
    # Rounding of the triangle's frame.
    np.testing.assert_allclose(sim.positions[[0, 8]], moved(start, 1.2), atol=1e-12)
    assert np.linalg.norm(moved(start, 1.2) - start, axis=1).min() > 0.1
    assert len(sim.intersections()) == 0
