"""Studies: axes, metrics, references, fronts, folders, and the command line, on cloths of a few triangles."""

from __future__ import annotations

import csv
import importlib
import json
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, RunCli, cli_command

import clothsim as cs
from clothsim._cli import main
from clothsim.study import evaluate, pareto, quantities, surface
from clothsim.study.axes import axis, parse
from clothsim.study.disturb import field
from clothsim.study.elastica import cantilever
from clothsim.study.job import Request
from clothsim.study.metrics import METRICS
from clothsim.study.points import Settings, product
from clothsim.study.reference import Reference
from clothsim.study.resolution import set_resolution
from clothsim.study.result import Row, Study, Value
from clothsim.study.state import State

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


# Axes -----------------------------------------------------------------------------------------------------------


def test_values_are_read_as_toml_words_and_rows() -> None:
    assert parse("dt=1e-3, 5e-4").values == (1e-3, 5e-4)
    assert parse("integrator=rk4,midpoint").values == ("rk4", "midpoint")
    assert parse("resolution=5,2x").values == (5, "2x")
    assert parse('friction=0.1,{ law = "stribeck", mu_c = 0.1 }').values == (0.1, {"law": "stribeck", "mu_c": 0.1})
    assert parse("gravity=[0, -1, 0],[0, -2, 0]").values == ([0, -1, 0], [0, -2, 0])
    np.testing.assert_allclose(parse("dt=0.01:0.0001:3").values, [0.01, 0.001, 0.0001])
    assert parse("cloth[0].material.in_plane.warp=1,2").key == "cloth[0].material.in_plane.warp"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("intergrator=rk4", 'got "intergrator" (did you mean "integrator"?)'),
        ("dt", "expected NAME=VALUE"),
        ("dt=", "expected NAME=VALUE"),
        ("dt=0.1,0.1", "expected each value once"),
        ("dt=1:2:x", "first:last:count"),
    ],
)
def test_what_is_no_axis_is_refused(text: str, message: str) -> None:
    with pytest.raises(cs.InvalidInput) as caught:
        parse(text)
    assert message in str(caught.value)


def test_bad_requests_name_what_is_wrong(tmp_path: Path) -> None:
    scene = load(tmp_path, HANGING)
    cases: list[tuple[dict[str, Any], dict[str, Any], str]] = [
        ({}, {}, "got nothing that varies"),
        ({"dt": [0.01]}, {}, "got nothing that varies"),
        ({"integrator": ["rk4", "rk5"]}, {}, 'did you mean "rk4"?'),
        ({"time.dtt": [1, 2]}, {}, 'did you mean "dt"?'),
        ({"dt": [0.01, -1.0]}, {}, "axis dt = -1"),
        ({"dt": [0.01, 0.005], "time.dt": [0.02, 0.01]}, {}, "each axis once"),
        ({"friction": [0.1, 0.2], "cloth[3].warp": [1, 2]}, {}, "no such place"),
        ({"dt": [0.01, 0.005]}, {"metric": "rsm"}, 'did you mean "rms"?'),
        ({"dt": [0.01, 0.005]}, {"cost": "money"}, "cost: expected one of seconds"),
        ({"dt": [0.01, 0.005]}, {"seeds": 3, "metric": "rms"}, "every seed ends elsewhere"),
        ({"dt": [0.01, 0.005]}, {"reference": "best"}, "reference: expected one of auto"),
        ({"resolution": ["big", 5]}, {}, "axis resolution = big"),
    ]
    for vary, options, message in cases:
        with pytest.raises(cs.InvalidInput) as caught:
            cs.study.run(scene, vary, progress=False, **options)
        assert message in str(caught.value), str(caught.value)


