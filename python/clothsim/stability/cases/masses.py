"""Light cloth under heavy cloth."""

from __future__ import annotations

import numpy as np

from clothsim._arrays import Floats, Ints
from clothsim.mesh import Mesh
from clothsim.scene import Scene
from clothsim.stability.case import Axis, Case, Setup, Sides, dt_axis
from clothsim.stability.cases.common import THICKNESS, border, springs
from clothsim.stability.topology import drumhead

__all__ = ["CASES"]

_N = 13


def _on_a_sheet(sheet: Mesh) -> Sides:
    """Label whether what lies on a sheet with a held border is still on it; its vertices come after the sheet's."""
    count = len(sheet.vertices)
    label = drumhead(border(_N), np.asarray(sheet.triangles))

    def sides(x: Floats, _: Floats) -> Ints:
        return label(x[:count], x[count:].mean(axis=0))

    return sides


def _loaded(dt: float, sheet: Mesh, material: object, load: Mesh, weight: object, gap: float, seconds: float) -> Setup:
    scene = Scene(
        duration=max(seconds, 8.0 * dt), time={"dt": dt}, contact={"thickness": THICKNESS},
        cloth=[
            {"name": "sheet", "mesh": sheet, "material": material, "pins": [{"vertices": border(_N)}]},
            {"name": "load", "mesh": load, "material": weight, "position": [0.0, gap, 0.0]},
        ],
    )  # fmt: skip
    return Setup(scene, _on_a_sheet(sheet))


def _silk(dt: float, stiffness: float) -> Setup:
    """A ball of 1 kg, itself of stiff cloth, falls 0.02 m onto held silk."""
    radius = 0.07
    ball = Mesh.sphere(radius, 2)
    weight = springs(1e5, density=1.0 / ball.area, rigidity=1e-2)
    silk = springs(stiffness, density=0.015, rigidity=1e-6)
    return _loaded(dt, Mesh.grid(0.4, 0.4, _N, _N), silk, ball, weight, radius + 0.02, 0.25)


def _ratio(dt: float, ratio: float) -> Setup:
    """A patch so many times as heavy per area as the sheet falls 5 mm onto it."""
    light = 0.1
    return _loaded(
        dt, Mesh.grid(0.3, 0.3, _N, _N), springs(1e3, density=light), Mesh.grid(0.1, 0.1, 4, 4),
        springs(1e3, density=light * ratio), 0.005, 0.2,
    )  # fmt: skip


CASES = (
    Case(
        "silk-under-weight",
        "Silk of 0.015 kg/m² against a body of 1 kg",
        "A ball of stiff cloth that weighs 1 kg falls on a sheet of silk that weighs 2.4 g and whose border is held. "
        "Passed if the middle of the ball is on the other side of the sheet.",
        dt_axis((2e-4, 1e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("stiffness", (1e1, 1e2, 1e3, 1e4, 1e5), (1e3,), "N/m", "stiffness of the silk's springs"),
        _silk,
    ),
    Case(
        "mass-ratio",
        "Mass ratios up to 10⁶",
        "A patch falls on a sheet of 0.1 kg/m² whose border is held; at the ratio 10⁶ it weighs a tonne. Passed if the "
        "middle of the patch is on the other side of the sheet.",
        dt_axis((2e-4, 1e-3, 5e-3, 1 / 60, 1 / 24)),
        Axis("ratio", (1.0, 1e2, 1e4, 1e6), (1e2, 1e6), "", "mass per area, patch over sheet"),
        _ratio,
    ),
)
