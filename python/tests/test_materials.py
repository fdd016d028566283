"""The library of fabrics: every value with a source, laws by name, the page that prints it."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from conftest import ROOT, RunCli

import clothsim as cs
from clothsim.material import Fabric

NAMES = cs.materials.names()
LAWS = cs.materials.laws()
KEYS = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "REFERENCES.bib").read_text(), re.MULTILINE))

# What the fabrics of [feng2022] span, and the engine's stability tests cover.
DENSITIES = (0.015, 0.9)
RIGIDITIES = (1e-6, 3e-4)

UNITS = {
    "areal_density": "kg/m²",
    "thickness": "m",
    "tensile_warp": "N/m",
    "tensile_weft": "N/m",
    "shear": "N/m",
    "bending_rigidity": "N m",
    "coercive_couple": "N m/m",
    "transition_curvature": "1/m",
    "friction": "1",
    "in_plane_damping": "s",
    "bending_damping": "s",
}


def test_the_asked_for_fabrics_are_there() -> None:
    assert len(NAMES) >= 10
    assert {"cotton", "denim", "silk", "wool", "wool-lycra", "polyester", "linen", "acrylic-twill"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_value_has_its_unit_and_source(name: str) -> None:
    fabric = cs.materials.fabric(name)
    assert fabric.name == name
    assert fabric.about
    assert set(UNITS) - set(fabric.values()) <= {"thickness", "friction"}
    for key, value in fabric.values().items():
        assert value.unit == UNITS[key]
        assert np.isfinite(value.value) and value.value > 0.0
        assert value.note
        assert value.is_estimate == (value.source == "")
        assert value.is_estimate or value.source in KEYS & set(cs.materials.sources())
        assert set(re.findall(r"\[(\w+)\]", value.note)) <= KEYS
        assert ("estimate" in str(value)) == value.is_estimate
    assert DENSITIES[0] <= fabric.areal_density.value <= DENSITIES[1]
    assert RIGIDITIES[0] <= fabric.bending_rigidity.value <= RIGIDITIES[1]


def test_published_values_in_the_units_of_their_tables() -> None:
    twill, tropical, denim = (cs.materials.fabric(n) for n in ("acrylic-twill", "wool-tropical", "denim"))
    cotton = cs.materials.fabric("cotton")
    gf = 9.80665e-3
    expected = {
        "B of figure 4.7": (twill.bending_rigidity, 0.26 * gf * 1e-2),
        "K0 of figure 4.7": (twill.transition_curvature, 0.5 / 0.76 * 100),
        "2HB of figure 4.7": (twill.coercive_couple, 0.5**2 / 0.76 * gf),
        "B of fabric B": (tropical.bending_rigidity, 0.067 * gf * 1e-2),
        "2HB of fabric B": (tropical.coercive_couple, 0.033 * gf),
        "weight of fabric B": (tropical.areal_density, 0.1629),
        "shear of six denims": (denim.shear, 11.767 / 6 * gf / 1e-2 / np.radians(1.0)),
        "mass of cotton": (cotton.areal_density, 0.1503),
        "modulus times thickness of cotton": (cotton.tensile_warp, 0.821e6 * 0.318e-3),
    }
    for what, (value, si) in expected.items():
        assert not value.is_estimate, what
        assert value.value == pytest.approx(si, rel=1e-3), what


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", NAMES)
def test_every_fabric_falls_and_bends_under_every_law(name: str, law: str) -> None:
    material = cs.materials.material(name, bending=law)
    scene = cs.Scene(time={"dt": 0.01})
    scene.add_cloth(cs.Mesh.grid(0.3, 0.3, 7, 7), material, pins=[{"vertices": [0, 6]}])
    simulation = cs.Simulation(scene, threads=1)
    before = simulation.positions
    for _ in range(5):
        simulation.step()
    fall = before[:, 1] - simulation.positions[:, 1]
    # Five implicit steps of free fall are 0.0147 m; the pinned corners hold some of it back.
    assert 0.005 < fall.max() < 0.02
    assert np.isfinite(simulation.positions).all()


def test_laws_by_name() -> None:
    fabric = cs.materials.fabric("silk")
    linear = cs.materials.material("silk")
    assert linear == cs.materials["silk"]
    assert linear.bending["rigidity"] == fabric.bending_rigidity.value
    law = cs.materials.material("silk", bending="hysteresis", plasticity=0.1, fatigue=0.02).bending
    assert law["model"] == "hysteresis"
    assert (law["plasticity"], law["fatigue"]) == (0.1, 0.02)
    assert law["coercive_couple"] == fabric.coercive_couple.value
    assert cs.materials.material("silk", bending="none").bending == {"model": "none"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "tweed"}, r'material: expected one of .*"wool".*got "tweed"'),
        ({"name": "silk", "bending": "rubber"}, r'bending: expected one of .*"hysteresis".*got "rubber"'),
        ({"name": "silk", "bending": "hysteresis", "plasticity": 1.5}, r"bending\.plasticity: .*got 1\.5"),
        ({"name": "silk", "bending": "hysteresis", "plastcity": 0.1}, "plastcity"),
        ({"name": "silk", "plasticity": 0.1}, "plasticity"),
    ],
)
def test_what_the_library_refuses(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(cs.InvalidInput, match=message):
        cs.materials.material(**arguments)  # type: ignore[arg-type]


def test_the_printed_page_is_the_published_one(run_cli: RunCli) -> None:
    page = run_cli("materials")
    assert page.returncode == 0, page.stderr
    assert (ROOT / "docs" / "fabrics.md").read_text() == page.stdout, "run `clothsim materials > docs/fabrics.md`"
    for key, about in cs.materials.sources().items():
        assert f"- **{key}**: {about}" in page.stdout
    row = next(line for line in page.stdout.splitlines() if line.startswith("| cotton |"))
    assert "| 0.15 |" in row and "| ~40 |" in row, "a published value is bare, an estimate is marked"


def test_a_few_fabrics_and_json(run_cli: RunCli) -> None:
    text = run_cli("materials", "silk", "denim").stdout
    assert [line.split(":")[0] for line in text.splitlines() if line and line[0] != " "] == ["silk", "denim"]
    facts = json.loads(run_cli("materials", "silk", "--json").stdout)
    (silk,) = facts["fabrics"]
    assert silk["shear"]["value"] == cs.materials.fabric("silk").shear.value
    assert set(facts["sources"]) <= KEYS
    wrong = run_cli("materials", "tweed")
    assert wrong.returncode == 2
    assert "tweed" in wrong.stderr and "wool" in wrong.stderr


def test_fabrics_compare_by_value() -> None:
    assert cs.materials.fabric("wool") == cs.materials.fabric("wool")
    assert isinstance(cs.materials.fabric("wool"), Fabric)
    assert str(cs.materials.fabric("wool")).startswith("wool: ")
