"""Figures 4.8 to 4.12 of ``clothsim reproduce``: the figure of capsules, its garments, what bending leaves behind."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clothsim as cs
from clothsim._cli import main
from clothsim.errors import InvalidInput
from clothsim.reproduce import Effort, figure_4_9, figure_4_12, mannequin, reproduce, residual
from clothsim.reproduce.figure_4_8 import FABRICS

ROUNDING = 1e-12


def rows(path: Path) -> list[dict[str, str]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


# The figure of capsules ---------------------------------------------------------------------------------------------


def bones(pose: mannequin.Pose) -> dict[str, Any]:
    return mannequin._bones(pose)


def ends(bone: Any) -> tuple[Any, Any]:
    """Upper and lower end of a capsule's axis."""
    middle, rotation, _, half = bone
    return middle + half * rotation[:, 1], middle - half * rotation[:, 1]


@pytest.mark.parametrize("pose", [mannequin.Walk()(t) for t in (0.0, 1.0, 1.7, 2.4)] + [mannequin.seated(0.7)])
def test_limbs_hang_together(pose: mannequin.Pose) -> None:
    b = bones(pose)
    for side in ("left", "right"):
        for upper, lower in (("thigh", "shank"), ("arm", "forearm")):
            gap = ends(b[f"{side} {upper}"])[1] - ends(b[f"{side} {lower}"])[0]
            assert np.linalg.norm(gap) < ROUNDING
    for _, rotation, _, _ in b.values():
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=ROUNDING)


def test_knees_bend_backward_and_hips_forward() -> None:
    b = bones(mannequin.seated(0.8))
    hip, knee = ends(b["left thigh"])
    ankle = ends(b["left shank"])[1]
    assert knee[2] > hip[2] + 0.3
    assert ankle[1] < knee[1] - 0.3


def test_feet_stay_while_sitting_down() -> None:
    places = [ends(bones(mannequin.seated(bend))["left shank"])[1] for bend in (0.0, 0.3, 0.8)]
    slip = 2e-3  # the legs point a little outward, which the height of the hips leaves out
    assert all(np.linalg.norm(place - places[0]) < slip for place in places)


def test_a_walk_starts_at_rest_and_repeats() -> None:
    walk = mannequin.Walk()
    assert walk(0.0) == replace(walk(walk.start), pelvis=walk(0.0).pelvis)
    late = walk.start + walk.rise + 0.3
    assert np.allclose(walk(late).hip, walk(late + walk.period).hip, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.4, 2.9])
def test_axis_and_angle_make_the_rotation(angle: float) -> None:
    wanted = mannequin._turn(1, 0.7).T @ mannequin._turn(0, angle) @ mannequin._turn(1, 0.7)
    found = mannequin._axis_angle(wanted)
    axis, turn = np.array(found["axis"]), found["angle"]
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    assert np.allclose(np.eye(3) + np.sin(turn) * cross + (1 - np.cos(turn)) * cross @ cross, wanted, atol=1e-9)


