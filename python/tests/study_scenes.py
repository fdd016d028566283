"""Scenes of a few triangles for the tests of studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import clothsim as cs
from clothsim.study.result import Row, Study

# A napkin that hangs from two corners, soft enough that every integrator runs at the steps below.
HANGING = """
name = "napkin"
duration = 0.05
[time]
dt = 0.005
[solver]
tolerance = 1e-10
[[cloth]]
name = "sheet"
mesh = { generator = "grid", width = 0.4, height = 0.4, nx = 5, ny = 5 }
rotation = { axis = [1, 0, 0], angle = 1.2 }
pins = [{ vertices = [0, 4] }]
[cloth.material]
areal_density = 0.2
in_plane = { model = "baraff-witkin", warp = 20.0, weft = 20.0, shear = 5.0 }
bending = { model = "hinge", rigidity = 1e-5 }
"""
RESTING = """
name = "resting"
duration = 0.4
[time]
dt = 0.01
[contact]
thickness = 0.01
friction = 0.5
[[cloth]]
name = "sheet"
mesh = { generator = "grid", width = 0.2, height = 0.2, nx = 5, ny = 5 }
material = "denim"
position = [0.0, 0.0101, 0.0]
[[collider]]
name = "table"
shape = { type = "plane", half_size = 0.5 }
"""
FALLING = """
name = "falling"
duration = 0.1
[time]
dt = 0.01
[solver]
tolerance = 1e-12
[[cloth]]
name = "sheet"
mesh = { generator = "grid", width = 0.2, height = 0.2, nx = 3, ny = 3 }
material = "cotton"
velocity = [1.0, 2.0, 0.0]
"""


def load(tmp_path: Path, text: str) -> cs.Scene:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return cs.Scene.load(path)


def study(scene: cs.Scene, vary: Mapping[str, Sequence[Any]], *metric: str, **options: Any) -> Study:
    return cs.study.run(scene, vary, list(metric) or None, repeats=1, progress=False, **options)


def error(row: Row, metric: str) -> float:
    value = row.values[metric].error
    assert value is not None
    return value
