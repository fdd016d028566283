"""What views compute from frames: strain, contact, speed; what recordings keep for it; how pages pack it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from view_runs import falling

import clothsim as cs
from clothsim._progress import progress_bar
from clothsim._run.job import Job
from clothsim._run.start import Start
from clothsim._view.colours import MAPS, colour_map, nice_ceiling, table
from clothsim._view.fields import REACH, Fields, principal_strain
from clothsim._view.pack import pack, residuals, restored, rigid_motion
from clothsim.recording import flattened


def turned(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moved rigidly, at a fixed angle to all axes."""
    q, _ = np.linalg.qr(np.array([[1.0, 2, 3], [0, 1, 4], [5, 6, 0]]))
    return np.asarray(x @ q.T + [1.0, -2.0, 0.5])


@pytest.mark.parametrize(("gradient", "largest"), [
    (np.diag([1.1, 0.0, 0.95]), 0.1),
    (np.diag([0.97, 0.0, 0.9]), -0.03),
    (np.array([[1.0, 0, 0.2], [0, 0, 0], [0, 0, 1.0]]), 0.5 * 0.2 + np.sqrt(1 + 0.25 * 0.04) - 1),  # simple shear
])  # fmt: skip
def test_strain_is_that_of_a_known_deformation(gradient: NDArray[np.float64], largest: float) -> None:
    sheet = cs.Mesh.grid(2.0, 1.0, 5, 4)
    rest = flattened(np.array(sheet.vertices), sheet.triangles)
    got = principal_strain(turned(sheet.vertices @ gradient.T), sheet.triangles, rest)
    np.testing.assert_allclose(got, largest, atol=1e-12)
    uv = principal_strain(turned(sheet.vertices @ gradient.T), sheet.triangles, np.array(sheet.uv))
    np.testing.assert_allclose(uv, largest, atol=1e-12)
    # The comparison sees a corner that is off by a thousandth of an edge.
    moved = np.array(sheet.vertices @ gradient.T)
    moved[0, 0] += 5e-4
    assert np.abs(principal_strain(moved, sheet.triangles, rest) - largest).max() > 1e-5


def test_strain_of_a_stretched_start_is_against_the_undeformed_shape() -> None:
    sheet = cs.Mesh.grid(1.0, 1.0, 4, 4)
    moving = np.stack([sheet.vertices * 1.2, sheet.vertices * 1.3])
    for rest, expected in (("uv", [0.2, 0.3]), ("start", [0.0, 1.3 / 1.2 - 1]), (None, [0.0, 1.3 / 1.2 - 1])):
        body = cs.Body("a", "cloth", 16, sheet.triangles, sheet.uv, rest=rest)  # type: ignore[arg-type]
        fields = Fields(cs.Recording([body], np.arange(2) / 10, moving))
        for frame in (0, 1):
            np.testing.assert_allclose(fields.strain(body, frame), expected[frame], atol=1e-12)
        assert ("first frame" in fields.strain_since) == (rest is None)


def test_contact_is_within_the_distance_and_of_the_right_kind() -> None:
    frames = falling()
    fields = Fields(frames)
    assert fields.reach == pytest.approx(REACH * 0.01)
    touches = fields.contact(0)
    assert list(touches) == ["low", "high </script>"]
    assert all((t == 1).all() for t in touches.values()), "1 cm apart, 1.25 cm reach"
    assert all((t == 0).all() for t in Fields(frames, 0.009).contact(0).values())
    sheet, ball = cs.Mesh.grid(1.0, 1.0, 9, 9), cs.Mesh.sphere(0.3, 3)
    x = np.concatenate([sheet.vertices + [0, 0.304, 0], ball.vertices])
    bodies = [cs.Body("a", "cloth", 81, sheet.triangles), cs.Body("b", "collider", len(ball.vertices), ball.triangles)]
    found = Fields(cs.Recording(bodies, np.zeros(1), x[None], thickness=0.004)).contact(0)["a"]
    # The oracle: each pair by brute force, collider on collider left out.
    triangles = np.concatenate([sheet.triangles, ball.triangles + 81])
    brute = cs.collision.detect(x, x, triangles, "brute", "discrete", REACH * 0.004)
    near = np.zeros(len(x), bool)
    for vertex, triangle in brute.vertex_triangle:
        corners = triangles[triangle]
        if (vertex < 81) != (corners[0] < 81):
            near[[vertex, *corners]] = True
    for a, b, c, d in brute.edge_edge:
        if (a < 81) != (c < 81):
            near[[a, b, c, d]] = True
    assert 0 < near[:81].sum() < 20
    np.testing.assert_array_equal(found, np.where(near[:81], 2, 0))


def test_speed_is_kept_or_the_difference_of_frames() -> None:
    frames = falling()
    fields = Fields(frames)
    body = frames.cloth[0]
    for frame in (0, 3, 6):
        np.testing.assert_allclose(fields.speed(body, frame), 2.0, atol=1e-12)  # 0.1 m in 1/20 s
    kept = cs.Recording([body], np.arange(2) / 10, np.zeros((2, 36, 3)), velocities=np.full((2, 36, 3), 3.0))
    np.testing.assert_allclose(Fields(kept).speed(body, 1), 27**0.5)
    alone = cs.Recording([body], np.zeros(1), np.zeros((1, 36, 3)))
    assert not Fields(alone).speed(body, 0).any()


