"""The animations of Wong 2010: frames by formula, with contact, without intersections at the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim.reproduce.animations import SETS, Animation, Listed
from clothsim.reproduce.animations.bodies import Star, capsule, cone
from clothsim.reproduce.animations.pleats import bulge

LISTED = [listed for group in SETS.values() for listed in group]
NAMES = [f"{key}-{listed.number}" for key, group in SETS.items() for listed in group]
ROUNDING = 1e-12


@pytest.fixture(params=LISTED, ids=NAMES)
def coarse(request: Any) -> Animation:
    listed: Listed = request.param
    return listed.make(quick=True)


def between(animation: Animation, pairs: Any) -> Any:
    """Pairs of triangles of which the cloth has one at least."""
    return pairs[(pairs < animation.count(cloth=True)).any(axis=1)]


def kinds(animation: Animation, found: cs.collision.Detection) -> tuple[int, int]:
    """Contacts of cloth with cloth, and of cloth with the rest."""
    vertices, triangles = animation.cloth_vertices(), animation.count(cloth=True)
    ours = [found.vertex_triangle < [vertices, triangles], found.edge_edge[:, [0, 2]] < vertices]
    return sum(int(o.all(axis=1).sum()) for o in ours), sum(int((o.sum(axis=1) == 1).sum()) for o in ours)


@pytest.mark.parametrize("listed", LISTED, ids=NAMES)
def test_sizes_are_the_papers(listed: Listed) -> None:
    animation = listed.make(quick=False)
    # Table 1 is rounded to half a thousand at the coarsest.
    assert animation.count(cloth=True) == pytest.approx(listed.cloth, abs=500.0)
    assert animation.count(cloth=False) == pytest.approx(listed.rigid, abs=500.0)
    assert animation.frames >= 60


def test_every_mesh_is_whole(coarse: Animation) -> None:
    count = int(coarse.parts[-1].vertices.stop)
    assert coarse.frame(0).shape == (count, 3)
    assert np.array_equal(np.unique(coarse.triangles), np.arange(count)), "no vertex alone"
    for part in coarse.parts:
        own = coarse.triangles[part.triangles]
        assert part.vertices.start <= own.min() <= own.max() < part.vertices.stop
        edges = np.sort(np.concatenate([own[:, [0, 1]], own[:, [1, 2]], own[:, [2, 0]]]), axis=1)
        uses = np.unique(edges, axis=0, return_counts=True)[1]
        assert uses.max() == 2
        assert (uses.min() == 2) == (not part.cloth), "bodies are closed"


def test_equal_calls_give_equal_bits(coarse: Animation) -> None:
    listed = next(item for item in LISTED if item.make(quick=True).name == coarse.name)
    again = listed.make(quick=True)
    assert np.array_equal(again.triangles, coarse.triangles)
    late = coarse.frame(40)
    for index in (0, 17, 40):
        assert np.array_equal(again.frame(index), coarse.frame(index))
    assert np.array_equal(late, coarse.frame(40)), "a frame does not depend on those before"


def test_motion_is_coherent(coarse: Animation) -> None:
    first = coarse.triangles[: coarse.count(cloth=True)]
    x = coarse.frame(0)
    edge = float(np.linalg.norm(x[first[:, 0]] - x[first[:, 1]], axis=1).mean())
    ways = [float(np.linalg.norm(b - a, axis=1)[: coarse.cloth_vertices()].max()) for a, b in coarse.steps()]
    assert len(ways) == coarse.frames - 1
    assert 0.0 < max(ways) < 0.25 * edge


def test_there_is_contact_and_at_the_start_no_intersection(coarse: Animation) -> None:
    assert len(between(coarse, cs.collision.self_intersections(coarse.frame(0), coarse.triangles))) == 0
    found = cs.collision.detect(coarse.frame(30), coarse.frame(31), coarse.triangles, thickness=coarse.thickness)
    own, other = kinds(coarse, found)
    assert own > 500
    assert other > 500


def test_a_cloth_too_low_would_be_noticed() -> None:
    animation = SETS["one"][0].make(quick=True)
    x = animation.frame(40)
    x[: animation.cloth_vertices()] -= [0.0, 2.0 * animation.thickness, 0.0]
    assert len(between(animation, cs.collision.self_intersections(x, animation.triangles))) > 0


@pytest.mark.parametrize("cells", [1, 4, 7])
def test_a_star_reaches_its_triangles(cells: int) -> None:
    star = Star.of(cells)
    assert len(star.triangles) == 12 * cells**2
    assert len(star.directions) == 6 * cells**2 + 2
    random = np.random.default_rng(cells)
    radii = random.uniform(0.9, 1.1, len(star.directions))
    points = star.directions * radii[:, None]
    corners = points[star.triangles]
    weights = random.dirichlet([1.0, 1.0, 1.0], len(corners))
    inside = np.einsum("tk,tkj->tj", weights, corners)
    away = np.linalg.norm(inside, axis=1)
    assert star.reach(radii, inside / away[:, None]) == pytest.approx(away, rel=ROUNDING)
    assert star.reach(radii, star.directions) == pytest.approx(radii, rel=ROUNDING)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.einsum("tj,tj->t", normals, inside) > 0.0), "outward"


@pytest.mark.parametrize(
    ("mesh", "count", "volume"),
    [
        (cone(32, 0.3, 0.5, 0.05), 128, np.pi * 0.3**2 * 0.5 / 3),
        (capsule(0.1, 0.2, 32, 10, 14), 2112, np.pi * 0.1**2 * (0.4 + 0.4 / 3)),
    ],
    ids=["cone", "capsule"],
)  # fmt: skip
def test_bodies_have_their_volume(mesh: Any, count: int, volume: float) -> None:
    points, triangles = mesh
    a, b, c = points[triangles].transpose(1, 0, 2)
    assert len(triangles) == count
    # Outward, and inscribed: a little less. The cone's tip is rounded off.
    assert 0.7 * volume < float(np.sum(a * np.cross(b, c)) / 6.0) < volume


def test_pleats_leave_what_is_asked_for() -> None:
    left = np.array([0.02, 0.1, 0.5])
    phase = np.linspace(0.0, np.pi, 20_001)
    for wanted, b in zip(left, bulge(left), strict=True):
        reach = np.max(phase + b * np.sin(2.0 * phase), where=phase < 0.5 * np.pi, initial=0.0)
        assert np.pi - reach == pytest.approx(wanted, abs=1e-4)