def test_a_sample_holds_every_value_and_depends_on_its_seed() -> None:
    axes = [axis("dt", [0.1, 0.2, 0.3]), axis("integrator", ["rk4", "midpoint"]), axis("resolution", [3, 5, 9])]
    assert len(product(axes)) == 18
    sample = product(axes, 6, seed=1)
    assert len({json.dumps(p) for p in sample}) == 6
    for a in axes:
        assert {p[a.name] for p in sample} == set(a.values)
    assert sample == product(axes, 6, seed=1) != product(axes, 6, seed=2)


def test_resolution_keeps_proportions_and_moves_pins(tmp_path: Path) -> None:
    data = load(tmp_path, HANGING.replace("ny = 5", "ny = 9")).to_dict()
    set_resolution(data, "2x")
    assert (data["cloth"][0]["mesh"]["nx"], data["cloth"][0]["mesh"]["ny"]) == (9, 17)
    assert data["cloth"][0]["pins"][0]["vertices"] == [0, 8]
    set_resolution(data, 3)
    assert (data["cloth"][0]["mesh"]["nx"], data["cloth"][0]["mesh"]["ny"]) == (3, 5)
    data["cloth"][0]["pins"][0]["vertices"] = [1]
    with pytest.raises(cs.InvalidInput, match="no place in the other mesh"):
        set_resolution(data, 4)
    data["cloth"][0]["mesh"] = {"file": "dress.obj"}
    with pytest.raises(cs.InvalidInput, match="meshed by one of grid"):
        set_resolution(data, 3)


# Surfaces and metrics -------------------------------------------------------------------------------------------


def test_nearest_points_against_samples_of_every_triangle() -> None:
    chance = np.random.default_rng(3)
    vertices = chance.normal(size=(30, 3))
    triangles = np.array([chance.choice(30, 3, replace=False) for _ in range(40)])
    points = 2.0 * chance.normal(size=(50, 3))
    distance, places = surface.nearest(points, vertices, triangles)
    assert (places[1] >= -1e-12).all() and np.allclose(places[1].sum(axis=1), 1.0)
    np.testing.assert_allclose(np.linalg.norm(surface.sample(places, vertices, triangles) - points, axis=1), distance)
    w = np.array([(a, b, 60 - a - b) for a in range(61) for b in range(61 - a)]) / 60.0
    dense = np.einsum("wc,tcx->twx", w, vertices[triangles]).reshape(-1, 3)
    for p, d in zip(points, distance, strict=True):
        least = float(np.sqrt(((dense - p) ** 2).sum(axis=1).min()))
        assert d <= least + 1e-12 and least - d < 0.06


def test_areas_in_the_plane() -> None:
    square = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    assert surface.hull_area(square) == pytest.approx(1.0)
    twice = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 3]])
    assert surface.shadow_area(square, twice) == pytest.approx(1.0, abs=2e-3)
    assert surface.shadow_area(square, twice[:1]) == pytest.approx(0.5, abs=2e-3)


def sheet(n: int, **changes: Any) -> State:
    mesh = cs.Mesh.grid(1.0, 1.0, n, n)
    x = np.asarray(mesh.vertices)
    count = len(x)
    none = np.zeros((0, 3))
    data = {"up": "y", "duration": 1.0, "cloth": [{}], "gravity": [0.0, -10.0, 0.0]}
    kinds = ["bending", "gravity", "kinetic", "total"]
    values: dict[str, Any] = {
        "x_start": x, "x_late": x, "x_end": x, "v_start": np.zeros_like(x), "v_end": np.zeros_like(x),
        "triangles": np.asarray(mesh.triangles), "counts": np.array([count]), "masses": np.full(count, 1.0 / count),
        "pinned": np.zeros(count, dtype=bool), "collider_start": none, "collider_late": none, "collider_end": none,
        "collider_triangles": np.zeros((0, 3), dtype=np.int64), "times": np.array([0.0, 1.0]),
        "energies": np.array([[0.0, 5.0, 0.0, 5.0], [1.0, 1.0, 2.0, 4.0]]), "facts": {"energy_kinds": kinds},
        "data": data,
    }  # fmt: skip
    return State(**{**values, **changes})


