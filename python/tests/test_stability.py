"""The stability atlas: the quick form of every case, and that each verdict is given where it has to be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.stability import energy
from clothsim.stability.case import Setup
from clothsim.stability.cases.common import border
from clothsim.stability.catalogue import CATALOGUE, find
from clothsim.stability.energy import Entry, growth
from clothsim.stability.observe import observe
from clothsim.stability.topology import above, beyond, drumhead, inside, linking_number, order_of_sheets, together
from clothsim.stability.verdict import Verdict, judge
from clothsim.stability.worker import run_cell
from clothsim.study.pool import Job, run_jobs


def verdict(setup: Setup) -> Verdict:
    return judge(observe(setup)).verdict


def falling(integrator: str, dt: float, duration: float = 0.1) -> cs.Scene:
    material = {"areal_density": 0.15, "in_plane": {"model": "spring", "stiffness": 1e3}}
    scene = cs.Scene(duration=duration, time={"dt": dt, "integrator": integrator})
    scene.add_cloth(cs.Mesh.grid(0.2, 0.2, 5, 5), material, pins=[{"vertices": [0, 4]}])
    return scene


# The quick form -------------------------------------------------------------------------------------------------


@pytest.mark.timeout(240)
def test_the_quick_form_breaks_no_promise() -> None:
    """All cases at a few cells each, side by side; no others fail than those that are known to."""
    atlas = cs.stability.run(quick=True, progress=False)
    assert [own.case.name for own in atlas.maps] == cs.stability.case_names()
    assert Verdict.UNKNOWN not in {c.judged.verdict for c in atlas.cells}, "a cell takes too long"
    broken = {(c.case.name, c.x, c.y): c.judged for c in atlas.broken}
    assert not broken, broken


@pytest.mark.parametrize("case", CATALOGUE, ids=lambda c: c.name)
def test_cases_say_what_they_are(case: Any) -> None:
    assert case.title and len(case.about) > 40
    assert set(case.x.quick) <= set(case.x.values) and set(case.y.quick) <= set(case.y.values)
    assert 1 <= len(case.x.quick) * len(case.y.quick) <= 6, "the quick form is quick"


# Planted faults: every verdict is given -------------------------------------------------------------------------


def test_a_stable_run_is_called_stable() -> None:
    assert verdict(Setup(falling("implicit-euler", 1e-3))) is Verdict.STABLE


def test_explicit_steps_past_their_limit_are_caught_or_grow() -> None:
    assert verdict(Setup(falling("explicit-euler", 5e-3))) is Verdict.CAUGHT
    # Just past the limit, and so short that it has not come to the guard's bound.
    grown = [verdict(Setup(falling("explicit-euler", 5e-4, 5e-4 * steps))) for steps in range(20, 50)]
    assert Verdict.GREW in grown or Verdict.SILENT in grown, grown


class Broken(cs.Simulation):
    """A simulation whose state is falsified from its fifth step on."""

    fault: Callable[[Any], Any] = staticmethod(lambda x: x)

    @property
    def positions(self) -> Any:
        x = super().positions
        return type(self).fault(x) if self.time > 0.0045 else x


@pytest.fixture
def falsified(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Any], Any]], None]:
    def plant(fault: Callable[[Any], Any]) -> None:
        monkeypatch.setattr(Broken, "fault", staticmethod(fault))
        monkeypatch.setattr("clothsim.stability.observe.Simulation", Broken)

    return plant


def on_floor(**keys: Any) -> Setup:
    scene = cs.Scene(duration=0.02, time={"dt": 1e-3}, contact={"thickness": 0.004})
    scene.add_cloth(cs.Mesh.grid(0.2, 0.2, 5, 5), "cotton", position=(0.0, 0.02, 0.0), **keys)
    scene.add_collider("floor", shape={"type": "plane", "half_size": 1.0})
    return Setup(scene, lambda x, c: np.sign(x[:, 1] - c[:, 1].mean()).astype(np.int64))


def test_what_is_falsified_is_seen(falsified: Callable[[Callable[[Any], Any]], None]) -> None:
    assert verdict(on_floor()) is Verdict.STABLE

    def not_finite(x: Any) -> Any:
        x[3, 1] = np.nan
        return x

    falsified(not_finite)
    assert verdict(on_floor()) is Verdict.SILENT

    def one_through(x: Any) -> Any:
        x[12, 1] = -0.01
        return x

    falsified(one_through)
    setup = on_floor()
    assert verdict(setup) is Verdict.TUNNELLED
    assert verdict(Setup(setup.scene)) is Verdict.INTERSECTED, "without labels of side, its triangles still intersect"

    falsified(lambda x: x - [0.0, 0.1, 0.0])
    assert verdict(setup) is Verdict.TUNNELLED, "all of it is through: nothing intersects"
    assert verdict(Setup(setup.scene)) is Verdict.STABLE, "which only labels can tell"

    falsified(lambda x: x + [0.0, 0.5, 0.0])
    assert verdict(setup) in (Verdict.GREW, Verdict.SILENT), "it was lifted by nothing"


def test_a_stuck_run_and_a_refused_start() -> None:
    closing = find("plates").build(5e-3, -1.0)
    assert verdict(closing) is Verdict.STUCK
    scene = cs.Scene(contact={"thickness": 0.004})
    for turn in (0.0, 1.0):
        scene.add_cloth(
            cs.Mesh.grid(0.2, 0.2, 5, 5), "cotton", name=f"sheet {turn}", rotation={"axis": [1, 0, 0], "angle": turn}
        )
    judged = judge(observe(Setup(scene)))
    assert judged.verdict is Verdict.REFUSED and judged.why.startswith("IntersectingStart: ")


@pytest.mark.parametrize(("case", "value"), [("fast-sphere", 0.0), ("slivers", 0.0), ("scale", -1.0), ("stack", 0.0)])
def test_values_that_make_no_scene_are_refused(case: str, value: float) -> None:
    assert judge(run_cell({"case": case, "x": 5e-3, "y": value, "fixed": {}})[0]).verdict is Verdict.REFUSED


def test_a_cell_has_a_time_limit(tmp_path: Any) -> None:
    atlas = cs.stability.run(["stretch"], at={"dt": [1e-7], "stiffness": [1.0]}, limit=0.5, progress=False)
    assert [c.judged.verdict for c in atlas.cells] == [Verdict.UNKNOWN]


def test_an_error_that_nobody_expects_is_a_failure(tmp_path: Path) -> None:
    job = Job(tmp_path / "cell", {"threads": 1}, "clothsim.nowhere")
    run_jobs([job], None, None, lambda: None)
    crashed = judge(json.loads((tmp_path / "cell.result").read_bytes()))
    assert crashed.verdict is Verdict.FAILED and "exit code 1" in crashed.why
    assert judge({"error": "exit code 1", "error_type": "ProcessFailed"}).verdict is Verdict.FAILED
    assert judge({"error": "stage", "error_type": "SolverFailed", "started": True}).verdict is Verdict.FAILED


def test_the_worst_is_said_first() -> None:
    facts = {"started": True, "finite": True, "growth": 3.0, "growth_left": 0.0}
    stuck = {**facts, "error": "stuck", "error_type": "SimulationStuck"}
    crossed = {**stuck, "intersections": 2, "intersected_at": 0.1}
    passed = {**crossed, "passed": 1, "passed_at": 0.1}
    got = [judge(f).verdict for f in (facts, stuck, crossed, passed)]
    assert got == [Verdict.GREW, Verdict.STUCK, Verdict.INTERSECTED, Verdict.TUNNELLED]


# What verdicts are made from ------------------------------------------------------------------------------------


def test_the_account_of_energy() -> None:
    def entries(totals: list[float], driven: tuple[int, ...] = ()) -> list[Entry]:
        return [Entry(e, 0.0, 0.0, k in driven) for k, e in enumerate(totals)]

    assert growth(entries([2.0, 1.5, 1.0])).most == 0.0
    up_and_down = growth(entries([2.0, 1.0, 3.0, 1.0, 0.5, 0.4, 0.3, 0.2]))
    assert up_and_down.most == pytest.approx(1.0) and up_and_down.left == 0.0
    stays = growth(entries([2.0, 4.0, 6.0, 8.0]))
    assert (stays.most, stays.left) == pytest.approx((3.0, 3.0))
    assert growth(entries([2.0, 9.0, 9.0, 8.0], driven=(1,))).most == 0.0, "pins may do work while they move"
    assert growth(entries([2.0, 1.0, 9.0, 18.0], driven=(1, 2))).most == pytest.approx(1.0), "and not afterwards"
    assert growth(entries([0.0, 5.0]), allowed=4.0).most == 0.25, (
        "what contact may add does not count, and is available"
    )
    assert growth(entries([1.0, float("nan")])).most == float("inf")


def test_kinetic_and_potential_energy_are_computed_here() -> None:
    scene = falling("implicit-euler", 1e-3)
    sim = cs.Simulation(scene)
    sim.advance(0.05)
    gravity = np.array([0.0, -9.81, 0.0])
    kinetic, potential = energy.external(sim.masses, sim.positions, sim.velocities, gravity, np.zeros(3))
    assert kinetic == pytest.approx(sim.energy["kinetic"]) and potential == pytest.approx(sim.energy["gravity"])


def test_winding_and_linking_numbers() -> None:
    ball = cs.Mesh.sphere(1.0, 2)
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.2, 0.0], [5.0, 0.0, 0.0]])
    assert np.abs(inside(points, np.asarray(ball.vertices), np.asarray(ball.triangles))).tolist() == [1, 1, 0, 0]
    t = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = np.column_stack([np.cos(t), np.sin(t), 0.0 * t])
    other = np.column_stack([1.0 + np.cos(t), 0.0 * t, np.sin(t)])
    assert abs(linking_number(ring, other)) == 1
    assert linking_number(ring, other + [3.0, 0.0, 0.0]) == 0


def test_labels_of_side_change_with_a_passage_and_not_without() -> None:
    sheet = cs.Mesh.grid(1.0, 1.0, 7, 7)
    x, triangles = np.array(sheet.vertices), np.asarray(sheet.triangles)
    label = drumhead(border(7), triangles)
    ball = np.array([0.0, 0.1, 0.0])
    before = label(x, ball)
    pushed = x.copy()
    pushed[np.abs(x[:, [0, 2]]).max(axis=1) < 0.4, 1] = -0.5
    assert label(pushed, ball - [0.0, 0.4, 0.0]) == before, "the sheet went along"
    assert label(x, ball - [0.0, 0.4, 0.0]) != before, "the ball is through"
    assert label(x, ball - [0.0, 9.0, 0.0]) != before, "and far away"
    plate = np.array([[-1.0, 0.5, -1.0], [1.0, 0.5, -1.0], [1.0, 0.5, 1.0], [-1.0, 0.5, 1.0]])
    sides = together(above((0.0, 1.0, 0.0), -0.2), beyond(slice(0, 4), [0.0, 1.0, 0.0]))
    start = sides(x, plate)
    assert (sides(x, plate - [0.0, 0.4, 0.0]) == start).all()
    assert (sides(x, plate - [0.0, 0.6, 0.0]) != start).sum() == 49
    assert (sides(pushed, plate) != start).sum() == 25
    stack = np.concatenate([x + [0.0, 0.1 * k, 0.0] for k in range(4)])
    order = order_of_sheets(4, 49)
    swapped = stack.copy()
    swapped[49:98, 1] += 0.15
    assert order(stack, plate).tolist() == [1, 1, 1] and order(swapped, plate).tolist() == [1, -1, 1]


def test_steps_chosen_by_their_error_are_in_the_atlas() -> None:
    """Every scene of that case has them, and a tolerance that is kept takes more of them than one that is not."""
    case = find("auto-step")
    for name in case.y.values:
        time = case.build(1e-2, name).scene.to_dict()["time"]
        assert (time["dt"], time["dt_tolerance"]) == ("auto", 1e-2), name
    loose, tight = (observe(case.build(tolerance, "stiff springs")) for tolerance in (1e-2, 1e-4))
    assert loose["dt"] == "auto" and judge(loose).verdict is judge(tight).verdict is Verdict.STABLE
    assert tight["steps"] > 3 * loose["steps"]


def test_a_cell_takes_keys_for_its_scene() -> None:
    job = {"case": "stretch", "x": 5e-3, "y": 1e4, "fixed": {}}
    assert judge(run_cell(job)[0]).verdict is Verdict.STABLE
    assert judge(run_cell({**job, "fixed": {"integrator": "explicit-euler"}})[0]).verdict is Verdict.CAUGHT