def test_ranges_are_round_and_hold_the_values() -> None:
    fields = Fields(falling())
    assert fields.span("speed") == (0.0, 2.0)
    assert fields.span("height") == pytest.approx((0.4, 1.01))
    assert fields.span("strain") == (0.0, 0.0001)
    assert [nice_ceiling(v) for v in (0.0, 0.011, 1.0, 7.3, 95.0)] == [1.0, 0.015, 1.0, 8.0, 100.0]


def test_recordings_keep_thickness_and_rest_shape(tmp_path: Path) -> None:
    frames = falling()
    own = flattened(np.array(cs.Mesh.grid(2.0, 1.0, 6, 6).vertices), frames.bodies[0].triangles)
    bodies = [frames.bodies[0], cs.Body("b", "cloth", 36, frames.bodies[1].triangles, rest=own)]
    made = cs.Recording(bodies, np.zeros(1), np.zeros((1, 72, 3)), thickness=0.02)
    made.save(tmp_path / "a.npz")
    read = cs.Recording.load(tmp_path / "a.npz")
    assert read.thickness == 0.02
    assert read.bodies[0].rest == "uv"
    np.testing.assert_array_equal(read.rest("b"), own)
    np.testing.assert_array_equal(read.rest("low"), frames.bodies[0].uv)
    assert falling().rest("ball") is None
    # Frames that were written before these were kept.
    with np.load(tmp_path / "a.npz") as data:
        arrays = dict(data)
    meta = json.loads(str(arrays["meta"]))
    del meta["thickness"], arrays["rest_1"]
    for entry in meta["bodies"]:
        del entry["rest"]
    np.savez(tmp_path / "old.npz", **{**arrays, "meta": np.array(json.dumps(meta))})
    old = cs.Recording.load(tmp_path / "old.npz")
    assert old.thickness is None
    assert old.rest("low") is None


def test_a_run_that_goes_on_from_a_frame_knows_the_undeformed_shape(tmp_path: Path) -> None:
    scene = cs.Scene(duration=0.2, gravity=[0, -200, 0], output={"fps": 20, "usd": False, "film_strip": False})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0, 5]}], rotation={
        "axis": [1, 0, 0], "angle": 1.5,
    })  # fmt: skip
    Job(scene, tmp_path / "a", progress=False).run()
    first = cs.Recording.load(tmp_path / "a" / "frames.npz")
    assert (first.bodies[0].rest, first.thickness) == ("start", None)
    Job(scene, tmp_path / "b", progress=False, start=Start.of(first, scene, 2)).run()
    second = cs.Recording.load(tmp_path / "b" / "frames.npz")
    name = first.bodies[0].name
    np.testing.assert_array_equal(second.rest(name), first.rest(name))
    one, two = (Fields(r).strain(r.bodies[0], frame) for r, frame in ((first, 2), (second, 0)))
    assert one.max() > 1e-3
    np.testing.assert_allclose(one, two, atol=1e-12)


# Pages ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frames", [1, 2, 3, 9])
def test_packed_numbers_come_back(frames: int) -> None:
    rows = np.random.default_rng(7).integers(0, 65536, (frames, 13, 3)).astype(np.uint16)
    rows[:, 0] = [0, 65535, 32768]
    planes = residuals(rows)
    assert planes.shape == (frames, 3, 2, 13)
    np.testing.assert_array_equal(restored(planes), rows)
    planes[0, 1, 0, 4] ^= 1
    assert not np.array_equal(restored(planes), rows), "a flipped bit is seen"


def test_smooth_motion_packs_to_small_numbers() -> None:
    k = np.arange(20)[:, None, None]
    rows = (1000 + 7 * np.arange(50)[None, :, None] + 3 * k + k * k + np.zeros((1, 1, 3))).astype(np.uint16)
    assert residuals(rows)[2:, :, :, 1:].max() == 0, "steady acceleration of a plane leaves nothing"


def test_rigid_motion_is_recognised() -> None:
    ball = cs.Mesh.sphere(0.4, 2).vertices
    rotation, shift, error = rigid_motion(np.array(ball), turned(ball))
    np.testing.assert_allclose(ball @ rotation.T + shift, turned(ball), atol=1e-12)
    assert error < 1e-12
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert rigid_motion(np.array(ball), turned(ball * [1, 1, 1.01]))[2] > 1e-3
    assert rigid_motion(np.array(ball), ball * [1, 1, -1])[2] > 0.1, "a mirror image is no rigid motion"


def test_a_rigid_collider_is_a_matrix_per_frame() -> None:
    frames = falling()
    packed = pack(frames, [0, 3, 6], Fields(frames), bar=progress_bar(9, enabled=False))
    low, _, ball, post = packed.header["bodies"]
    assert (low["count"], ball["count"], post["count"]) == (3, 1, 1)
    assert "motion" in ball
    assert "motion" not in post
    assert set(low["values"]) == {"strain", "contact", "speed"}
    assert [m["name"] for m in packed.header["maps"]] == ["strain", "contact", "speed", "height"]
    assert packed.precision <= 0.5 * 0.2 / 400 * 1.5  # half of a 400th of the typical edge, 0.2 m to 0.28 m


def test_colour_maps_are_found_and_the_nearest_is_named() -> None:
    assert colour_map("strain") is MAPS["strain"]
    with pytest.raises(cs.InvalidInput, match=r'--color: expected one of none, strain, .* \(did you mean "strain"\?\)'):
        colour_map("strian")
    assert table(MAPS["speed"]).shape == (256, 3)
    assert table(MAPS["speed"], 3)[0].tolist() == [0xEE, 0xF2, 0xEE]
