"""Import our files in headless Blender and compare every vertex of every frame. Runs in an environment with `bpy`.

Run by ``make blender``; exits with 1 if anything differs. Blender's z is up: (x, y, z) here is (x, −z, y) there.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

# float32 positions of size 1, twice converted.
TOLERANCE = 2e-6
FPS = 24


def fresh() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    bpy.context.scene.render.fps_base = 1.0


def vertices(name: str, frame: int, *, world: bool = True) -> np.ndarray:
    """Vertices of an object as evaluated in a frame, in our axes."""
    bpy.context.scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    thing = bpy.data.objects[name].evaluated_get(graph)
    mesh = thing.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", flat)
    x = flat.reshape(-1, 3).astype(np.float64)
    if world:
        matrix = np.array(thing.matrix_world)
        x = x @ matrix[:3, :3].T + matrix[:3, 3]
        x = np.stack([x[:, 0], x[:, 2], -x[:, 1]], axis=1)
    thing.to_mesh_clear()
    return x


def regions(name: str, materials: list[str]) -> np.ndarray:
    """Number of the material of each triangle."""
    mesh = bpy.data.objects[name].data
    assert [material.name for material in mesh.materials] == materials, mesh.materials.keys()
    return np.array([polygon.material_index for polygon in mesh.polygons])


def matched(expected: np.ndarray, found: list[np.ndarray]) -> list[np.ndarray]:
    """Vertices in the order of `expected`: of each the nearest in the first frame."""
    apart = np.linalg.norm(expected[0][:, None] - found[0][None], axis=2)
    return [x[apart.argmin(axis=1)] for x in found]


def compare(what: str, expected: np.ndarray, found: list[np.ndarray]) -> float:
    worst = 0.0
    for frame, (a, b) in enumerate(zip(expected, found, strict=True)):
        if b.shape[0] < a.shape[0]:
            raise SystemExit(f"{what}, frame {frame}: expected {len(a)} vertices, got {len(b)}")
        worst = max(worst, float(np.abs(a - b[: len(a)]).max()))
    moved = float(np.abs(expected - expected[0]).max())
    print(f"{what:28} {len(expected)} frames, moves by {moved:.3f} m, differs by at most {worst:.1e} m")
    if worst > TOLERANCE:
        raise SystemExit(f"{what}: differs by more than {TOLERANCE} m")
    return worst


def main(folder: Path) -> None:
    expected = dict(np.load(folder / "expected.npz"))
    count = len(expected["napkin"])

    fresh()
    bpy.ops.wm.usd_import(filepath=str(folder / "scene.usdc"), set_frame_range=True)
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (0, count - 1), (scene.frame_start, scene.frame_end)
    for name in ("napkin", "ball", "floor"):
        compare(f"USD {name}", expected[name], [vertices(name, f) for f in range(count)])
        thing = bpy.data.objects[name]
        assert thing.data.materials[0].name == name, thing.data.materials.keys()
        assert thing.parent.name == "World"
    assert len(bpy.data.objects["napkin"].data.uv_layers) == 1
    hem = regions("napkin", ["napkin", "napkin_denim"])
    assert np.flatnonzero(hem == 1).tolist() == expected["hem"].tolist()

    fresh()
    bpy.ops.import_scene.gltf(filepath=str(folder / "scene.glb"), merge_vertices=False)
    for name in ("napkin", "ball", "floor"):
        found = [vertices(name, f) for f in range(count)]
        if name == "napkin":  # each region brings its own vertices: sorted by where they are in the first frame
            found = matched(expected[name], found)
        compare(f"glTF {name}", expected[name], found)
        assert bpy.data.objects[name].data.materials[0].name == name
    assert len(bpy.data.objects["napkin"].data.shape_keys.key_blocks) == count
    hem = regions("napkin", ["napkin", "napkin denim"])
    assert np.count_nonzero(hem == 1) == len(expected["hem"])

    fresh()
    for name in ("napkin", "ball"):
        bpy.ops.wm.obj_import(filepath=str(folder / "pc2" / f"{name}.obj"), forward_axis="Y", up_axis="Z")
        thing = bpy.context.selected_objects[0]
        modifier = thing.modifiers.new("cache", "MESH_CACHE")
        modifier.cache_format = "PC2"
        modifier.filepath = str(folder / "pc2" / f"{name}.pc2")
        found = [vertices(thing.name, f, world=False) for f in range(count)]
        compare(f"PC2 {name}", expected[name], found)

    fresh()
    bpy.ops.import_scene.gltf(filepath=str(folder / "body.glb"))
    name = next(o.name for o in bpy.data.objects if o.type == "MESH" and len(o.data.vertices) == 10)
    compare("glTF skin, read by us", expected["body"], [vertices(name, f) for f in range(len(expected["body"]))])

    # The comparison sees a fault: another frame is not this one.
    try:
        compare("planted fault", expected["body"][5:6], [vertices(name, 6)])
    except SystemExit:
        return
    raise SystemExit("a planted fault was not seen")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
