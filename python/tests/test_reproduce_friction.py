"""Figures 7.2 to 7.8 of ``clothsim reproduce``: the sliding body's solution, measures, and faults that must show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.reproduce import Effort, cards, figure_7_3, figure_7_5, figure_7_7, figure_7_8, table_7_2
from clothsim.reproduce.friction_laws import LAWS, TABLE_7_1, Coefficients, slide
from clothsim.reproduce.wrinkles import Wrinkles

ROUNDING = 1e-12
# Of the differential equation's solution, relative: Runge and Kutta's method with 2,000 steps.
SOLVED = 1e-9

CARD = TABLE_7_1["card"]
SLOPE = {"driving": 2.8, "pressing": 9.4}


# The sliding body -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["C", "CS"])
def test_constant_friction_gives_a_parabola(law: str) -> None:
    times = np.linspace(0.0, 2.0, 21)
    found = slide(CARD, law, times, **SLOPE)
    rate = 2.8 - 0.1 * 9.4
    assert found.speed == pytest.approx(rate * times, rel=SOLVED)
    assert found.way == pytest.approx(0.5 * rate * times**2, rel=SOLVED, abs=ROUNDING)


def test_viscous_friction_gives_an_exponential() -> None:
    plain = replace(CARD, mu_s=CARD.mu_c)
    times = np.linspace(0.0, 3.0, 31)
    rate = 2.8 - 0.1 * 9.4
    found = slide(plain, "CSSV", times, **SLOPE)
    assert found.speed == pytest.approx(rate / 0.6 * (1.0 - np.exp(-0.6 * times)), rel=SOLVED, abs=1e-10)


@pytest.mark.parametrize("law", ["CSS", "CSSV"])
def test_the_solution_fulfils_its_equation(law: str) -> None:
    step = 1e-5
    times = np.array([0.01, 0.1, 0.5, 1.0, 2.0])
    either = np.sort(np.concatenate([times - step, times, times + step]))
    found = slide(CARD, law, either, **SLOPE)
    speed = found.speed.reshape(-1, 3)
    expected = 2.8 - CARD.acceleration(law, speed[:, 1], 9.4)
    assert (speed[:, 2] - speed[:, 0]) / (2.0 * step) == pytest.approx(expected, rel=1e-5)
    way = found.way.reshape(-1, 3)
    assert (way[:, 2] - way[:, 0]) / (2.0 * step) == pytest.approx(speed[:, 1], rel=1e-5)


@pytest.mark.parametrize(("law", "moves"), [("C", True), ("CS", False), ("CSS", False), ("CSSV", False)])
def test_stiction_holds_where_coulomb_friction_does_not(law: str, moves: bool) -> None:
    between = 0.15 * 9.4
    found = slide(CARD, law, np.array([1.0]), driving=between, pressing=9.4)
    assert (found.way[0] > 0.1) == moves
    assert moves or found.way[0] == 0.0


def test_a_scene_gets_what_its_law_uses() -> None:
    assert CARD.friction("C", 0.2) == {"law": "coulomb", "mu_c": 0.1}
    assert CARD.self_friction("CS", 0.2) == {"law": "coulomb-stiction", "mu_c": 0.1, "mu_s": 0.2}
    assert set(CARD.friction("CSS", 0.2)) == {"law", "mu_c", "mu_s", "v_s", "delta_s"}
    # F_v/m = 0.6/s for a contact of 1e-4 kg.
    assert CARD.friction("CSSV", 0.2)["f_v"] == pytest.approx(0.6 * 0.2)


# What is measured ---------------------------------------------------------------------------------------------------


def test_curvature_of_a_rolled_sheet() -> None:
    flat = cs.Mesh.grid(0.4, 0.2, 81, 41)
    radius = 0.1
    angle = flat.vertices[:, 0] / radius
    rolled = np.column_stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), flat.vertices[:, 2]])
    wrinkles = Wrinkles(flat)
    assert wrinkles.weights.sum() == pytest.approx(1.0)
    assert wrinkles.rms(wrinkles.curvature(flat.vertices)) < 1e-9
    bent = np.abs(wrinkles.curvature(rolled))
    assert bent.max() == pytest.approx(1.0 / radius, rel=0.05)
    assert wrinkles.rms(wrinkles.curvature(flat.vertices + [1.0, 2.0, 3.0])) < 1e-9


def test_a_folded_cloth_covers_half() -> None:
    setup = replace(figure_7_3.Setup(), cells=40)
    grid = cs.Mesh.grid(setup.side, setup.side, 41, 41)
    lying = grid.vertices @ np.array([[1, 0, 0], setup.normal, setup.down])
    assert figure_7_3._covered(lying, grid.triangles, setup) == pytest.approx(1.0, abs=0.08)
    folded = grid.vertices.copy()
    folded[:, 0] = np.abs(folded[:, 0])
    lying = folded @ np.array([[1, 0, 0], setup.normal, setup.down])
    assert figure_7_3._covered(lying, grid.triangles, setup) == pytest.approx(0.5, abs=0.08)


def pulled(velocity: Any) -> figure_7_5.Run:
    times = np.arange(len(velocity)) / figure_7_5.FPS
    way = np.cumsum(velocity) / figure_7_5.FPS
    return figure_7_5.Run(times, way, np.asarray(velocity), np.full(len(velocity), 0.4), [])


def test_slips_are_counted_between_rests() -> None:
    setup = figure_7_5.Setup()
    one = [0.0] * 50 + [0.2] * 25
    run = pulled([0.08] * 250 + one * 4 + [0.0] * 10)
    cycles = figure_7_5._cycles(run, setup)
    assert len(cycles) == 4
    assert np.diff([c.loose for c in cycles]) == pytest.approx(0.75)
    assert [c.slip for c in cycles] == pytest.approx([25 * 0.2 / figure_7_5.FPS] * 4)


def test_gliding_and_swinging_are_no_slips() -> None:
    setup = figure_7_5.Setup()
    time = np.arange(800) / figure_7_5.FPS
    swinging = 0.08 * (1.0 - 1.2 * np.cos(7.0 * time))  # passes zero, rests nowhere
    assert figure_7_5._cycles(pulled(np.full(800, 0.08)), setup) == []
    assert figure_7_5._cycles(pulled(swinging), setup) == []


def test_lifting_off_and_leaving_are_told_apart() -> None:
    setup = figure_7_8.Setup()
    times = np.arange(400) / figure_7_8.FPS
    touching = np.interp(times, [0.0, setup.settling, 2.0, 3.0], [0.0, 0.6, 0.3, 0.0])
    run = figure_7_8.Run(times, np.zeros(400), touching, [])
    frame = 1.0 / figure_7_8.FPS
    # 0.45 of the mass half a second after the sphere's start, 0.02 between 2 s and 3 s.
    assert run.lifts(setup) == pytest.approx(0.5, abs=1.5 * frame)
    assert run.gone(setup) == pytest.approx(2.0 - setup.settling + 0.28 / 0.3, abs=1.5 * frame)
    held = replace(run, touching=np.full(400, 0.6))
    assert np.isnan(held.lifts(setup)) and np.isnan(held.gone(setup))


def test_a_turning_sheet_has_its_spin() -> None:
    sheet = cs.Mesh.grid(0.3, 0.3, 5, 5).vertices + [0.1, 0.2, 0.3]
    velocity = np.cross([0.0, 2.5, 0.0], sheet) + [1.0, -2.0, 0.5]
    assert figure_7_8._spin(sheet, velocity, np.ones(25)) == pytest.approx(2.5)


def test_friction_of_a_card_by_its_speed() -> None:
    setup = cards.Cards()
    times = np.linspace(0.0, 1.0, 11)
    _, force = setup.friction(times, (setup.driving - 0.1 * setup.pressing) * times)
    assert force == pytest.approx(np.full(10, 0.1 * setup.mass * setup.pressing))


# Planted faults -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "caught"),
    [
        (lambda law: "C" if law == "CSSV" else law, "CSSV, dt"),
        (lambda law: "C" if law == "CSS" else law, "CSS, dt"),
    ],
)
def test_a_wrong_law_fails_figure_7_7(monkeypatch: pytest.MonkeyPatch, fault: Any, caught: str) -> None:
    right = Coefficients.friction
    monkeypatch.setattr(Coefficients, "friction", lambda self, law, density: right(self, fault(law), density))
    measured = figure_7_7.measure(Effort(quick=True, threads=1))
    differs = [check.what for check in figure_7_7.checks(measured) if not check.passed]
    assert any(caught in what for what in differs), differs


def test_times_are_of_the_same_contacts() -> None:
    measured = table_7_2.measure(Effort(quick=True, threads=1))
    impulses = list(measured.impulses.values())
    # Friction changes who touches within a few steps only a little.
    assert max(impulses) < 1.5 * min(impulses)
    assert set(measured.response) == {"no friction", *LAWS}
    for variant in measured.response:
        assert measured.rounds(variant).shape == (table_7_2.QUICK_ROUNDS,)
        assert 0.0 < measured.least(variant) <= measured.median(variant)
        assert not set(table_7_2.DETECTION) - set(measured.stages[variant])