def wave(x: Any, amplitude: float) -> Any:
    return x + amplitude * np.sin(2.0 * np.pi * x[:, :1]) * [0.0, 1.0, 0.0]


def test_distances_across_resolutions_are_those_of_the_coarser_surface() -> None:
    fine, same, coarse = (sheet(n, x_end=wave(sheet(n).x_start, 0.1)) for n in (33, 33, 9))
    assert METRICS["rms"].measure(same, fine) == 0.0
    # What is left are the chords of a sine over cells of 1/8.
    x, nodes = fine.x_start[:, 0], np.linspace(-0.5, 0.5, 9)
    chords = np.interp(x, nodes, 0.1 * np.sin(2.0 * np.pi * nodes)) - 0.1 * np.sin(2.0 * np.pi * x)
    assert METRICS["max"].measure(coarse, fine) == pytest.approx(np.abs(chords).max(), rel=1e-9)
    assert METRICS["rms"].measure(coarse, fine) == pytest.approx(np.sqrt((chords**2).mean()), rel=1e-9)
    assert METRICS["max"].measure(sheet(9, x_end=wave(coarse.x_start, 0.2)), fine) == pytest.approx(0.1, rel=0.1)


def test_shape_ignores_sliding_along_the_surface_and_nothing_else() -> None:
    flat = sheet(17)
    middle = np.abs(flat.x_start[:, [0, 2]]).max(axis=1, keepdims=True) < 0.45
    slid = sheet(17, x_end=flat.x_start + middle * [0.02, 0.0, 0.01])
    assert (METRICS["rms"].measure(slid, flat) or 0.0) > 0.01
    assert METRICS["shape"].measure(slid, flat) == pytest.approx(0.0, abs=1e-12)
    lifted = sheet(17, x_end=flat.x_start + [0.0, 0.02, 0.0])
    assert METRICS["shape"].measure(lifted, flat) == pytest.approx(0.02)


def test_drifts() -> None:
    start = sheet(5)
    assert METRICS["energy_drift"].measure(start) == pytest.approx(1.0 / 4.0)
    fell = sheet(5, v_end=np.tile([0.0, -10.0, 0.0], (25, 1)))
    assert METRICS["momentum_drift"].measure(fell) == pytest.approx(0.0, abs=1e-12)
    assert METRICS["momentum_drift"].measure(start) is not None, "0 over 0 is no error"
    pushed = sheet(5, v_end=np.tile([1.0, -10.0, 0.0], (25, 1)))
    assert METRICS["momentum_drift"].measure(pushed) == pytest.approx(1.0 / np.sqrt(101.0))
    turning = sheet(5, v_end=np.cross([0.0, 1.0, 0.0], start.x_start))
    assert METRICS["spin_drift"].measure(turning) == pytest.approx(1.0)
    assert METRICS["spin_drift"].measure(sheet(5, pinned=np.arange(25) == 0)) is None


def test_contact_stick_and_drape_metrics() -> None:
    data = {"up": "y", "cloth": [{}], "contact": {"thickness": 0.01}}
    table = {
        "collider_end": np.array([[-9.0, 0, -9], [9, 0, -9], [0, 0, 9]]), "collider_triangles": np.array([[0, 1, 2]]),
        "data": data,
    }  # fmt: skip
    table["collider_start"] = table["collider_late"] = table["collider_end"]
    x = sheet(5).x_start + [0.0, 0.008, 0.0]
    low = sheet(5, x_end=x, x_late=x - [0.001, 0.0, 0.0], **table)
    assert METRICS["contact_error"].measure(low) == pytest.approx(0.002)
    assert METRICS["stick_drift"].measure(low) == pytest.approx(0.004)
    assert METRICS["contact_error"].measure(sheet(5)) is None
    assert METRICS["drape"].measure(sheet(5)) == pytest.approx(1.0, abs=2e-3)
    folded = sheet(5, x_end=np.abs(sheet(5).x_start))
    assert METRICS["drape"].measure(folded) == pytest.approx(0.25, abs=2e-3)