@pytest.mark.parametrize("make", [lambda: mannequin.skirt(36, 8), lambda: mannequin.trousers(28)])
def test_garments_are_manifold_and_point_outward(make: Any) -> None:
    mesh, waist = make()
    edges = np.sort(np.concatenate([mesh.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    assert len(cs.collision.self_intersections(mesh.vertices, mesh.triangles)) == 0
    assert np.ptp(mesh.vertices[waist][:, 1]) < ROUNDING
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    top = (a + b + c)[:, 1] / 3 > mesh.vertices[:, 1].max() - 0.05
    assert np.all(np.einsum("ij,ij->i", normal, a)[top] > 0.0)


# What is left -------------------------------------------------------------------------------------------------------


def test_dihedral_angles_of_a_folded_strip() -> None:
    angle = 0.6
    x = np.array([[0, 0, 0], [0, 1, 0], [1, 0.5, 0], [-np.cos(angle), 0.5, np.sin(angle)]])
    hinges = residual.interior_edges(np.array([[0, 2, 1], [0, 1, 3]]))
    assert hinges.shape == (1, 4)
    assert abs(residual.dihedrals(x, hinges)[0]) == pytest.approx(angle, abs=ROUNDING)
    flat = cs.Mesh.grid(1.0, 1.0, 4, 4)
    inner = residual.interior_edges(flat.triangles)
    assert len(inner) == 18 * 3 // 2 - 12 // 2
    assert np.abs(residual.dihedrals(flat.vertices, inner)).max() < ROUNDING


def planted(mean: float, bent: float, intersections: int = 0) -> residual.Run:
    return residual.Run(
        [], [], np.zeros((0, 3)), np.array([mean]), np.array([bent]), bent, 0.0, intersections, 0, 1, 0.0
    )


def test_checks_see_a_wrong_order() -> None:
    def failed(*runs: residual.Run) -> list[str]:
        named = {str(k): run for k, run in enumerate(runs)}
        return [check.what for check in residual.checks(named, "planted") if not check.passed]

    assert failed(planted(0, 0.1), planted(1, 0.2), planted(2, 0.3)) == []
    assert failed(planted(0, 0.1), planted(2, 0.2), planted(1, 0.3)) == ["residual curvature grows with λ"]
    assert failed(planted(0, 0.4), planted(1, 0.2)) == ["with hysteresis the cloth is left farther from its start"]
    assert failed(planted(0.1, 0.1), planted(1, 0.2)) == ["rest curvature without plasticity [1/m]"]
    assert failed(planted(0, 0.1), planted(1, 0.2, 3)) == ["pairs of triangles that intersect at the end"]


def test_what_repeats_is_not_unsteady() -> None:
    cycles, frames = 4, 25
    phase = np.arange(cycles * frames) * 2 * np.pi / frames
    steady = np.repeat(np.sin(phase)[:, None, None], 3, axis=2)
    weights = np.ones(1)
    assert figure_4_12._unsteady(steady, cycles, weights) < ROUNDING
    wandering = steady + np.repeat(np.arange(float(cycles)), frames)[:, None, None]
    spread = np.sqrt(3 * np.var(np.arange(cycles), ddof=1))
    assert figure_4_12._unsteady(wandering, cycles, weights) == pytest.approx(spread, rel=1e-9)


# A mesh of one's own ------------------------------------------------------------------------------------------------


def test_figure_4_9_takes_any_mesh(tmp_path: Path) -> None:
    cs.Mesh.sphere(3.0, 2).save(tmp_path / "ball.ply")
    outcome = reproduce("4.9", tmp_path / "out", Effort(quick=True, mesh=tmp_path / "ball.ply"))
    head = (tmp_path / "out" / "figure-4.9.csv").read_text()
    assert f"--mesh {tmp_path / 'ball.ply'}" in head
    assert "# triangles: 320" in head
    table = rows(tmp_path / "out" / "figure-4.9.csv")
    assert [row["law"] for row in table] == list(FABRICS)
    means = [float(row["mean rest curvature [1/m]"]) for row in table]
    assert means == sorted(means)
    assert means[0] == 0.0
    assert outcome.files


def test_a_mesh_where_none_is_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InvalidInput, match="figure 4.8 has its own"):
        reproduce("4.8", tmp_path / "out", Effort(quick=True, mesh=tmp_path / "box.ply"))
    assert main(["reproduce", "4.9", "-o", str(tmp_path / "out"), "--quick", "--mesh", str(tmp_path / "no.ply")]) == 2
    assert "no.ply" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_generated_body_is_closed() -> None:
    body = figure_4_9.body(2)
    assert len(residual.interior_edges(body.triangles)) == 3 * len(body.triangles) // 2
    assert len(cs.collision.self_intersections(body.vertices, body.triangles)) == 0
