"""The quick part of the validation of friction: reference solutions, one run of each test."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
integrate = pytest.importorskip("scipy.integrate")
METHODS = ("velocity-filter", "constraints")


@pytest.fixture(scope="module", autouse=True)
def _path() -> Any:
    sys.path.insert(0, str(ROOT))
    yield
    sys.path.remove(str(ROOT))


def module(name: str) -> Any:
    return importlib.import_module(f"validation.{name}")


# Between solutions of one equation found in two ways: the solver's tolerance times the number of events.
SOLVERS = 1e-8


@pytest.mark.parametrize("speed", [0.02, 0.2, 2.0])
def test_stick_slip_solution_is_the_closed_form(speed: float) -> None:
    sliding = module("sliding")
    law = sliding.Law("coulomb-stiction", 0.1, 0.4)
    block, stiffness = sliding.Block(0.02, 0.2, 0.1, law), 0.5
    exact = sliding.stick_slip(block, stiffness, speed)
    seconds = 0.4 * 0.2 / stiffness / speed + 2.5 * exact.period
    found = sliding.solve(block, lambda t, x: stiffness * (speed * t - x), seconds)
    starts = [a for a, _ in found.slips]
    assert np.diff(starts)[0] == pytest.approx(exact.period, rel=SOLVERS)
    assert found.slips[1][1] - found.slips[1][0] == pytest.approx(exact.slip, rel=SOLVERS)
    assert exact.way == pytest.approx(speed * exact.period, rel=SOLVERS)
    other = sliding.stick_slip(block._replace(law=law._replace(mu_c=0.11)), stiffness, speed)
    assert np.diff(starts)[0] != pytest.approx(other.period, rel=1e-4)


def test_card_by_the_equation_and_by_quadrature() -> None:
    sliding, cards = module("sliding"), module("cards")
    for name in ("CSS", "CSSV"):
        law = cards.LAWS[name]
        other = sliding.slope_by_quadrature(law, cards.ANGLE, cards.DENSITY, cards.GRAVITY, cards.SECONDS)
        assert cards.target(law) == pytest.approx(other, rel=SOLVERS)
        assert cards.target(law._replace(delta_s=0.21)) != pytest.approx(other, rel=1e-5)
    acceleration = cards.GRAVITY * np.cos(cards.ANGLE) * (0.3 - 0.1)
    for name in ("C", "CS"):
        assert cards.target(cards.LAWS[name]) == pytest.approx(0.5 * acceleration * cards.SECONDS**2, rel=SOLVERS)


@pytest.mark.parametrize("name", ["CS", "CSS", "CSSV"])
def test_work_of_the_pull_is_energy_and_friction(name: str) -> None:
    sliding, block = module("sliding"), module("block")
    law = block.LAWS[name]
    ours, stiffness = block.block(law)
    found = block.solution(law, 200_001)
    force = stiffness * (block.SPEED * found.t - found.x)
    work = integrate.trapezoid(force, found.t) * block.SPEED
    # Friction acts while the block moves; at the ends of slips its coefficient is not smooth.
    rubbed = integrate.trapezoid(
        np.where(found.v > 0.0, ours.law.kinetic(ours.normal, ours.area, found.v) * found.v, 0.0), found.t
    )
    stored = 0.5 * ours.mass * found.v[-1] ** 2 + 0.5 * force[-1] ** 2 / stiffness
    assert work == pytest.approx(rubbed + stored, rel=1e-5)
    assert work != pytest.approx(0.99 * rubbed + stored, rel=1e-3)
    assert sliding.solve(ours, lambda _t, _x: 0.39 * ours.normal, 1.0).slips == []


@pytest.mark.parametrize("delta", [0.2, 0.7])
def test_slip_out_of_balance_is_that_of_a_touch(delta: float) -> None:
    """From F = μ_s N with an infinite slope: as from a vanishing speed, which needs no other variable."""
    sliding = module("sliding")
    block = sliding.Block(0.02, 0.2, 0.1, sliding.Law("stribeck", 0.1, 0.4, 0.4, delta))

    def end(speed: float, force: float = 0.4 * 0.2) -> float:
        return float(sliding.solve(block, lambda t, x: force + 0.5 * (0.2 * t - x), 0.7, v=speed, samples=2).x[-1])

    assert end(0.0) == pytest.approx(end(1e-9), rel=1e-5)
    assert end(0.0) != pytest.approx(end(0.0, 0.39 * 0.2), rel=1e-2)


def test_slips_are_found_in_samples() -> None:
    block = module("block")
    t = np.linspace(0.0, 4.0, 4001)
    speed = np.where((t > 1.0) & (t < 1.5) | (t > 3.0), 0.5, 0.0)
    speed[1200:1205] = 0.0  # a touch of zero
    (a, b), (c, d) = block.slips(t, speed)
    assert [a, b, c] == pytest.approx([1.0, 1.5, 3.0], abs=2e-3)
    assert d == np.inf
    assert block.period([(a, b), (c, d)]) == pytest.approx(2.0, abs=2e-3)


def test_each_vertex_of_the_block_has_its_share_of_the_spring() -> None:
    """One step without contact, stretched evenly: all vertices gain the same speed, k x/m dt."""
    block, cs = module("block"), importlib.import_module("clothsim")
    ours, stiffness = block.block(block.LAWS["C"])
    made, body = block.mesh(5)
    in_plane = {"model": "baraff-witkin", "warp": stiffness * block.LENGTH / block.WIDTH, "weft": 5.0, "shear": 5.0}
    scene = cs.Scene(gravity=[0.0, 0.0, 0.0], time={"dt": 1e-5, "integrator": "explicit-euler"})
    held = list(range(body, len(made.vertices)))
    stretched = made.vertices + np.where(np.arange(len(made.vertices)) < body, -0.1, 0.0)[:, None] * [1.0, 0.0, 0.0]
    uv = made.vertices[:, [0, 2]] * [1.0, -1.0]
    scene.add_cloth(
        cs.Mesh(stretched, made.triangles, uv),
        cs.Material(block.DENSITY, in_plane, {"model": "none"}),
        rest="uv",
        pins=[{"vertices": held}],
    )
    simulation = cs.Simulation(scene, threads=1)
    assert simulation.masses[:body].sum() == pytest.approx(ours.mass)
    simulation.step()
    gained = simulation.velocities[:body]
    assert gained[:, 0] == pytest.approx(stiffness / ours.mass * 0.1 * 1e-5, rel=1e-9)
    assert np.abs(gained[:, 1:]).max() < 1e-9 * gained.max()


@pytest.mark.parametrize("method", METHODS)
def test_card_slides_as_the_equation_says(method: str) -> None:
    cards = module("cards")
    for name in ("C", "CSSV"):
        way = cards.simulate(cards.LAWS[name], method, 4e-3, "grid 5x5").way[-1]
        assert way == pytest.approx(cards.target(cards.LAWS[name]), rel=cards.BOUND / 100)
        assert way != pytest.approx(cards.target(cards.LAWS["CSS"]), rel=cards.BOUND / 100)


@pytest.mark.parametrize("method", METHODS)
def test_card_starts_to_slide_at_the_angle_of_friction(method: str) -> None:
    slope = module("slope")
    for how in (slope.by_bisection, slope.by_tilting):
        angle = how("CS", method, 0.5)
        assert angle == pytest.approx(np.degrees(np.arctan(0.5)), abs=slope.BOUND)
        assert angle != pytest.approx(np.degrees(np.arctan(0.25)), abs=slope.BOUND)


@pytest.mark.parametrize("method", METHODS)
def test_card_at_rest_stays(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    slope = module("slope")
    monkeypatch.setattr(slope, "REST", 4.0)
    assert slope.rest("CSSV", method, 4e-3, "irregular")[0] < slope.DRIFT
    monkeypatch.setattr(slope, "BELOW", -1.0)
    assert slope.rest("CSSV", method, 4e-3, "irregular")[0] > 1e6 * slope.DRIFT


@pytest.mark.parametrize("method", METHODS)
def test_block_sticks_and_slips_as_the_equation_says(method: str) -> None:
    block = module("block")
    seconds, dt = 3.0, 4e-3
    for name in ("C", "CS"):
        ours = block.simulate(block.LAWS[name], method, dt, 5, seconds)
        exact = block.solution(block.LAWS[name], len(ours.t), seconds)
        assert block.deviation(ours, exact) < block.BOUND[dt]
        assert block.deviation(ours, block.solution(block.LAWS["CSS"], len(ours.t), seconds)) > block.BOUND[dt]
        found = block.slips(ours.t, ours.speed)
        assert len(found) == len(exact.slips)
        if name == "CS":
            assert block.period(found) == pytest.approx(block.exact_period("CS"), rel=block.PERIOD / 100)


@pytest.mark.parametrize("method", METHODS)
def test_belt_on_a_drum_multiplies_the_tension(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    capstan = module("capstan")
    for name, value in (("RUN", 1.2), ("AVERAGE", 0.4)):
        monkeypatch.setattr(capstan, name, value)
    wrap = 60.0
    law = module("sliding").coulomb(0.3)
    ratio = capstan.simulate(capstan.Case(law, wrap, method, cell=4e-3)).ratio()
    assert ratio == pytest.approx(np.exp(0.3 * np.radians(wrap)), rel=capstan.BOUND / 100)
    assert ratio != pytest.approx(np.exp(0.2 * np.radians(wrap)), rel=capstan.BOUND / 100)
