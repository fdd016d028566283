"""Bending laws through the package: alone, and in a simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clothsim as cs

B = {"b1": 7.5e-5, "b2": 2.5e-5, "c1": -3.7e-7}
K0 = (B["b1"] - B["b2"]) / (-2 * B["c1"])
M0 = (B["b1"] - B["b2"]) * K0 / 2

# Rounding of a few sums of numbers of one size.
ROUNDING = 1e-12


def test_first_loading_follows_the_equations() -> None:
    curvature = np.linspace(0.0, 3 * K0, 50)
    expected = np.where(curvature <= K0, B["b1"] * curvature + B["c1"] * curvature**2, M0 + B["b2"] * curvature)
    for model in ("nonlinear", "hysteresis"):
        moment = cs.bending.trace(curvature, model, **B).moment
        assert np.abs(moment - expected).max() < ROUNDING * M0
    faulty = cs.bending.trace(curvature, "nonlinear", **{**B, "c1": 1.001 * B["c1"]}).moment
    assert np.abs(faulty - expected).max() > 1e-6 * M0


def test_full_loop_has_the_area_and_gap_of_its_closed_form() -> None:
    km = 4 * K0
    path = np.concatenate([np.linspace(0, km, 1000), np.linspace(km, -km, 4001)[1:], np.linspace(-km, km, 4001)[1:]])
    loop = cs.bending.trace(path, "hysteresis", **B)
    whole = slice(999, None)
    area = np.trapezoid(loop.moment[whole], path[whole])
    closed = 4 * M0 * (km - 2 / 3 * K0)
    assert area == pytest.approx(closed, rel=1e-5)  # trapezoidal rule on a parabola
    assert loop.dissipated[-1] - loop.dissipated[999] == pytest.approx(closed, rel=1e-12)
    gap = loop.moment[999 + 4000 + 2000] - loop.moment[999 + 2000]
    assert abs(gap) == pytest.approx(2 * M0, rel=1e-9)
    assert loop.frictional_moment == pytest.approx(M0)


def test_measured_values_give_the_same_loop() -> None:
    path = [3 * K0, -K0, 2 * K0]
    measured = {"rigidity": B["b2"], "coercive_couple": 2 * M0, "transition_curvature": K0}
    a, b = cs.bending.trace(path, "hysteresis", **B), cs.bending.trace(path, "hysteresis", **measured)
    assert a.moment == pytest.approx(b.moment, rel=1e-12)


def test_plastic_law_takes_its_limit_from_the_curve() -> None:
    got = cs.bending.trace([0.5 * K0, -0.5 * K0, 3 * K0], "plastic", **B)
    assert got.dissipated[1] == 0.0
    assert got.moment[2] == pytest.approx(B["b2"] * K0)
    assert got.rest_curvature[2] == pytest.approx(2 * K0)
    assert cs.bending.trace([1.0], "linear", rigidity=2.0).moment == [2.0]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"b1": 1e-5, "b2": 2e-5, "c1": -1e-7}, "b1"),
        ({"b1": 3e-5, "b2": 2e-5, "c1": 1e-7}, "c1"),
        ({"b1": 3e-5, "b2": 0.0, "c1": -1e-7}, "b2"),
        ({"b1": 3e-5, "b2": 2e-5}, "c1"),
        ({"b1": float("nan"), "b2": 2e-5, "c1": -1e-7}, "b1"),
        ({**B, "plasticity": 1.5}, "plasticity"),
        ({**B, "fatigue": -0.1}, "fatigue"),
        ({**B, "rigidity": 1e-5}, "rigidity"),
        ({**B, "elastic_limit": 1.0}, "elastic_limit"),
        ({"rigidity": 1e-5}, "coercive_couple"),
        ({**B, "model": "hysterisis"}, "model"),
        ({"model": "plastic", "rigidity": 1e-5}, "elastic_limit"),
        ({**B, "model": "linear", "fatigue": 0.1}, "fatigue"),
    ],
)
def test_what_gives_no_law_is_named(arguments: dict[str, Any], name: str) -> None:
    with pytest.raises(cs.InvalidInput, match=f"^{name}: expected ") as caught:
        cs.bending.trace([0.0, 1.0], **arguments)
    assert caught.value.name == name


def test_a_path_with_nan_names_the_sample() -> None:
    with pytest.raises(cs.InvalidInput, match="curvature.*NaN at index 2"):
        cs.bending.trace([0.0, 1.0, np.nan], "hysteresis", **B)
    with pytest.raises(cs.InvalidInput, match="curvature: expected shape"):
        cs.bending.trace([[0.0, 1.0]], "hysteresis", **B)
    assert cs.bending.trace([], "hysteresis", **B).moment.shape == (0,)


def scene(bending: dict[str, object], **time: object) -> cs.Scene:
    """A strip held at one edge, which falls and swings."""
    made = cs.Scene(duration=0.5, time={"dt": 0.005, **time})
    fabric = {
        "areal_density": 0.2,
        "in_plane": {"model": "baraff-witkin", "warp": 300, "weft": 300, "shear": 30, "damping": 1e-3},
        "bending": bending,
    }
    made.add_cloth(cs.Mesh.grid(0.2, 0.1, 17, 9), fabric, pins=[{"box": {"min": [-1, -1, -1], "max": [-0.085, 1, 1]}}])
    return made


@pytest.mark.parametrize("integrator", ["implicit-euler", "implicit-newton", "semi-implicit", "rk4"])
def test_bending_leaves_residual_curvature_where_asked(integrator: str) -> None:
    early = {**B, "c1": 8 * B["c1"]}  # friction is overcome at K0/8, before the strip swings back
    bends = {"model": "hysteresis", **early, "plasticity": 0.5, "fatigue": 0.1}
    time = {"integrator": integrator, "dt": 2e-5 if integrator == "rk4" else 0.002}
    swinging = cs.Simulation(scene(bends, **time), threads=1)
    swinging.advance(0.4)
    hinges = swinging.hinges
    assert hinges.vertices.shape == (len(hinges.curvature), 4)
    assert np.abs(hinges.rest_curvature).max() > 0.0
    assert hinges.b1.min() < B["b1"]
    linear = cs.Simulation(scene({"model": "hinge", "rigidity": B["b2"]}, **time), threads=1)
    linear.advance(0.01)
    assert linear.hinges.vertices.shape == (0, 4)


def test_the_moments_of_a_simulation_are_those_of_the_law_alone() -> None:
    bends = {"model": "hysteresis", **B, "plasticity": 0.3, "fatigue": 0.1}
    sim = cs.Simulation(scene(bends), threads=1)
    paths, moments, rest = [], [], []
    for _ in range(100):
        sim.step()
        hinges = sim.hinges
        paths.append(hinges.curvature)
        moments.append(hinges.moment)
        rest.append(hinges.rest_curvature)
    for hinge in range(0, len(paths[0]), 29):
        path = np.array([step[hinge] for step in paths])
        alone = cs.bending.trace(path, "hysteresis", **B, plasticity=0.3, fatigue=0.1)
        assert alone.moment == pytest.approx([step[hinge] for step in moments], rel=1e-9, abs=1e-12 * M0)
        assert alone.rest_curvature == pytest.approx([step[hinge] for step in rest], rel=1e-9, abs=1e-12 * K0)


def test_only_hysteresis_pays_for_history() -> None:
    def bytes_of(bending: dict[str, object], name: str) -> tuple[int, int]:
        effects = cs.Simulation(scene(bending), threads=1).plan["effects"]
        effect = next(e for e in effects if e["name"] == name and e["on"])
        return effect["elements"], effect["bytes"]

    count, hinge = bytes_of({"model": "hinge", "rigidity": 1e-5}, "hinge")
    _, nonlinear = bytes_of({"model": "nonlinear", **B}, "nonlinear")
    _, hysteresis = bytes_of({"model": "hysteresis", **B}, "hysteresis")
    assert nonlinear == hinge
    assert 0 < hysteresis - hinge <= 48 * count


def test_a_law_without_a_loop_is_named_in_the_scene() -> None:
    with pytest.raises(cs.InvalidScene, match=r"cloth\[0\].material.bending.b1: expected a value ≥ b2"):
        cs.Simulation(scene({"model": "hysteresis", "b1": 1e-5, "b2": 2e-5, "c1": -1e-7}))


def test_the_semi_implicit_scheme_says_where_it_ends() -> None:
    stiff = {"model": "hinge", "rigidity": 1e-2}
    plan = cs.Simulation(scene(stiff, integrator="semi-implicit", dt=0.01), threads=1).plan
    assert plan["stable_dt"] < 0.01
    assert any("largest stable step" in warning for warning in plan["warnings"])
    more = cs.Simulation(scene(stiff, integrator="semi-implicit", dt=0.01, bending_substeps=4), threads=1).plan
    assert more["stable_dt"] == pytest.approx(4 * plan["stable_dt"], rel=1e-6)


def test_hinges_bend_together_unless_told_otherwise() -> None:
    """A sheet that hangs from one side moves otherwise; the plan says what is built."""

    def sheet(**keys: str) -> cs.Simulation:
        scene = cs.Scene(name="sheet", duration=1.0, time={"dt": 0.02}, air={"damping": 10.0})
        material = {
            "areal_density": 0.2,
            "in_plane": {"model": "baraff-witkin", "warp": 1e3, "weft": 1e3, "shear": 1e3},
            "bending": {"model": "hinge", "rigidity": 2e-2, **keys},
        }
        scene.add_cloth(cs.Mesh.grid(0.4, 0.4, 9, 9), material, pins=[{"vertices": list(range(18))}])
        return cs.Simulation(scene, threads=1)

    coupled, named, alone = sheet(), sheet(hinges="coupled"), sheet(hinges="independent")
    assert "hinge coupling" in coupled.plan.running
    assert "hinge coupling" not in alone.plan.running
    for simulation in (coupled, named, alone):
        assert "hinge" in simulation.plan.running
        simulation.advance(1.0)
    assert np.array_equal(coupled.positions, named.positions)
    assert coupled.positions[:, 1].min() > 0.95 * alone.positions[:, 1].min()  # stiffer: droops less
    with pytest.raises(cs.InvalidScene, match="independent"):
        sheet(hinges="loose")
