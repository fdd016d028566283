"""A figure of capsules that stands, sits and walks, and garments that fit it; SI units, y up, facing +z.

Joint angles are curves over time; forward kinematics makes the pose of each capsule, and the poses sampled in time are
the keyframes of rigid colliders. Capsules of the figure overlap at the joints.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.scene import Scene

__all__ = [
    "HIP", "PELVIS", "THIGH", "WAIST", "Pose", "Walk", "add", "capsules", "frame", "seated", "sit", "skirt", "smooth",
    "stadium", "trousers",
]  # fmt: skip

PELVIS = (0.115, 0.055)  # radius, half length of the straight part, along x
HIP = (0.105, -0.05)  # joints, from the middle of the pelvis: aside, below
THIGH, SHANK = 0.42, 0.40  # lengths between joints
ANKLE = 0.08  # height above the sole
_RADII = {"thigh": 0.066, "shank": 0.05, "foot": 0.036, "arm": 0.042, "forearm": 0.036}
_SHOULDER = (0.185, 0.44)
_ARM, _FOREARM, _FOOT = 0.27, 0.25, 0.15
_TOLERANCE = 2e-3  # of the capsules' triangles [m]
_SAMPLES = 60.0  # keyframes per second
STANDING = ANKLE + SHANK + THIGH - HIP[1]  # height of the pelvis with straight legs
APART = 0.07  # how far the legs point outward when sitting down and standing up [rad]
WAIST = 0.045  # of garments, above the middle of the pelvis


@dataclass(frozen=True)
class Pose:
    """Joint angles [rad], left before right; flexion, which brings a limb forward or bends it, is positive.

    Attributes
    ----------
    pelvis : (float, float, float)
        Its middle [m].
    yaw, lean : float
        The pelvis's turn about y, the trunk's lean forward.
    apart : float
        By how much both legs point outward.
    hip, knee, ankle, shoulder, elbow : (float, float)
        Flexion; a knee bends backward.
    """

    pelvis: tuple[float, float, float] = (0.0, STANDING, 0.0)
    yaw: float = 0.0
    lean: float = 0.0
    apart: float = 0.0
    hip: tuple[float, float] = (0.0, 0.0)
    knee: tuple[float, float] = (0.0, 0.0)
    ankle: tuple[float, float] = (0.0, 0.0)
    shoulder: tuple[float, float] = (0.0, 0.0)
    elbow: tuple[float, float] = (0.2, 0.2)


Motion = Callable[[float], Pose]


def smooth(x: float) -> float:
    """From 0 at x ≤ 0 to 1 at x ≥ 1, with two continuous derivatives."""
    x = min(1.0, max(0.0, x))
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)


@dataclass(frozen=True)
class Walk:
    """Walking on the spot, as on a moving belt; starts from standing.

    Attributes
    ----------
    period : float
        Time of two steps [s].
    start, rise : float
        When it begins, and how long until the steps have their full length [s].
    stride : float
        Amplitude of the hips' flexion [rad].
    """

    period: float = 1.05
    start: float = 0.4
    rise: float = 1.0
    stride: float = 0.42

    def __call__(self, time: float) -> Pose:
        """The pose at a time [s]."""
        much = smooth((time - self.start) / self.rise)
        phase = 2.0 * math.pi * (time - self.start) / self.period
        left, right = phase, phase + math.pi
        hip = tuple(much * (self.stride * math.sin(p) + 0.06) for p in (left, right))
        # The knee bends while its leg swings forward, that is, while the flexion of the hip grows.
        knee = tuple(much * (0.12 + 0.95 * max(0.0, math.cos(p - 0.15)) ** 2) for p in (left, right))
        ankle = tuple(much * 0.12 * math.sin(p + 0.8) for p in (left, right))
        return Pose(
            pelvis=(
                much * 0.02 * math.cos(phase - 0.3),
                STANDING - much * (0.035 + 0.018 * math.cos(2.0 * phase)),
                0.0,
            ),
            yaw=much * 0.10 * math.sin(phase),
            lean=much * 0.04,
            hip=(hip[0], hip[1]),
            knee=(knee[0], knee[1]),
            ankle=(ankle[0], ankle[1]),
            shoulder=(-0.4 * much * math.sin(left), -0.4 * much * math.sin(right)),
            elbow=(0.2 + 0.2 * much, 0.2 + 0.2 * much),
        )


def seated(bend: float) -> Pose:
    """Between standing (0) and sitting (1); the feet stay where they are."""
    hip, knee = 1.5 * bend, 1.55 * bend
    shank = hip - knee
    lean = 0.2 * math.sin(math.pi * bend) + 0.05 * bend
    pelvis = (
        0.0,
        ANKLE + SHANK * math.cos(shank) + THIGH * math.cos(hip) - HIP[1],
        -SHANK * math.sin(shank) - THIGH * math.sin(hip),
    )
    reach = 0.5 * math.sin(math.pi * bend) + 0.6 * bend
    return Pose(
        pelvis=pelvis, lean=lean, apart=APART, hip=(hip, hip), knee=(knee, knee), ankle=(-shank, -shank),
        shoulder=(reach, reach), elbow=(0.2 + 0.3 * bend, 0.2 + 0.3 * bend),
    )  # fmt: skip


def sit(times: Sequence[float], bends: Sequence[float]) -> Motion:
    """Go smoothly from one bend to the next between ``times`` [s]."""

    def pose(time: float) -> Pose:
        bend = bends[0]
        for t0, t1, b0, b1 in zip(times, times[1:], bends, bends[1:], strict=False):
            if time >= t0:
                bend = b0 + (b1 - b0) * smooth((time - t0) / (t1 - t0))
        return seated(bend)

    return pose


# Capsules -------------------------------------------------------------------------------------------------------


def _turn(axis: int, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[j, j], matrix[j, k], matrix[k, j], matrix[k, k] = c, -s, s, c
    return matrix


def frame(pose: Pose) -> tuple[Floats, Floats]:
    """Place and rotation of the pelvis: x = place + rotation · local."""
    return np.array(pose.pelvis), _turn(1, pose.yaw)


def _bones(pose: Pose) -> dict[str, tuple[Floats, Floats, float, float]]:
    """Middle, rotation (the capsule's axis is its y), radius and half length of each capsule."""
    place, body = frame(pose)
    bones: dict[str, tuple[Floats, Floats, float, float]] = {
        "pelvis": (place, body @ _turn(2, 0.5 * math.pi), PELVIS[0], PELVIS[1])
    }
    trunk = body @ _turn(0, pose.lean)
    # The trunk leans about the hips.
    pivot = place + body @ np.array([0.0, HIP[1], 0.0])

    def on_trunk(x: float, y: float, z: float = 0.0) -> Floats:
        local: Floats = pivot + trunk @ np.array([x, y - HIP[1], z])
        return local

    bones["belly"] = (on_trunk(0.0, 0.155), trunk @ _turn(2, 0.5 * math.pi), 0.1, 0.035)
    bones["chest"] = (on_trunk(0.0, 0.31), trunk @ _turn(2, 0.5 * math.pi), 0.115, 0.055)
    bones["shoulders"] = (on_trunk(0.0, 0.42), trunk @ _turn(2, 0.5 * math.pi), 0.06, 0.125)
    bones["neck"] = (on_trunk(0.0, 0.51), trunk, 0.045, 0.04)
    bones["head"] = (on_trunk(0.0, 0.64, 0.01), trunk, 0.088, 0.03)
    for side, (name, sign) in enumerate((("left", 1.0), ("right", -1.0))):
        start = place + body @ np.array([sign * HIP[0], HIP[1], 0.0])
        angle = -pose.hip[side]
        for part, length, bend in (("thigh", THIGH, pose.knee[side]), ("shank", SHANK, 0.0)):
            rotation = body @ _turn(0, angle) @ _turn(2, sign * pose.apart)
            end = start - length * rotation[:, 1]
            bones[f"{name} {part}"] = (0.5 * (start + end), rotation, _RADII[part], 0.5 * length)
            start, angle = end, angle + bend
        rotation = body @ _turn(0, angle - pose.ankle[side] - 0.5 * math.pi)
        middle = start - (0.5 * _FOOT - 0.03) * rotation[:, 1] - 0.04 * body @ _turn(0, angle)[:, 1]
        bones[f"{name} foot"] = (middle, rotation, _RADII["foot"], 0.5 * _FOOT)
        start = on_trunk(sign * _SHOULDER[0], _SHOULDER[1])
        angle = -pose.shoulder[side]
        aside = _turn(2, sign * 0.22)
        for part, length, bend in (("arm", _ARM, pose.elbow[side]), ("forearm", _FOREARM, 0.0)):
            rotation = trunk @ aside @ _turn(0, angle)
            end = start - length * rotation[:, 1]
            bones[f"{name} {part}"] = (0.5 * (start + end), rotation, _RADII[part], 0.5 * length)
            start, angle, aside = end, angle - bend, aside @ _turn(2, -sign * 0.1)
    return bones


def capsules(pose: Pose) -> dict[str, tuple[Floats, Floats, float, float]]:
    """Middle, rotation (the axis is its y), radius and half length of the figure's capsules by name."""
    return _bones(pose)


def _axis_angle(matrix: Floats) -> dict[str, Any]:
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    length = float(np.linalg.norm(axis))
    angle = math.atan2(0.5 * length, 0.5 * (float(np.trace(matrix)) - 1.0))
    if length < 1e-9:  # no capsule is turned by half a turn
        return {"axis": [1.0, 0.0, 0.0], "angle": 0.0}
    return {"axis": (axis / length).tolist(), "angle": angle}


def add(scene: Scene, motion: Motion, duration: float, *, friction: float | None = None) -> None:
    """Add the figure's capsules to a scene as rigid colliders; the pelvis is called ``"pelvis"``."""
    times = np.linspace(0.0, duration, math.ceil(duration * _SAMPLES) + 1)
    poses = [_bones(motion(float(t))) for t in times]
    extra = {} if friction is None else {"friction": friction}
    for name, (_, _, radius, half) in poses[0].items():
        keyframes = [
            {"time": float(t), "position": bones[name][0].tolist(), "rotation": _axis_angle(bones[name][1])}
            for t, bones in zip(times, poses, strict=True)
        ]
        shape = {"type": "capsule", "radius": radius, "half_height": half, "tolerance": _TOLERANCE}
        scene.add_collider(name, shape=shape, keyframes=keyframes, **extra)


# Garments: meshes on the standing figure, at least ``ease`` away from it --------------------------------------------


def stadium(radius: float, straight: float, count: int) -> Floats:
    """Points at equal distances along a stadium, straight sides along x: (count, 2) as x, z; from +z towards +x."""
    quarter = 0.5 * math.pi * radius
    around = 4.0 * quarter + 4.0 * straight
    points = []
    for s in np.arange(count) * around / count:
        half, sign = (s, 1.0) if s <= 0.5 * around else (around - s, -1.0)
        if half <= straight:
            x, z = half, radius
        elif half <= straight + 2.0 * quarter:
            angle = (half - straight) / radius
            x, z = straight + radius * math.sin(angle), radius * math.cos(angle)
        else:
            x, z = 2.0 * straight + 2.0 * quarter - half, -radius
        points.append((sign * x, z))
    return np.array(points)


def _tube(rows: Sequence[Sequence[int]]) -> list[list[int]]:
    """Triangles between rings of vertices, rows from above, each ring counter-clockwise seen from above; outward."""
    triangles = []
    for r, (upper, lower) in enumerate(itertools.pairwise(rows)):
        count = len(upper)
        for k in range(count):
            a, b, c, d = upper[k], upper[(k + 1) % count], lower[k], lower[(k + 1) % count]
            triangles += [[a, c, d], [a, d, b]] if (r + k) % 2 == 0 else [[a, c, b], [b, c, d]]
    return triangles


def skirt(
    around: int, rows: int, *, length: float = 0.5, flare: float = 0.2, ease: float = 0.012
) -> tuple[Mesh, list[int]]:
    """A skirt and the vertices of its waist.

    ``around`` (even) vertices in each of ``rows`` + 1 rings; ``flare`` is how much wider the hem is than the waist, in
    radius [m].
    """
    top = STANDING + WAIST
    points, rings = [], []
    for r in range(rows + 1):
        part = r / rows
        ring = stadium(PELVIS[0] + ease + flare * part, PELVIS[1], around)
        rings.append(list(range(r * around, (r + 1) * around)))
        points.append(np.column_stack([ring[:, 0], np.full(around, top - length * part), ring[:, 1]]))
    return Mesh(np.concatenate(points), _tube(rings)), rings[0]


def trousers(around: int, *, ease: float = 0.02, hem: float = 0.16) -> tuple[Mesh, list[int]]:
    """Trousers and the vertices of their waist.

    A tube of ``around`` (divisible by 4) vertices about the hips forks at a seam that runs under the body from front to
    back; each half of the last ring closes with the seam to the first ring of a leg. ``hem`` is the height of the
    leg's end above the sole [m].
    """
    top, fork = STANDING + WAIST, STANDING - PELVIS[0] - 0.02
    radius, straight = PELVIS[0] + ease, PELVIS[1]
    ring = stadium(radius + 0.006, straight + 0.004, around)
    cell = float(np.linalg.norm(ring[1] - ring[0]))
    rows = max(2, round((top - fork) / cell))
    points: list[Floats] = []
    rings: list[list[int]] = []
    for r in range(rows + 1):
        y = top + (fork - top) * r / rows
        rings.append(list(range(len(points), len(points) + around)))
        points += [np.array([x, y, z]) for x, z in ring]
    triangles = _tube(rings)
    last, half = rings[-1], around // 2
    seam_count = max(1, round(2.0 * radius / cell) - 1)
    seam = []
    for k in range(1, seam_count + 1):  # from front to back
        z = ring[0, 1] + (ring[half, 1] - ring[0, 1]) * k / (seam_count + 1)
        seam.append(len(points))
        points.append(np.array([0.0, fork - 0.01 * math.sin(math.pi * k / (seam_count + 1)), z]))
    left = [*last[: half + 1], *reversed(seam)]  # front, left side (+x), back, seam
    right = [*last[half:], last[0], *seam]  # back, right side (−x), front, seam
    below = round((fork - hem) / cell)
    for first, sign in ((left, 1.0), (right, -1.0)):
        rings = [first]
        start = np.array([points[i] for i in first])
        middle = np.array([sign * HIP[0], 0.0])
        flat = start[:, [0, 2]] - middle
        angles = np.unwrap(np.arctan2(flat[:, 1], flat[:, 0]))
        # From the angles of the first ring to equal ones, so that none is crowded.
        equal = angles.mean() + (np.arange(len(first)) - 0.5 * (len(first) - 1)) * np.sign(angles[1] - angles[0]) * (
            2.0 * math.pi / len(first)
        )
        for r in range(1, below + 1):
            part = r / below
            mixed = smooth(part / 0.3)
            wide = 0.095 - 0.010 * part
            aside = sign * math.tan(APART) * max(0.0, STANDING + HIP[1] - (1.0 - part) * fork - part * hem)
            target_angle = (1.0 - mixed) * angles + mixed * equal
            circle = (
                middle + np.array([aside, 0.0]) + wide * np.column_stack([np.cos(target_angle), np.sin(target_angle)])
            )
            xz = (1.0 - mixed) * start[:, [0, 2]] + mixed * circle
            heights = (1.0 - part) * start[:, 1] + part * hem
            rings.append(list(range(len(points), len(points) + len(first))))
            points += [np.array([x, h, z]) for (x, z), h in zip(xz, heights, strict=True)]
        triangles += _tube(rings)
    return Mesh(np.array(points), triangles), list(range(around))
