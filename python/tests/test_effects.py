"""What may be left out where it cannot matter, from Python; and that the table of prices has every effect."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs

README = Path(__file__).parents[2] / "README.md"


def _scene(**more: Any) -> cs.Scene:
    """A napkin that lies down on a floor."""
    mesh = {"generator": "grid", "width": 0.3, "height": 0.3, "nx": 9, "ny": 9}
    return cs.Scene(
        duration=1.0,
        air={"damping": 4.0},
        cloth=[{"name": "napkin", "mesh": mesh, "material": "cotton", "position": [0.0, 0.02, 0.0]}],
        collider=[{"name": "floor", "shape": {"type": "plane", "half_size": 1.0}}],
        **{"contact": {"thickness": 0.006}, **more},
    )


def test_auto_gives_the_same_bits_and_says_what_it_left_out() -> None:
    on = cs.Simulation(_scene(), threads=1)
    auto = cs.Simulation(_scene(effects={"self_collision": "auto", "ccd": "auto"}), threads=1)
    for _ in range(40):
        on.step()
        auto.step()
        assert on.positions.tobytes() == auto.positions.tobytes()
    looks = [step["contact"]["looked_at"] for step in auto.report["steps"]]
    assert 0 in looks
    assert all(step["contact"]["flat_triangles"] == 128 for step in auto.report["steps"])
    assert all(step["contact"]["flat_triangles"] == 0 for step in on.report["steps"])


def test_slow_friction_is_planned_and_reported() -> None:
    law = {"law": "stribeck", "mu_c": 0.1, "mu_s": 0.3, "v_s": 0.5, "delta_s": 1.0}

    def napkin(friction: Any, choice: str) -> cs.Simulation:
        contact = {"thickness": 0.006, "friction": friction}
        return cs.Simulation(_scene(contact=contact, effects={"friction": choice}), threads=1)

    on, auto, plain = napkin(law, "on"), napkin(law, "auto"), napkin(0.3, "auto")
    why = [next(e for e in sim.plan["effects"] if e["name"] == "slow friction") for sim in (on, auto, plain)]
    assert [e["on"] for e in why] == [False, True, False]
    assert "m/s" in why[1]["why"]
    assert "Coulomb" in why[2]["why"]
    for sim in (on, auto):
        sim.advance(0.2)
    slow = [[s["contact"]["slow_friction"] for s in sim.report["steps"]] for sim in (on, auto)]
    assert not any(slow[0])
    assert sum(slow[1]) > 20
    # Contacts settle to 1e-6 m/s.
    assert np.abs(on.positions - auto.positions).max() <= 2e-6 * 0.2


def test_cloth_at_rest_sleeps(tmp_path: Path) -> None:
    sim = cs.Simulation(_scene(effects={"sleep": {"speed": 5e-3, "time": 0.1}}), threads=1)
    sim.advance(0.6)
    assert sim.report["steps"][-1]["asleep"] == 1
    assert not np.any(sim.velocities)
    sim.save_checkpoint(tmp_path / "asleep.ckpt")
    resumed = cs.Simulation.resume(tmp_path / "asleep.ckpt")
    assert resumed.report["steps"][-1]["asleep"] == 1


def test_unknown_choices_are_named() -> None:
    with pytest.raises(cs.InvalidScene, match=r"effects\.friction_tolerance.*< 1"):
        cs.Simulation(_scene(effects={"friction_tolerance": 1.0}))
    with pytest.raises(cs.InvalidScene, match=r"effects\.ccd.*auto"):
        cs.Simulation(_scene(effects={"ccd": "never"}))


def test_the_plan_estimates_and_has_every_effect() -> None:
    plan = cs.Simulation(_scene()).plan
    for effect in plan["effects"]:
        assert effect["why"]
        if not effect["on"]:
            assert (effect["elements"], effect["bytes"], effect["milliseconds"]) == (0, 0, None)
    timed = {e["name"]: e["milliseconds"] for e in plan["effects"] if e["milliseconds"] is not None}
    assert timed["integrator"] > 0.0
    assert timed["contact"] > 0.0
    assert "an estimate" in str(plan)


def test_the_table_of_prices_has_every_effect() -> None:
    text = README.read_text(encoding="utf-8").split("<!-- effect prices: begin -->")[1]
    table = text.split("<!-- effect prices: end -->")[0]
    priced = set(re.findall(r"^\| ([^|]+?) \| (?:hanging|drape) ", table, flags=re.MULTILINE))
    effects = {effect["name"] for effect in cs.Simulation(_scene()).plan["effects"]}
    assert not effects - priced
