"""Names that no file can have, wherever a path is given."""

from collections.abc import Callable
from pathlib import Path

import pytest

import clothsim as cs

# A NUL, and half of a surrogate pair, which no encoding of a file system has.
NAMES = ("a\0b", "a\ud800b")
SCENE = """
duration = 0.01
[[cloth]]
name = "sheet"
mesh = {{ {mesh} }}
material = "cotton"
{more}
"""


def _simulation() -> cs.Simulation:
    scene = cs.Scene(duration=0.01)
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 3, 3), "cotton")
    return cs.Simulation(scene)


ENTRIES: dict[str, tuple[str, Callable[[str], object]]] = {
    "Scene.load": ("path", cs.Scene.load),
    "Scene.save": ("path", lambda name: cs.Scene(duration=0.01).save(name)),
    "Mesh.load": ("path", cs.Mesh.load),
    "Mesh.save": ("path", lambda name: cs.Mesh.grid(1.0, 1.0, 3, 3).save(name)),
    "Animation.load": ("path", cs.Animation.load),
    "Recording.load": ("path", cs.Recording.load),
    "Recording.save_pc2": ("folder", lambda name: cs.record(_simulation(), 0.01, progress=False).save_pc2(name)),
    "Simulation.resume": ("path", cs.Simulation.resume),
    "Simulation.resume with a scene": (
        "path",
        lambda name: cs.Simulation.resume(name, scene=cs.Scene(duration=0.01)),
    ),
    "Simulation.save_checkpoint": ("path", lambda name: _simulation().save_checkpoint(name)),
    "Simulation.from_frame": ("recording", lambda name: cs.Simulation.from_frame(cs.Scene(duration=0.01), name, 0)),
    "study.load": ("folder", cs.study.load),
    "sweep.load": ("folder", cs.sweep.load),
    "sweep.run_file": ("path", cs.sweep.run_file),
    "stability.run": ("out", lambda name: cs.stability.run(["one-triangle"], out=name, progress=False)),
}


@pytest.mark.parametrize("name", NAMES, ids=ascii)
@pytest.mark.parametrize("entry", ENTRIES)
def test_a_path_that_no_file_can_have_is_refused_by_the_name_of_its_parameter(entry: str, name: str) -> None:
    parameter, call = ENTRIES[entry]
    with pytest.raises(cs.InvalidInput) as raised:
        call(name)
    assert raised.value.name == parameter
    assert str(raised.value).startswith(f"{parameter}: expected a path that the file system can have, got ")
    assert ascii(name) in str(raised.value)
    assert "\0" not in str(raised.value)


def test_what_is_no_path_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="path: expected a path, got int"):
        cs.Mesh.load(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="recording: expected a path, got int"):
        cs.Simulation.from_frame(cs.Scene(duration=0.01), 3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("key", "mesh", "more"),
    [
        ("cloth[0].mesh", 'file = "a\\u0000b.obj"', ""),
        ("cloth[0].velocities", 'generator = "grid", width = 1, height = 1, nx = 3, ny = 3',
         'velocities = "a\\u0000b.npy"'),
    ],
)  # fmt: skip
def test_a_scene_names_the_key(tmp_path: Path, key: str, mesh: str, more: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(mesh=mesh, more=more))
    with pytest.raises(cs.InvalidScene) as raised:
        cs.Scene.load(path)
    assert raised.value.key.startswith(key)


def test_a_sweep_names_the_key(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text('scene = "a\\u0000b.toml"\n[vary]\ndt = [0.01]\n')
    with pytest.raises(cs.InvalidInput, match="scene: expected a path") as raised:
        cs.sweep.run_file(path)
    assert raised.value.name == "scene"
