"""The quick part of the validation: reference solutions, one strip of each test. `make validation` runs all of it."""

from __future__ import annotations

import csv
import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("scipy")


@pytest.fixture(scope="module", autouse=True)
def _path() -> Any:
    sys.path.insert(0, str(ROOT))
    yield
    sys.path.remove(str(ROOT))


def module(name: str) -> Any:
    return importlib.import_module(f"validation.{name}")


# A cantilever that hardly bends: the first correction is of the order of its slope squared.
SMALL = 1e-3
# Between the collocation solver and the same equation stepped by a Runge–Kutta scheme.
SOLVERS = 1e-7


def test_elastica_of_small_deflection_is_the_beam() -> None:
    reach, droop = module("elastica").cantilever(SMALL).tip
    assert droop == pytest.approx(SMALL / 8, rel=SMALL)
    assert reach == pytest.approx(1.0, abs=SMALL**2)
    assert droop != pytest.approx(SMALL / 6, rel=SMALL)  # the same beam with its weight at the middle of the moment arm


@pytest.mark.parametrize("gamma", [1.0, 10.0, 1000.0])
def test_elastica_satisfies_its_equation_stepped_from_the_free_end(gamma: float) -> None:
    """Shooting from the tip's slope with a fine Runge–Kutta scheme arrives horizontal at the clamp."""
    curve = module("elastica").cantilever(gamma)

    def clamp_slope(g: float) -> float:
        steps = 20_000
        h = 1.0 / steps
        y = np.array([curve.theta[-1], 0.0])  # θ and −dθ/ds over the distance r from the tip

        def rate(r: float, y: Any) -> Any:
            return np.array([-y[1], g * r * np.cos(y[0])])

        for k in range(steps):
            r = k * h
            k1 = rate(r, y)
            k2 = rate(r + h / 2, y + h / 2 * k1)
            k3 = rate(r + h / 2, y + h / 2 * k2)
            k4 = rate(r + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return float(y[0])

    sensitivity = np.exp(np.sqrt(gamma))  # shooting from the tip grows what the tip's slope is off by
    assert abs(clamp_slope(gamma)) < SOLVERS * sensitivity
    assert abs(clamp_slope(1.05 * gamma)) > 1e-3


def test_angle_of_the_tilted_plane_means_half_the_overhang() -> None:
    elastica = module("elastica")
    gamma = elastica.gamma_of_slope(np.tan(np.radians(elastica.PEIRCE_ANGLE)))
    assert gamma ** (-1 / 3) == pytest.approx(0.5, rel=3e-4)  # the angle is rounded to half a degree
    assert elastica.gamma_of_slope(np.tan(np.radians(43.0))) ** (-1 / 3) != pytest.approx(0.5, rel=3e-3)


def test_loops_without_weight_are_those_of_the_textbook() -> None:
    elastica = module("elastica")
    heights = {form: elastica.loop(slope, 0.0).y[-1] / 2 for form, slope in module("loop").FORMS.items()}
    assert heights["ring"] == pytest.approx(1 / np.pi, rel=1e-8)
    assert heights["heart"] == pytest.approx(0.1337, abs=2e-4)
    assert heights["pear"] == pytest.approx(0.4243, abs=1e-4)
    assert elastica.loop(0.3, 0.0).y[-1] / 2 != pytest.approx(1 / np.pi, rel=1e-2)


@pytest.mark.parametrize("kind", ["union-jack", "equilateral", "one-way"])
def test_linear_rigidity_lies_between_a_free_and_a_flat_sheets(kind: str) -> None:
    strips = module("strips")
    cells = 40
    low, high = strips.INDEPENDENT[kind]
    got = [strips.linear_rigidity(strips.strip(kind, 0.2, cells, n), 0.2, "independent") for n in (8, 40)]
    # First-order boundary layers one cell wide remain at the edges of the narrower strip.
    assert low - 0.01 < got[0] < got[1] < high + 0.01
    assert not low - 0.01 < got[1] / 0.8 < high + 0.01


# A strip of coupled hinges has its material's rigidity but for the boundary layers, one cell wide, of 40 cells.
LAYERS = 0.005


@pytest.mark.parametrize("kind", ["union-jack", "equilateral", "equilateral-along", "one-way"])
def test_coupled_hinges_have_the_rigidity_of_the_material(kind: str) -> None:
    strips = module("strips")
    cloth = strips.strip(kind, 0.2, 40, 8)
    assert strips.linear_rigidity(cloth, 0.2) == pytest.approx(1.0, abs=LAYERS)
    assert strips.linear_rigidity(cloth, 0.2, "independent") != pytest.approx(1.0, abs=LAYERS)


# What the tip may be off by at 20 triangles along, of its displacement [%]: half of what 40 are held to.
COARSE_BOUND = 1.0


@pytest.mark.parametrize("kind", ["union-jack", "equilateral", "one-way"])
def test_cantilever_against_the_elastica(kind: str) -> None:
    cantilever = module("cantilever")
    for gamma in (1.0, 10.0):
        tip = cantilever.simulate(kind, gamma, 20, 4)
        assert tip.still
        assert cantilever.deviation(tip, gamma)[0] < COARSE_BOUND
    wrong = cantilever.simulate(kind, 10.0, 20, 4, rigidity=1.05)
    assert cantilever.deviation(wrong, 10.0)[0] > COARSE_BOUND
    alone = cantilever.simulate(kind, 10.0, 20, 4, hinges="independent")
    assert cantilever.deviation(alone, 10.0)[0] > COARSE_BOUND


def test_peirce_recovers_the_rigidity(monkeypatch: pytest.MonkeyPatch) -> None:
    peirce, elastica = module("peirce"), module("elastica")
    monkeypatch.setitem(peirce.MESHES, "equilateral", (20, 12))
    density, rigidity = peirce.FABRICS["medium"]
    length = peirce.search("equilateral", density, rigidity).length
    exact = elastica.gamma_of_slope(np.tan(np.radians(elastica.PEIRCE_ANGLE)))
    recovered = density * peirce.GRAVITY * length**3 / exact
    assert recovered == pytest.approx(rigidity, rel=peirce.BOUND / 100)
    assert recovered != pytest.approx(1.1 * rigidity, rel=peirce.BOUND / 100)


def test_ring_loop_against_the_elastica(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, elastica = module("loop"), module("elastica")
    for name, value in (("CELLS", 40), ("ACROSS", 8), ("STEPS", 40)):
        monkeypatch.setattr(loop, name, value)
    height = loop.simulate("ring", 100.0).height
    assert height == pytest.approx(elastica.loop(0.0, 12.5).y[-1] / 2, rel=loop.BOUND / 100)
    assert height != pytest.approx(elastica.loop(0.0, 20.0).y[-1] / 2, rel=loop.BOUND / 100)


def test_shadow_of_a_flat_disc_is_the_whole_disc() -> None:
    drape = module("drape")
    cloth = drape.disc()
    # The rim is a polygon of 112 corners: 0.05 % less than the circle; pixels: a tenth of that.
    assert drape.coefficient(cloth, cloth.mesh.vertices) == pytest.approx(100.0, abs=0.2)
    hanging = cloth.mesh.vertices.copy()
    radius = np.hypot(hanging[:, 0], hanging[:, 2])
    hanging *= np.minimum(1.0, cloth.pedestal / radius)[:, None]
    assert drape.coefficient(cloth, hanging) == pytest.approx(0.0, abs=0.2)
    waves = cloth.mesh.vertices * (1.0 + 0.05 * np.cos(6 * np.arctan2(hanging[:, 2], hanging[:, 0])))[:, None]
    assert drape.nodes(cloth, waves) == 6


def test_committed_tables_are_those_of_the_targets() -> None:
    tables, targets = module("tables"), module("targets")
    with tables.TARGETS.open(encoding="utf-8", newline="") as file:
        kept = list(csv.reader(file))
    assert kept[0] == list(targets.NAMES)
    for row, made in zip(kept[1:], targets.rows(), strict=True):
        assert row[:4] == [tables.cell(value) for value in made[:4]]
        assert float(row[4]) == pytest.approx(float(made[4]), rel=1e-5)
        assert row[10], "a target without a source"
    with tables.RESULTS.open(encoding="utf-8", newline="") as file:
        results = list(csv.DictReader(file))
    assert {row["test"] for row in results} == {row[0] for row in kept[1:]}
    claims = [row for row in results if row["bound"]]
    assert claims
    assert all(float(row["deviation"]) <= float(row["bound"]) for row in claims)
