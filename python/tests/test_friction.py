"""Friction laws alone, published pairs, and friction and strain limits in scenes."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs

STIFF = {"mu_c": 0.1, "mu_s": 0.2}
SMOOTH = {**STIFF, "v_s": 0.4, "delta_s": 0.2}
FULL = {**SMOOTH, "f_v": 3.0, "delta_v": 1.5}
LAWS: dict[str, dict[str, float]] = {
    "coulomb": {"mu_c": 0.1}, "coulomb-stiction": STIFF, "stribeck": SMOOTH, "viscous": FULL,
}  # fmt: skip
# A handful of roundings.
ROUNDING = 1e-14


def kinetic(law: str, normal: float, speed: float, area: float) -> float:
    """Equation 7.7, by hand."""
    c = {"mu_s": 0.0, "v_s": 1.0, "delta_s": 1.0, "f_v": 0.0, "delta_v": 1.0, **LAWS[law]}
    force = c["mu_c"] * normal
    if law in ("stribeck", "viscous"):
        force += (c["mu_s"] - c["mu_c"]) * normal * math.exp(-((speed / c["v_s"]) ** c["delta_s"]))
    return force + (area * c["f_v"] * speed ** c["delta_v"] if law == "viscous" else 0.0)


@pytest.mark.parametrize("law", LAWS)
def test_sliding_friction_is_equation_7_7_against_the_velocity(law: str) -> None:
    rng = np.random.default_rng(7)
    v = rng.normal(size=(50, 3))
    normal, area = rng.uniform(0.1, 5.0, 50), rng.uniform(0.0, 2.0, 50)
    force = cs.friction.force(law, normal, v, rng.normal(size=(50, 3)), area=area, **LAWS[law])
    speed = np.linalg.norm(v, axis=1)
    expected = np.array([kinetic(law, n, s, a) for n, s, a in zip(normal, speed, area, strict=True)])
    np.testing.assert_allclose(force, -v * (expected / speed)[:, None], rtol=ROUNDING, atol=0.0)
    faulty = -v * (1.0001 * expected / speed)[:, None]
    assert np.abs(force - faulty).max() > 1e-6, "the comparison sees a difference"


@pytest.mark.parametrize("law", LAWS)
def test_at_rest_the_pull_is_met_up_to_the_threshold(law: str) -> None:
    threshold = 10.0 * LAWS[law].get("mu_s", LAWS[law]["mu_c"])
    assert cs.friction.force(law, 10.0, 0.0, 0.99 * threshold, **LAWS[law]) == -0.99 * threshold
    beyond = cs.friction.force(law, 10.0, [[0.0, 0.0]], [[30.0, 40.0]], **LAWS[law])
    np.testing.assert_allclose(beyond, [[-0.6 * threshold, -0.8 * threshold]], rtol=ROUNDING)
    # Sliding, the pull does not matter.
    moving = [cs.friction.force(law, 10.0, 0.5, pull, **LAWS[law]) for pull in (-3.0, 0.0, 3.0)]
    assert moving[0] == moving[1] == moving[2] < 0.0


def test_the_force_has_the_shape_of_the_velocity() -> None:
    def of(normal: Any, v: Any, pull: Any = 0.0, **keys: Any) -> Any:
        return cs.friction.force("coulomb", normal, v, pull, mu_c=0.5, **keys)

    assert isinstance(of(1.0, 2.0), float) and of(1.0, 2.0) == -0.5
    assert of(1.0, [3.0, 4.0]).tolist() == pytest.approx([-0.3, -0.4])
    assert of(1.0, [0.0, 3.0, 4.0]).shape == (3,)
    assert of(1.0, np.ones((6, 2))).shape == (6, 2)
    assert of(np.ones(6), np.ones((6, 3))).shape == (6, 3)
    assert of(np.ones((4, 1)), np.ones((6, 3))).shape == (4, 6, 3)
    assert of(np.arange(3.0), [2.0, 0.0]).tolist() == [[0.0, 0.0], [-0.5, 0.0], [-1.0, 0.0]]
    assert of(1.0, np.linspace(0.1, 1.0, 5)[:, None]).shape == (5, 1)
    assert of(1.0, np.zeros((5, 3)), [0.1, 0.0, 0.0]).tolist() == [[-0.1, 0.0, 0.0]] * 5
    assert of([1.0, 2.0], 2.0).tolist() == [-0.5, -1.0]
    assert of(1.0, np.zeros((0, 3))).shape == (0, 3)
    # No component of one axis strays into another.
    assert of(1.0, [[0.0, 2.0, 0.0]]).tolist() == [[0.0, -0.5, 0.0]]


@pytest.mark.parametrize(
    ("arguments", "name", "words"),
    [
        ({"model": "stribek"}, "model", 'did you mean "stribeck"'),
        ({"model": "coulomb", "mu_c": -0.1}, "mu_c", "≥ 0, got -0.1"),
        ({"model": "coulomb"}, "mu_c", "got nothing"),
        ({"model": "coulomb", **STIFF}, "mu_s", "reads mu_c"),
        ({"model": "coulomb-stiction", "mu_c": 0.2, "mu_s": 0.1}, "mu_s", "≥ mu_c = 0.2, got 0.1"),
        ({"model": "coulomb-stiction", **SMOOTH}, "v_s", "reads mu_c, mu_s"),
        ({"model": "stribeck", **SMOOTH, "v_s": 0.0}, "v_s", "> 0 m/s, got 0"),
        ({"model": "stribeck", **SMOOTH, "delta_s": 0.0}, "delta_s", r"\(0, 2\], got 0"),
        ({"model": "stribeck", **SMOOTH, "delta_s": 2.5}, "delta_s", r"\(0, 2\], got 2.5"),
        ({"model": "stribeck", **FULL}, "f_v", "delta_s, got 3"),
        ({"model": "viscous", **FULL, "f_v": -1.0}, "f_v", "≥ 0, got -1"),
        ({"model": "viscous", **FULL, "delta_v": 0.0}, "delta_v", r"\(0, 2\]"),
        ({"model": "viscous", **FULL, "mu_c": math.nan}, "mu_c", "finite"),
        ({"model": "viscous", **SMOOTH}, "f_v", "got nothing"),
        ({"model": "coulomb", "mu_c": True}, "mu_c", "a number"),
        ({"mu_c": 0.1, "normal_force": -1.0}, "normal_force", r"≥ 0 \[N\], got -1.0"),
        ({"mu_c": 0.1, "normal_force": [1.0, math.nan]}, "normal_force", r"nan at \[1\]"),
        ({"mu_c": 0.1, "area": -1.0}, "area", "m²"),
        ({"mu_c": 0.1, "tangential_velocity": [[0.0, math.inf]]}, "tangential_velocity", "inf"),
        ({"mu_c": 0.1, "tangential_velocity": np.ones(7)}, "tangential_velocity", r"shape \(n, 1\)"),
        ({"mu_c": 0.1, "tangential_velocity": [1.0, 2.0], "applied_force": [1.0, 2.0, 3.0]}, "applied_force", "2 comp"),
        (
            {"mu_c": 0.1, "normal_force": np.ones(3), "tangential_velocity": np.ones((2, 3))},
            "normal_force",
            "broadcast",
        ),
    ],
)
def test_what_is_no_law_is_named(arguments: dict[str, Any], name: str, words: str) -> None:
    given = {"model": "coulomb", "normal_force": 1.0, "tangential_velocity": 1.0, "applied_force": 0.0, **arguments}
    with pytest.raises(cs.InvalidInput, match=f"^{name}: expected .*{words}") as caught:
        cs.friction.force(**given)
    assert caught.value.name == name


def test_other_threads_go_on_meanwhile() -> None:
    v = np.ones((1_000_000, 3))
    ticks: list[float] = []
    done = threading.Event()

    def count() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    worker = threading.Thread(target=count)
    worker.start()
    try:
        before = len(ticks)
        for _ in range(5):
            cs.friction.force("viscous", 1.0, v, **FULL)
        assert len(ticks) > before
    finally:
        done.set()
        worker.join()


def test_pairs_have_values_and_sources() -> None:
    pairs = cs.friction.pairs
    assert pairs.names() == sorted(pairs) and len(pairs) == len(pairs.names()) > 5
    sources = pairs.sources()
    bibliography = (Path(__file__).parents[2] / "REFERENCES.bib").read_text()
    kinds = set()
    for name, pair in pairs.items():
        assert pair.name == name and pair.about
        assert 0.0 < float(pair.kinetic) <= float(pair.static), name
        for coefficient in (pair.static, pair.kinetic):
            kinds.add(coefficient.kind)
            assert coefficient.note and coefficient.is_estimate == (coefficient.source == "")
            if coefficient.source:
                assert coefficient.source in sources and f"{{{coefficient.source}," in bibliography
    assert kinds == {"published", "second-hand", "estimate"}
    with pytest.raises(KeyError, match='did you mean "cotton-cotton"'):
        pairs["coton-cotton"]
    assert "cotton" not in pairs and pairs.get("cotton") is None
    skin = pairs["cotton-skin-forearm"]
    assert cs.friction.force("coulomb-stiction", 2.0, 1.0, **skin.coefficients) == -2.0 * skin.kinetic.value


STICKY = {"law": "coulomb-stiction", "mu_c": 0.1, "mu_s": 0.3}

# In scenes -----------------------------------------------------------------------------------------------------------

CONTACT = {
    "thickness": 0.003, "friction": {"law": "viscous", **FULL}, "self_friction": 0.25,
    "pairs": [
        {"between": ["shirt", "ball"], "friction": {"law": "stribeck", **SMOOTH}},
        {"between": ["shirt", "shirt"], "friction": {"pair": "cotton-cotton"}},
        {"between": ["skirt", "shirt"], "friction": 0.05},
    ],
}  # fmt: skip


def sheet(name: str, height: float, **keys: Any) -> dict[str, Any]:
    mesh = {"generator": "grid", "width": 0.4, "height": 0.4, "nx": 5, "ny": 5}
    return {"name": name, "mesh": mesh, "material": "cotton", "position": [0.0, height, 0.0], **keys}


def scene(**contact: Any) -> cs.Scene:
    ball = {"type": "sphere", "radius": 0.1, "tolerance": 0.01}
    return cs.Scene(
        contact={**CONTACT, **contact},
        cloth=[sheet("shirt", 0.2, strain_limit=0.1), sheet("skirt", 0.4, self_friction=cs.friction.pairs["silk-silk"]),
               sheet("scarf", 0.6, friction={"law": "coulomb", "mu_c": 0.4}, self_friction=0.1)],
        collider=[{"name": "ball", "shape": ball},
                  {"name": "post", "shape": ball, "position": [3.0, 0.0, 0.0], "friction": 0.6}],
    )  # fmt: skip


def test_friction_survives_files(tmp_path: Path) -> None:
    made = scene()
    made.save(tmp_path / "a.toml")
    loaded = cs.Scene.load(tmp_path / "a.toml")
    assert loaded.to_dict() == made.to_dict()
    tables = loaded.to_dict()
    assert tables["contact"]["friction"] == {"law": "viscous", **FULL}
    assert tables["contact"]["pairs"][1] == {"between": ["shirt", "shirt"], "friction": {"pair": "cotton-cotton"}}
    assert tables["cloth"][0]["strain_limit"] == 0.1
    assert tables["cloth"][1]["self_friction"] == {"pair": "silk-silk"}
    assert tables["contact"]["method"] == "velocity-filter"
    other = scene(friction=0.3)
    assert other.to_dict() != made.to_dict(), "the comparison sees a difference"


def test_the_plan_names_each_law_and_who_asks_for_it() -> None:
    effects = {e["name"]: e for e in cs.Simulation(scene()).plan["effects"]}
    # 3 self, 3 cloth on cloth, 3 with each collider.
    assert effects["friction"]["on"] and effects["friction"]["elements"] == 12
    counts = {law: effects[f"friction {law}"]["elements"] for law in cs.friction.LAWS}
    # Coulomb: scarf on all but the post, skirt on shirt, all on the post. Stiction: shirt alone, skirt alone.
    assert counts == {"coulomb": 8, "coulomb-stiction": 2, "stribeck": 1, "viscous": 1}
    assert "contact.pairs[0].friction" in effects["friction stribeck"]["why"]
    assert "self-contact: cloth[1].self_friction" in effects["friction coulomb-stiction"]["why"]
    assert effects["friction viscous"]["why"] == "colliders: contact.friction"
    assert effects["strain limit"]["on"] and effects["strain limit"]["elements"] == 56
    assert not effects["contact constraints"]["on"]

    plain = cs.Scene(contact={}, cloth=[sheet("shirt", 0.2)], collider=scene().to_dict()["collider"][:1])
    effects = {e["name"]: e for e in cs.Simulation(plain).plan["effects"]}
    assert effects["friction coulomb"]["on"]
    for law in cs.friction.LAWS[1:]:
        assert not effects[f"friction {law}"]["on"] and effects[f"friction {law}"]["bytes"] == 0
        assert law in effects[f"friction {law}"]["why"]
    assert not effects["strain limit"]["on"]


def test_the_report_counts_what_sticks_and_slides() -> None:
    def counts(friction: Any) -> tuple[int, int]:
        made = cs.Scene(
            time={"dt": 0.002}, contact={"thickness": 0.004, "friction": friction},
            cloth=[sheet("card", 0.0041)],
            collider=[{"name": "table", "shape": {"type": "plane", "half_size": 1.0}}],
            gravity=[1.96, -9.81, 0.0],
        )  # fmt: skip
        sim = cs.Simulation(made)
        for _ in range(50):
            report = sim.step()
        return report["contact"]["sticking"], report["contact"]["sliding"]

    stuck, slid = counts(0.3), counts({"law": "coulomb-stiction", "mu_c": 0.05, "mu_s": 0.1})
    assert stuck[0] > 0 and stuck[1] == 0
    assert slid[0] == 0 and slid[1] > 0


def test_the_contact_method_is_a_choice_of_the_scene() -> None:
    def card(**keys: Any) -> cs.Scene:
        return cs.Scene(
            contact={"thickness": 0.004, "friction": STICKY, "method": "constraints"}, cloth=[sheet("card", 0.004)],
            collider=[{"name": "table", "shape": {"type": "plane", "half_size": 1.0}}], gravity=[1.96, -9.81, 0.0],
            **keys,
        )  # fmt: skip

    sim = cs.Simulation(card(time={"dt": 0.005}))
    effects = {e["name"]: e for e in sim.plan["effects"]}
    assert effects["contact constraints"]["on"] and effects["friction coulomb-stiction"]["on"]
    before = sim.positions
    for _ in range(20):
        sim.step()
    assert np.abs(sim.positions - before)[:, [0, 2]].max() < 1e-6, "it sticks: 1.96 < 0.3 · 9.81"
    weight = sim.masses.sum() * np.array([1.96, -9.81, 0.0])
    np.testing.assert_allclose(sim.contact_forces.sum(axis=0), -weight, atol=1e-3 * float(np.linalg.norm(weight)))
    with pytest.raises(cs.InvalidScene, match="contact.method") as caught:
        card(time={"integrator": "rk4"})
    assert caught.value.key == "contact.method"


def test_set_friction_adds_and_replaces() -> None:
    made = cs.Scene(contact={})
    made.add_cloth(cs.Mesh.grid(0.4, 0.4, 5, 5), position=(0.0, 0.3, 0.0))
    made.add_collider("ball", shape={"type": "sphere", "radius": 0.1, "tolerance": 0.01})
    made.set_friction("cloth", "ball", 0.5)
    made.set_friction("ball", "cloth", cs.friction.pairs["denim-denim"])
    assert made.to_dict()["contact"]["pairs"] == [{"between": ["ball", "cloth"], "friction": {"pair": "denim-denim"}}]
    before = made.to_dict()
    with pytest.raises(cs.InvalidScene, match=r'between\[1\]: .*did you mean "ball"'):
        made.set_friction("cloth", "bal", 0.5)
    with pytest.raises(cs.InvalidScene, match="at least one piece of cloth"):
        made.set_friction("ball", "ball", 0.5)
    assert made.to_dict() == before
    with pytest.raises(cs.InvalidScene, match="contact: expected"):
        cs.Scene(cloth=[sheet("a", 0.0)]).set_friction("a", "a", 0.1)


@pytest.mark.parametrize(
    ("line", "key", "words"),
    [
        ("friction = -0.3", "friction", "≥ 0, got -0.3"),
        ('friction = "rough"', "friction", "a finite number or a table"),
        ('friction = { law = "viscuous", mu_c = 0.1 }', "friction.law", 'did you mean "viscous"'),
        ("friction = { mu_c = 0.1 }", "friction.law", '"coulomb-stiction"'),
        ('friction = { law = "coulomb-stiction", mu_c = 0.2, mu_s = 0.1 }', "friction.mu_s", "≥ mu_c = 0.2, got 0.1"),
        ('friction = { law = "coulomb", mu_c = -0.2 }', "friction.mu_c", "≥ 0, got -0.2"),
        ('friction = { law = "coulomb", mu_c = nan }', "friction.mu_c", "finite number"),
        ('friction = { law = "coulomb", mu_c = 0.2, mu_k = 0.1 }', "friction.mu_k", 'did you mean "mu_c"'),
        ('friction = { law = "coulomb", mu_c = 0.2, v_s = 0.1 }', "friction.v_s", "reads mu_c"),
        ('friction = { law = "stribeck", mu_c = 0.1, mu_s = 0.2, v_s = 0, delta_s = 0.2 }', "friction.v_s", "> 0 m/s"),
        ('friction = { law = "stribeck", mu_c = 0.1, mu_s = 0.2, v_s = 1, delta_s = 3 }', "friction.delta_s", "(0, 2]"),
        ('friction = { law = "stribeck", mu_c = 0.1, mu_s = 0.2, v_s = 1e9, delta_s = 1 }', "friction.v_s", "1e5 m/s"),
        ('friction = { law = "coulomb", mu_c = 1e300 }', "friction.mu_c", "at most 1e6"),
        ("strain_limit = 1e-30", "strain_limit", "at least 1e-9"),
        ('friction = { pair = "cotton-coton" }', "friction.pair", 'did you mean "cotton-cotton"'),
        ('friction = { pair = "cotton-cotton", mu_s = 0.3 }', "friction.mu_s", "no value beside pair"),
        ("strain_limit = 0", "strain_limit", "> 0, got 0"),
        ("strain_limit = -0.1", "strain_limit", "> 0, got -0.1"),
        ("strain_limit = { stretch = 0.1, compression = 1.0 }", "strain_limit.compression", "between 0 and 1"),
        ("strain_limit = { stretch = 0.0 }", "strain_limit.stretch", "> 0, got 0"),
        ("strain_limit = { compression = 0.1 }", "strain_limit.stretch", "missing"),
    ],
)
def test_bad_friction_is_named_with_its_line(tmp_path: Path, line: str, key: str, words: str) -> None:
    path = tmp_path / "bad.toml"
    mesh = 'mesh = { generator = "disc", radius = 1.0, rings = 3 }'
    head = f'duration = 1.0\n[[cloth]]\nname = "c"\nmaterial = "cotton"\n{mesh}'
    path.write_text(f"{head}\n{line}\n")
    with pytest.raises(cs.InvalidScene) as caught:
        cs.Scene.load(path)
    error = caught.value
    assert (error.key, error.line, error.file) == (f"cloth[0].{key}", 6, str(path))
    assert words in str(error), error


@pytest.mark.parametrize(
    ("contact", "key", "words"),
    [
        ({"pairs": [{"between": ["shirt", "bal"], "friction": 0.1}]}, "contact.pairs[0].between[1]", '"ball"'),
        ({"pairs": [{"between": ["post", "ball"], "friction": 0.1}]}, "contact.pairs[0].between", "piece of cloth"),
        ({"pairs": [{"between": ["shirt"], "friction": 0.1}]}, "contact.pairs[0].between", "array of 2"),
        ({"pairs": [{"between": ["shirt", "ball"]}]}, "contact.pairs[0].friction", "missing"),
        (
            {"pairs": [{"between": ["shirt", "ball"], "friction": {"law": "coulomb"}}]},
            "contact.pairs[0].friction.mu_c",
            "",
        ),
        (
            {
                "pairs": [
                    {"between": ["shirt", "ball"], "friction": 0.1},
                    {"between": ["ball", "shirt"], "friction": 0.2},
                ]
            },
            "contact.pairs[1].between",
            "contact.pairs[0]",
        ),
        ({"method": "constraint"}, "contact.method", 'did you mean "constraints"'),
        ({"self_friction": {"law": "coulomb-stiction", "mu_c": 0.2, "mu_s": 0.1}}, "contact.self_friction.mu_s", "0.1"),
    ],
)
def test_bad_pairs_are_named(contact: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(cs.InvalidScene) as caught:
        scene(**contact)
    assert caught.value.key == key and words in str(caught.value), caught.value


def test_the_page_lists_every_pair() -> None:
    page = (Path(__file__).parents[2] / "docs" / "friction.md").read_text()
    marks = {"published": "{}", "second-hand": "{}*", "estimate": "~{}"}
    for name, pair in cs.friction.pairs.items():
        static, kinetic = (marks[c.kind].format(f"{c.value:.4g}") for c in (pair.static, pair.kinetic))
        assert f"| `{name}` | {pair.about} | {static} | {kinetic} | {pair.static.source or pair.static.note}" in page, (
            name
        )
    for key, about in cs.friction.pairs.sources().items():
        assert f"- **{key}**: {about}" in page