def test_disturbances_are_the_same_field_on_every_mesh() -> None:
    coarse, fine = (np.asarray(cs.Mesh.grid(1.0, 1.0, n, n).vertices) for n in (5, 9))
    same = [np.flatnonzero((np.abs(fine - p) < 1e-12).all(axis=1))[0] for p in coarse]
    np.testing.assert_allclose(field(fine, 7, 0.1)[same], field(coarse, 7, 0.1), atol=1e-12)
    assert np.abs(field(coarse, 8, 0.1) - field(coarse, 7, 0.1)).max() > 0.01
    assert np.sqrt((field(fine, 7, 0.1) ** 2).mean()) == pytest.approx(0.1, rel=0.5)


# Fronts, orders, units ------------------------------------------------------------------------------------------


def test_the_front_holds_what_nothing_beats() -> None:
    costs, errors = [1.0, 2.0, 2.0, 3.0, 4.0], [5.0, 6.0, 1.0, 1.0, 0.5]
    assert pareto.front(costs, errors) == [0, 2, 4]


def test_orders_leave_out_what_the_reference_cannot_tell() -> None:
    errors = {h: 3.0 * h**2 for h in (0.1, 0.05, 0.025)}
    assert pareto.order(errors, 0.0) == pytest.approx(2.0)
    assert pareto.order({**errors, 0.0125: 1e-3}, 1e-4) == pytest.approx(2.0)
    assert pareto.order({0.1: 1.0}, 0.0) is None
    rough = {0.2: 0.5, 0.1: 0.125, 0.05: 0.125 / 4, 0.025: 0.125 / 16, 0.0125: 0.125 / 17}
    assert pareto.order(rough, 0.0) == pytest.approx(2.0), "one plateau does not decide"


def test_numbers_with_units() -> None:
    assert quantities.parse("1mm", "m", "--error") == pytest.approx(1e-3)
    assert quantities.parse("20 ms", "s", "--budget") == pytest.approx(0.02)
    assert quantities.parse("2%", "-", "--error") == pytest.approx(0.02)
    assert quantities.parse("0.5", "m", "--error") == 0.5
    for bad in ("", "fast", "1 kg", "-1mm", "0", "1s"):
        with pytest.raises(cs.InvalidInput, match="--error: expected a number > 0 in m"):
            quantities.parse(bad, "m", "--error")
    assert quantities.amount(0.00321, "m") == "3.21 mm"
    assert quantities.amount(2.5e6, "B") == "2.5 MB"


# Closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.1, 10.0, 300.0])
def test_the_elastica_against_a_collocation_solver(gamma: float, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy")
    monkeypatch.syspath_prepend(str(ROOT))
    elastica = importlib.import_module("validation.elastica")
    exact = elastica.cantilever(gamma)
    reach, droop = cantilever(gamma, exact.s)
    np.testing.assert_allclose(reach, exact.x, atol=1e-8)
    np.testing.assert_allclose(droop, exact.y, atol=1e-8)


def test_free_fall_is_recognised_and_first_order(tmp_path: Path) -> None:
    found = study(load(tmp_path, FALLING), {"dt": [0.01, 0.005, 0.0025]}, "rms", "momentum_drift")
    assert found.references[0][1].kind == "closed-form"
    assert "free fall" in found.statement[0]
    # Backward Euler falls g T dt/2 too far.
    for row in found.rows:
        assert error(row, "rms") == pytest.approx(0.5 * 9.81 * 0.1 * row.settings["dt"], rel=1e-6)
        assert error(row, "momentum_drift") == pytest.approx(0.0, abs=1e-9)
    assert found.orders[0].order == pytest.approx(1.0, abs=1e-6)


def test_a_scene_that_only_looks_like_a_closed_form_has_none(tmp_path: Path) -> None:
    for text in (FALLING + "[air]\ndrag = 1.0\n", HANGING):
        assert study(load(tmp_path, text), {"dt": [0.01, 0.005]}).references[0][1].kind == "finest run"


# Studies --------------------------------------------------------------------------------------------------------


def test_measured_orders_are_those_of_the_methods(tmp_path: Path) -> None:
    vary: dict[str, Sequence[Any]] = {
        "integrator": ["explicit-euler", "implicit-euler", "midpoint", "rk4"],
        "dt": [1e-3, 5e-4, 2.5e-4],
    }
    found = study(load(tmp_path, HANGING), vary, "rms", "energy_drift")
    assert [row.error for row in found.rows] == [None] * 12
    reference = found.references[0][1]
    assert reference.settings == {"integrator": "rk4", "dt": 6.25e-5}
    own = reference.errors["rms"]
    assert own is not None and own < 1e-9 and found.converged
    orders = {o.settings["integrator"]: o.order for o in found.orders}
    for name, order in {"explicit-euler": 1.0, "implicit-euler": 1.0, "midpoint": 2.0, "rk4": 4.0}.items():
        assert orders[name] == pytest.approx(order, abs=0.25), orders
    # Nothing dissipates: what energy drifts by is the method's own.
    drift = {r.settings["integrator"]: error(r, "energy_drift") for r in found.rows if r.settings["dt"] == 1e-3}
    assert drift["rk4"] < 1e-6 < drift["midpoint"] < drift["implicit-euler"]
    for row in found.rows:
        assert row.seconds and row.cpu_seconds and row.peak_bytes and row.state_bytes and row.totals["steps"]
    best = found.best()
    assert [error(r, "rms") for r in best] == sorted((error(r, "rms") for r in best), reverse=True)


def test_resolution_converges_and_its_reference_is_finer(tmp_path: Path) -> None:
    scene = load(tmp_path, HANGING.replace("duration = 0.05", "duration = 0.2"))
    found = study(scene, {"resolution": [3, 5, 9]}, "rms", "lowest")
    assert found.references[0][1].settings["resolution"] == 17
    errors = [error(row, "rms") for row in found.rows]
    assert errors[0] > errors[1] > errors[2] > 0.0, errors
    request = Request(scene, {"resolution": ["0.5x", "2x"]})
    assert request.axes[0].values == (3, 9), "factors become numbers, so that lines can join them"


def test_a_point_that_cannot_run_is_kept_with_its_error(tmp_path: Path) -> None:
    vary = {"contact.method": ["velocity-filter", "constraints"], "integrator": ["implicit-euler", "rk4"]}
    found = study(load(tmp_path, RESTING), vary, "contact_error", "stick_drift", fixed={"duration": 5e-4, "dt": 1e-4})
    errors = {(r.settings["contact.method"], r.settings["integrator"]): r.error for r in found.rows}
    assert [k for k, error in errors.items() if error] == [("constraints", "rk4")]
    assert "implicit" in str(errors["constraints", "rk4"])
    assert found.references[0][1].kind == "none" and found.converged, "a drift needs no reference"


def test_resting_cloth_neither_sinks_nor_creeps(tmp_path: Path) -> None:
    found = study(load(tmp_path, RESTING), {"friction": [0.3, 0.6]}, "stick_drift", "contact_error")
    for row in found.rows:
        assert row.values["stick_drift"].value is not None and row.values["stick_drift"].value < 1e-3
        assert row.values["contact_error"].value is not None and row.values["contact_error"].value < 1e-3


def test_each_problem_has_its_own_reference(tmp_path: Path) -> None:
    name = "cloth[0].material.in_plane.warp"
    found = study(load(tmp_path, HANGING), {name: [10.0, 20.0], "dt": [0.005, 0.0025]})
    assert [problem for problem, _ in found.references] == [{name: 10.0}, {name: 20.0}]
    assert all(error(row, "rms") < 0.01 for row in found.rows)


def test_a_reference_that_diverges_is_said(tmp_path: Path) -> None:
    scene = load(tmp_path, HANGING.replace("warp = 20.0", "warp = 2e9"))
    found = study(scene, {"dt": [0.01, 0.005]}, fixed={"integrator": "rk4"})
    assert not found.converged
    assert all(row.error for row in found.rows)
    assert "NO REFERENCE: the reference could not be run" in found.statement[0]


def test_a_reference_that_has_not_converged_is_said(tmp_path: Path) -> None:
    request = Request(load(tmp_path, HANGING), {"dt": [0.01, 0.005, 0.0025]})
    for own, converged in ((0.02, False), (0.002, True)):
        rows = [
            Row(p, None, {"rms": Value(e, e, None, e > 2.0 * own)}, seconds=1.0, cpu_seconds=1.0)
            for p, e in zip(request.points, (0.05, 0.03, 0.01), strict=True)
        ]
        references: list[tuple[Settings, Reference]] = [({}, Reference("finest run", "a run", errors={"rms": own}))]
        found = evaluate.study(request, rows, references, {"load_before": 0.0}, 1)
        assert found.converged is converged
        assert any("HAS NOT CONVERGED" in line for line in found.statement) is not converged


def test_seeds_give_means_and_spreads(tmp_path: Path) -> None:
    found = study(load(tmp_path, RESTING), {"dt": [0.01, 0.005]}, "lowest", seeds=3, disturbance=0.05)
    for row in found.rows:
        value = row.values["lowest"]
        assert value.spread is not None and 0.0 < value.spread < 0.01
        assert value.error is not None
    assert found.per_point == 3 and any("3 seeded disturbances" in line for line in found.statement)


def test_a_run_that_takes_too_long_is_stopped(tmp_path: Path) -> None:
    scene = load(tmp_path, HANGING.replace("duration = 0.05", "duration = 1e4"))
    found = study(scene, {"dt": [1e-3, 5e-4]}, "energy_drift", limit=1.5)
    assert [row.error for row in found.rows] == ["stopped after 1.5 s"] * 2


# Folders and the command line -----------------------------------------------------------------------------------

VARY = ("--vary", "integrator=midpoint,rk4", "--vary", "dt=1e-3,5e-4", "--repeats", "1")


def visible(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


FILES = ["study.csv", "study.json", "study.md", "study.png", "study.svg"]


def test_the_command_writes_tables_and_plots_and_refuses_a_second_study(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    done = run_cli("study", scene, *VARY, "-o", out)
    assert done.returncode == 0, done.stderr
    assert "front of rms over wall-clock time" in done.stdout and "order in dt" in done.stdout
    assert "100%" in done.stderr, "a progress bar"
    assert visible(out) == FILES, "no work folder is left"
    with (out / "study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 and {r["status"] for r in rows} == {"ok"} and any(r["on_front"] == "1" for r in rows)
    facts = json.loads((out / "study.json").read_text())
    assert facts["command"].startswith("clothsim study ") and facts["machine"]["processor"]
    assert [float(r["rms"]) for r in rows] == pytest.approx(
        [r["values"]["rms"]["value"] for r in facts["rows"]], rel=1e-5
    )
    read = cs.study.load(out)
    assert [row.facts() for row in read.rows] == facts["rows"] and [o.facts() for o in read.orders] == facts["orders"]
    with pytest.raises(cs.InvalidInput, match="expected the file of a study"):
        cs.study.load(tmp_path)
    page = (out / "study.md").read_text()
    assert "the reference is the run at rk4, dt 0.000125" in page and "study.png" in page
    before = (out / "study.json").read_bytes()
    again = run_cli("study", scene, *VARY, "-o", out)
    assert again.returncode == 2 and "holds a study already" in again.stderr
    resumed = run_cli("study", scene, *VARY, "-o", out, "--resume", "--json")
    assert json.loads(resumed.stdout)["resumed"] == "complete already"
    other = run_cli("study", scene, "--vary", "dt=1e-3,5e-4", "-o", out, "--resume")
    assert other.returncode == 2 and "is another one; --overwrite starts anew" in other.stderr
    run = run_cli("run", scene, "-o", out, "--frames", "1")
    assert run.returncode == 0, "a run's files have other names"
    mixed = run_cli("study", scene, *VARY, "-o", out, "--overwrite")
    assert mixed.returncode == 2 and "holds a run of a scene" in mixed.stderr
    assert (out / "study.json").read_bytes() == before


def test_a_killed_study_goes_on_where_it_stopped(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING.replace("duration = 0.05", "duration = 1.0"))
    arguments = ("study", scene, "--vary", "dt=4e-3,2e-3,1e-4,5e-5", "--repeats", "1", "--quiet", "-o", out)
    process = subprocess.Popen(cli_command(*arguments, "--processes", "1"), stderr=subprocess.PIPE, text=True)
    work = out / ".clothsim"
    deadline = time.monotonic() + 120
    for results in (1, 2):
        while len(list(work.glob("*.result"))) < results:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        if results == 1:
            second = run_cli(*arguments, "--resume")
            assert second.returncode == 2 and "another run is writing here" in second.stderr
    process.kill()
    process.communicate()
    kept = {p.name: p.stat().st_mtime_ns for p in work.glob("*.result")}
    assert 2 <= len(kept) < 6 and not (out / "study.json").exists()
    refused = run_cli(*arguments)
    assert refused.returncode == 2 and "holds an unfinished study; --resume goes on with it" in refused.stderr
    other = run_cli("study", scene, "--vary", "dt=1e-3,5e-4", "-o", out, "--resume")
    assert other.returncode == 2 and "the unfinished study is another one" in other.stderr
    # Interrupted again by Ctrl-C, which says how to go on.
    process = subprocess.Popen(cli_command(*arguments, "--resume"), stderr=subprocess.PIPE, text=True)
    old = set(work.glob("*.job"))
    while not set(work.glob("*.job")) - old:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "to go on:" in errors and "--resume" in errors and "Traceback" not in errors
    now = {p.name: p.stat().st_mtime_ns for p in work.glob("*.result")}
    assert {name: now[name] for name in kept} == kept, "what had run is not run again"
    assert not (set(work.glob("*.job")) - old), "its runs are stopped"
    done = run_cli(*arguments, "--resume")
    assert done.returncode == 0, done.stderr
    assert visible(out) == FILES
    assert [r["error"] for r in json.loads((out / "study.json").read_text())["rows"]] == [None] * 4


def test_bad_input_on_the_command_line(tmp_path: Path, run_cli: RunCli) -> None:
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    nothing = run_cli("study", scene, "-o", out)
    assert nothing.returncode == 2 and "expected an axis with two values or more" in nothing.stderr
    unknown = run_cli("study", scene, "--vary", "integrater=rk4,midpoint", "-o", out, "--json")
    assert unknown.returncode == 2
    assert 'did you mean "integrator"?' in json.loads(unknown.stdout)["error"]["message"]
    both = run_cli("tune", scene, "--error", "1mm", "--budget", "1ms", "-o", out)
    assert both.returncode == 2 and "not allowed with" in both.stderr
    physical = run_cli("tune", scene, "--error", "1mm", "--vary", "friction=0.1,0.2", "-o", out)
    assert physical.returncode == 2 and "axes that do not change what is asked" in physical.stderr
    assert not out.exists(), "bad input leaves no folder behind"
    assert "example: clothsim study" in run_cli("study", "--help").stdout.replace("\n", " ")


# Tuning ---------------------------------------------------------------------------------------------------------


def test_tuned_settings_meet_their_bound_when_measured_again(tmp_path: Path, run_cli: RunCli) -> None:
    pytest.importorskip("matplotlib")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(HANGING)
    done = run_cli("tune", scene, "--error", "0.1mm", "-o", out, "--repeats", "1", "--cost", "cpu_seconds", "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    facts = json.loads(done.stdout)
    assert facts["met"] and visible(out) == sorted([*FILES, "tune.json", "tuned.toml"])
    # Measured once more, by hand: the scene that was written against a far finer one.
    tuned = cs.Scene.load(out / "tuned.toml")
    ends = []
    for integrator, dt in ((None, None), ("rk4", 2e-5)):
        data = tuned.to_dict()
        if integrator:
            data["time"].update(integrator=integrator, dt=dt)
        simulation = cs.Simulation(cs.Scene(**data), threads=1)
        simulation.advance(tuned.duration)
        ends.append(simulation.positions)
    rms = float(np.sqrt(((ends[0] - ends[1]) ** 2).sum(axis=1).mean()))
    assert rms <= 1e-4
    assert rms == pytest.approx(facts["measured_again"]["values"]["rms"]["error"], abs=1e-8)
    again = run_cli("tune", scene, "--error", "0.1mm", "-o", out)
    assert again.returncode == 2 and "holds a study already" in again.stderr


def test_a_budget_gives_the_most_precise_settings_within_it(tmp_path: Path) -> None:
    vary: dict[str, Sequence[Any]] = {"integrator": ["implicit-euler", "rk4"], "dt": [0.005, 0.0025, 0.00125]}
    found = cs.study.tune(
        load(tmp_path, HANGING), budget=10.0, per="run", vary=vary, repeats=1, cost="cpu_seconds", progress=False
    )
    assert found.met and found.row is not None and found.row.settings == {"integrator": "rk4", "dt": 0.00125}
    assert "rk4" in found.statement


def test_a_bound_that_nothing_meets_is_said(tmp_path: Path) -> None:
    found = cs.study.tune(
        load(tmp_path, HANGING), error=1e-9, vary={"integrator": ["implicit-euler"], "dt": [0.01, 0.005]}, repeats=1,
        progress=False,
    )  # fmt: skip
    assert not found.met and found.scene is None and "not found" in found.statement


# Docs -----------------------------------------------------------------------------------------------------------

PAGES = [ROOT / "docs" / "study.md", ROOT / "gallery" / "README.md", ROOT / "README.md"]


def commands(page: Path) -> list[list[str]]:
    blocks = page.read_text().split("```sh\n")[1:]
    lines = [shlex.split(line, comments=True) for block in blocks for line in block.split("```")[0].splitlines()]
    return [words[1:] for words in lines if words[:2] in (["clothsim", "study"], ["clothsim", "tune"])]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.parent.name + "/" + p.name)
def test_commands_in_the_docs_can_be_run(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but the runs: the scene is there, and every axis and value is known."""
    monkeypatch.chdir(ROOT)
    seen: list[Request] = []

    def stop(request: Request, *_: Any, **__: Any) -> None:
        seen.append(request)
        raise cs.ClothSimError("stopped")

    monkeypatch.setattr("clothsim.study.job.run", stop)
    found = commands(page)
    assert found
    for words in found:
        words[words.index("-o") + 1] = "/nonexistent/out"
        if words[0] == "study":
            assert main(words) == 1
            assert len(seen.pop().points) > 1


def test_the_example_in_the_docs_runs(tmp_path: Path) -> None:
    code = PAGES[0].read_text().split("```python\n")[1].split("```")[0]
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "rk4, dt 0.0002" in done.stdout and (tmp_path / "tuned.toml").exists()


@pytest.mark.parametrize("path", sorted((ROOT / "gallery").glob("*/study.json")), ids=lambda p: p.parent.name)
def test_the_gallery_was_made_by_the_command_that_it_names(path: Path) -> None:
    facts = json.loads(path.read_text())
    assert f"-o gallery/{path.parent.name}" in facts["command"]
    assert facts["command"] in (path.parent.parent / "README.md").read_text()
    assert not [r["error"] for r in facts["rows"] if r["error"] and "diverged" not in r["error"]]
    assert all((path.parent / name).exists() for name in FILES)
