"""Studies: axes, fronts, closed forms, references, on cloths of a few triangles."""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from study_scenes import FALLING, HANGING, RESTING, error, load, study

import clothsim as cs
from clothsim.errors import InvalidInput
from clothsim.study import evaluate, pareto, plots, quantities
from clothsim.study.axes import axis, parse
from clothsim.study.elastica import cantilever
from clothsim.study.job import Request
from clothsim.study.points import Settings, product
from clothsim.study.reference import Reference
from clothsim.study.resolution import set_resolution
from clothsim.study.result import Row, Value

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
        ("dt=nan,1e-3", "axis dt: expected finite numbers, got nan"),
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
        ({"dt": [0.01, 0.005], "cloth[3].warp": [1, 2]}, {}, "no such place"),
        ({"dt": [0.01, 0.005]}, {"metric": "rsm"}, 'did you mean "rms"?'),
        ({"dt": [0.01, 0.005]}, {"cost": "money"}, "cost: expected one of seconds"),
        ({"dt": [0.01, 0.005]}, {"seeds": 3, "metric": "rms"}, "every seed ends elsewhere"),
        ({"dt": [0.01, 0.005]}, {"reference": "best"}, "reference: expected one of auto"),
        ({"resolution": ["big", 5]}, {}, "axis resolution = big"),
        ({"friction": [0.1, 0.3]}, {}, "axis friction: expected a scene with [contact]"),
        ({"dt": [0.01, 0.005]}, {"fixed": {"detector": "bvh"}}, "axis detector: expected a scene with [contact]"),
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


def test_labels_of_a_plot_leave_out_what_all_tables_share(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    laws = [{"model": "hinge", "rigidity": 1e-5}, {"model": "hinge", "rigidity": 1e-5, "damping": 0.1}]
    others = [{"model": "nonlinear", "rigidity": 1e-5, "coercive_couple": 1e-4}]
    request = Request(load(tmp_path, HANGING), {"bending": [*laws, *others], "dt": [0.01, 0.005]})
    rows = [Row(p, "not run", {}) for p in request.points]
    made = evaluate.study(request, rows, [({}, Reference("none", "none"))], {"load_before": 0.0}, 1)
    brief = [plots._brief(made, row.label) for row in rows[::2]]
    assert brief == ["bending hinge, dt 0.01", "bending hinge (damping 0.1), dt 0.01", "bending nonlinear, dt 0.01"]
    assert sum(plots._named(k, 40, 9) for k in range(40)) == 9 and all(plots._named(k, 5, 9) for k in range(5))


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


def test_memory_is_that_of_the_effects_and_more(tmp_path: Path) -> None:
    scene = load(tmp_path, HANGING)
    found = study(scene, {"resolution": [5, 81]}, "energy_drift", fixed={"duration": 5e-3})
    small, large = found.rows
    direct = cs.Simulation(cs.Scene(**{**scene.to_dict(), "duration": 5e-3}), threads=1)
    direct.advance(5e-3)
    assert small.state_bytes == sum(e["bytes"] for e in direct.report["effects"])
    # 6561 vertices instead of 25 and 12800 triangles instead of 32; edges and hinges lie between.
    assert small.state_bytes and large.state_bytes and large.peak_bytes
    assert 6561 / 25 < large.state_bytes / small.state_bytes < 12800 / 32
    assert large.peak_bytes > large.state_bytes


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


def test_a_state_in_single_precision_has_a_floor(tmp_path: Path) -> None:
    """Rounding the state is seen where steps are small; the reference is in f64 whatever comes first."""
    scene = load(tmp_path, HANGING)
    made = study(scene, {"precision": ["f32", "f64"], "dt": [1e-3, 2.5e-4]}, "rms", fixed={"integrator": "rk4"})
    assert made.references[0][1].settings["precision"] == "f64"
    by = {(row.settings["precision"], row.settings["dt"]): error(row, "rms") for row in made.rows}
    # Positions of up to 1 m have a spacing of 6e-8 m in f32; rk4 is far below it at either step.
    assert by["f64", 2.5e-4] < 1e-9
    assert 1e-8 < by["f32", 2.5e-4] < 1e-5
    assert by["f32", 2.5e-4] > 0.5 * by["f32", 1e-3], "a smaller step rounds more often"


def test_detectors_of_a_gpu_run_on_one_and_end_in_the_same_bits(gpu: str, tmp_path: Path) -> None:
    made = study(load(tmp_path, RESTING), {"detector": ["bvh", "grid", "octree"]}, "rms", fixed={"duration": 0.05})
    assert [row.error for row in made.rows] == [None] * 3
    assert not any("same bits" in note for row in made.rows for note in row.notes), "observed and timed runs agree"
    assert len({error(row, "rms") for row in made.rows}) == 1


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"precision": ["f64", "f16"]}, r'axis precision = f16: precision: expected one of f64, f32, got "f16"'),
        ({"device": ["cpu", "gpus"]}, r'device: expected one of auto, cpu, gpu, got "gpus" \(did you mean "gpu"\?\)'),
    ],
)
def test_unknown_ways_to_run_are_refused(tmp_path: Path, vary: dict[str, list[str]], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        study(load(tmp_path, HANGING), vary)
