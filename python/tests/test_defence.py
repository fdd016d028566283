"""The engine's own defence: steps that fail, steps chosen by their error, starts that intersect."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import RunCli

import clothsim as cs
from clothsim.study.axes import axis

SOFT = {
    "areal_density": 0.2,
    "in_plane": {"model": "baraff-witkin", "warp": 200.0, "weft": 200.0, "shear": 20.0, "damping": 0.002},
}


def hanging(**time: Any) -> cs.Scene:
    scene = cs.Scene(duration=0.2, time=time, solver={"tolerance": 1e-8})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), SOFT, pins=[{"vertices": [0, 5]}])
    return scene


def test_auto_keeps_its_error_and_says_what_it_took() -> None:
    fine = cs.Simulation(hanging(dt=1e-4, integrator="rk4"), threads=1)
    fine.advance(0.2)
    errors = []
    for tolerance in (4e-3, 1e-3):
        sim = cs.Simulation(hanging(dt="auto", dt_tolerance=tolerance), threads=1)
        sim.advance(0.2)
        errors.append(float(np.linalg.norm(sim.positions - fine.positions, axis=1).max()))
        totals = sim.report["totals"]
        assert totals["above_tolerance"] == 0
        assert 0.0 < totals["smallest_dt"] <= totals["largest_dt"] <= 0.04
        steps = sim.report["steps"]
        assert all(step["error"] <= tolerance for step in steps)
        assert sum(step["dt"] for step in steps) == pytest.approx(0.2, rel=1e-12)
    assert errors[0] < 8e-3
    assert errors[1] < min(2e-3, 0.5 * errors[0]), errors
    assert "error-controlled step" in sim.plan.running
    assert "adaptive step" in fine.plan.running


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ({"dt": "atuo"}, r'time\.dt: expected .*"auto"'),
        ({"dt": "auto", "dt_tolerance": 0.0}, r"time\.dt_tolerance: expected .*> 0 \[m\]"),
        ({"dt": "auto", "dt_min": 1.0}, r"time\.dt_min: expected at most time\.dt_max"),
        ({"dt": 0.01, "dt_min": -1.0}, r"time\.dt_min: expected .*> 0 \[s\]"),
        ({"dt_tolerence": 1e-3}, r'did you mean "dt_tolerance"'),
    ],
)
def test_wrong_steps_are_named(time: dict[str, Any], message: str) -> None:
    with pytest.raises(cs.InvalidScene, match=message):
        cs.Simulation(hanging(**time))


def test_what_was_given_up_is_listed() -> None:
    stiff = {"areal_density": 0.1, "in_plane": {"model": "spring", "stiffness": 1e5}}
    scene = cs.Scene(duration=1.0, time={"dt": 0.02, "integrator": "explicit-euler", "max_halvings": 3})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 7, 7), stiff, pins=[{"vertices": [0]}])
    sim = cs.Simulation(scene, threads=1)
    with pytest.raises(cs.SimulationDiverged):
        sim.advance(1.0)
    refused = sim.report["refused"]
    assert [r["dt"] for r in refused[-4:]] == [0.02, 0.01, 0.005, 0.0025]
    assert refused[-1]["time"] == sim.time
    assert all(r["reason"].startswith("diverged: ") for r in refused)


def folded(depth: float) -> cs.Scene:
    """A sheet whose corner is folded over, with its tip through the sheet by about ``depth`` [m]."""
    mesh = cs.Mesh.grid(0.2, 0.2, 17, 17)
    x = mesh.vertices.copy()
    n = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    d = x @ n - 0.06
    flap = d > 1e-9
    most = d.max()
    height = 0.6 * d * (1.0 - d / most) - depth * (d / most) ** 2
    x[flap] += (-2.0 * d[:, None] * n)[flap]
    x[flap, 1] += height[flap]
    x += [0.0011, 0.0, 0.0007] * flap[:, None]  # off the mesh's own lines
    scene = cs.Scene(duration=0.1, start="untangle", contact={"thickness": 0.002})
    scene.add_cloth(cs.Mesh(x, mesh.triangles, mesh.uv), SOFT, rest="uv")
    return scene


def test_a_corner_folded_through_its_own_sheet_is_put_back() -> None:
    scene = folded(0.004)
    sim = cs.Simulation(scene, threads=1)
    assert len(sim.intersections()) == 0
    found = sim.report["untangled"]
    assert found["pairs"] > 0
    assert 0.0 < found["largest"] < 0.02
    assert len(found["moved"]) > 0
    assert max(way for _, way in found["moved"]) == found["largest"]
    sim.advance(0.05)
    assert len(sim.intersections()) == 0


def test_without_it_the_start_is_refused_and_so_is_a_hopeless_one() -> None:
    tangled = folded(0.004)
    as_given = cs.Scene(duration=0.1, start="as-given", contact={"thickness": 0.002})
    mesh = cs.Mesh.grid(0.2, 0.2, 9, 9)
    for scene in (tangled, as_given):
        scene.add_cloth(mesh, SOFT, name="one", position=[0.5, 0.0, 0.0])
        turned = {"axis": [1.0, 0.0, 0.0], "angle": 1.4}
        scene.add_cloth(mesh, SOFT, name="two", position=[0.511, 0.007, 0.013], rotation=turned)
    with pytest.raises(cs.IntersectingStart, match=r'start = "untangle" leaves these of \d+') as caught:
        cs.Simulation(tangled)
    assert caught.value.count > 0
    with pytest.raises(cs.IntersectingStart, match=r'start = "untangle" repairs small ones') as caught:
        cs.Simulation(as_given)
    assert caught.value.count > 0


def test_a_run_under_error_control_is_written_and_resumed(tmp_path: Path, run_cli: RunCli) -> None:
    path = tmp_path / "scene.toml"
    hanging(dt="auto").save(path)
    text = path.read_text()
    assert 'dt = "auto"' in text
    result = run_cli("run", str(path), "-o", str(tmp_path / "out"), "--json", "--quiet")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["totals"]["rejected"] >= 0


def test_the_tolerance_is_an_axis_of_studies() -> None:
    tolerance = axis("dt_tolerance", [1e-2, 1e-3])
    assert tolerance.key == "time.dt_tolerance"
    assert tolerance.refines == -1
    assert tolerance.finest() == 1e-3
    assert axis("dt", ["auto", 0.01]).finest() == 0.01
