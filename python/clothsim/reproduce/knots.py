"""Ribbons tied into a reef knot and a bowline, drawn tight: meshes in motion, made from drawings of the knots.

A knot is drawn as points in the plane with heights that say what passes over what; smooth curves through them are the
centre lines. In the knot a ribbon gathers in pleats and lies flat outside. The unit of a drawing goes with the gathered
width: a knot that is drawn tighter is the same drawing, smaller, with deeper pleats, and the ribbon runs out of it at
its ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clothsim._arrays import Floats
from clothsim.reproduce.moving import Moving, joined, length_of, sheet, whole

__all__ = ["bowline", "centre_lines", "reef"]

ACROSS = 16  # cells across a ribbon: four pleats of four
_PLEATS = 4
_GATHERED = 0.4  # half the gathered width, in units of a drawing
_LOOSE, _TIGHT = 0.3, 0.15  # gathered width over the ribbon's
_NEAR, _FAR = 7.5, 15.0  # a ribbon is gathered up to the one distance from the middle of the knot, flat from the other
_SAMPLES = 60  # of a centre line, per point of the drawing
_FRAME = 0.005  # of the way from loose to tight in one step


# The drawings: x, y, height. Where ribbons cross, the heights differ by 2 in the reef knot, by ≥ 1 in the bowline.
_LEG = [(-17.0, 9.0, 0.0), (-13.0, 5.6, 0.0), (-9.4, 2.2, 0.3), (-6.0, 0.8, 1.0), (-3.4, 0.9, 1.0), (-1.6, 1.4, 0.0)]
_LEG += [(0.0, 2.2, -1.0), (1.6, 3.0, 0.0), (3.2, 3.4, 1.0), (5.2, 2.6, 1.0), (6.2, 1.3, 1.0)]
_BIGHT = [*_LEG, (6.5, 0.0, 1.0), *((x, -y, z) for x, y, z in reversed(_LEG))]
_REEF = (_BIGHT, [(-x, y, -z) for x, y, z in _BIGHT])

_BOWLINE = (
    [
        (24.0, 0.6, 0.0), (18.0, 0.2, 0.0), (12.0, 0.0, 0.0), (9.0, 0.0, -0.7), (7.2, 0.0, -1.0), (5.4, 0.0, -1.0),
        (4.1, 0.3, 0.4), (2.9, 0.9, 1.6), (1.3, 2.0, 1.2), (-0.3, 3.4, 1.0), (-1.6, 4.2, 0.0), (-2.9, 3.6, -1.0),
        (-3.1, 2.0, -1.0), (-3.1, 0.0, -1.0), (-3.1, -2.0, -1.0), (-2.9, -3.6, -1.0), (-1.6, -4.2, 0.0),
        (-0.3, -3.5, 1.0), (0.7, -2.0, 1.5), (1.7, -0.6, 0.0), (2.6, 0.6, -0.4), (3.4, 2.0, 1.5), (3.5, 3.8, 0.8),
        (2.2, 6.0, 0.0), (-2.0, 7.6, 0.0), (-7.0, 7.4, 0.0), (-11.5, 5.2, 0.0), (-13.0, 2.0, 0.0), (-11.5, -1.2, 0.0),
        (-8.5, -2.2, 0.0), (-5.0, -2.0, 0.0), (-2.5, -2.0, 0.0), (0.0, -2.0, 0.0), (2.5, -2.0, 0.0), (4.6, -2.0, 0.0),
        (5.9, -1.3, 0.0), (6.4, 0.0, 0.0), (5.9, 1.3, 0.0), (4.6, 2.0, 0.0), (2.5, 2.0, 0.0), (0.0, 2.0, 0.0),
        (-2.5, 2.0, 0.0), (-5.0, 1.9, 0.0), (-8.0, 1.6, 0.0),
    ],
)  # fmt: skip


def reef(columns: int = 313, *, length: float = 1.0, steps: int = 3) -> Moving:
    """Two ribbons tied into a reef knot.

    Parameters
    ----------
    columns : int
        Cells along each ribbon, ≥ 120; 16 cells across, 2 triangles each.
    length : float
        Of each ribbon [m]; its width is 1/44 of that in the reef knot, 1/50 in the bowline.
    steps : int
        How many, ≥ 1, from loose to tight. In the last the knot is pressed together until the ribbons meet.
    """
    return _tied(_REEF, columns, length, 44.0, 0.2, steps, 0.5)


def bowline(columns: int = 344, *, length: float = 1.0, steps: int = 3) -> Moving:
    """One ribbon tied into a bowline; the parameters are those of `reef`."""
    return _tied(_BOWLINE, columns, length, 50.0, 0.5, steps, 1.0)


def centre_lines(knot: str) -> list[Floats]:
    """Smooth centre lines of the drawing of a ``"reef"`` knot (two) or a ``"bowline"``, in units of the drawing.

    Where lines cross they are 2 apart in the reef knot, at least 1 in the bowline.
    """
    return [_smooth(np.array(points)) for points in {"reef": _REEF, "bowline": _BOWLINE}[knot]]


def _tied(
    drawing: Sequence[Sequence[tuple[float, float, float]]],
    columns: int,
    length: float,
    slender: float,
    pressed: float,
    steps: int,
    anchor: float,
) -> Moving:
    columns, steps = whole(columns, "columns", 120), whole(steps, "steps", 1)
    width = length_of(length, "length") / slender
    curves = [_smooth(np.array(points)) for points in drawing]
    triangles = joined([sheet(columns, ACROSS)] * len(curves), [(columns + 1) * (ACROSS + 1)] * len(curves))

    def at(tight: float, high: float = 1.0) -> Floats:
        return np.concatenate([_swept(curve, columns, length, width, tight, high, anchor) for curve in curves])

    early = [k / (steps - 1) for k in range(steps - 1)]
    frames = [(at(tight), at(tight + _FRAME)) for tight in early]
    return Moving(triangles, (*frames, (at(1.0), at(1.0 + _FRAME, pressed))))


def _smooth(points: Floats) -> Floats:
    """Samples of the natural cubic spline through points, its parameter the length of the chords."""
    t = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    h, n = np.diff(t), len(t)
    matrix, right = np.eye(n), np.zeros_like(points)
    for k in range(1, n - 1):
        matrix[k, k - 1 : k + 2] = h[k - 1], 2.0 * (h[k - 1] + h[k]), h[k]
        right[k] = 6.0 * ((points[k + 1] - points[k]) / h[k] - (points[k] - points[k - 1]) / h[k - 1])
    m = np.linalg.solve(matrix, right)
    at = np.linspace(0.0, t[-1], _SAMPLES * n)
    piece = np.clip(np.searchsorted(t, at, side="right") - 1, 0, n - 2)
    left, rest, width = (at - t[piece])[:, None], (t[piece + 1] - at)[:, None], h[piece][:, None]
    curve: Floats = (
        (m[piece] * rest**3 + m[piece + 1] * left**3) / (6.0 * width)
        + (points[piece] / width - m[piece] * width / 6.0) * rest
        + (points[piece + 1] / width - m[piece + 1] * width / 6.0) * left
    )
    return curve


def _swept(
    curve: Floats, columns: int, length: float, width: float, tight: float, high: float, anchor: float
) -> Floats:
    """Vertices of a ribbon along a drawn curve, ``tight`` from 0 (loose) to 1; heights are scaled by ``high``.

    ``anchor`` is the share of the curve left uncovered, or of the ribbon beyond it, that lies before the curve's start.
    """
    gather = _LOOSE + (_TIGHT - _LOOSE) * tight
    unit = 0.5 * gather * width / _GATHERED
    line = unit * curve
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    stations = anchor * (s[-1] - length) + np.linspace(0.0, length, columns + 1)
    # Beyond the drawing a ribbon goes on straight.
    first, last = ((line[e] - line[i]) / np.linalg.norm(line[e] - line[i]) * length for e, i in ((0, 1), (-1, -2)))
    line = np.vstack([line[0] + first, line, line[-1] + last])
    s = np.concatenate([[-length], s, [s[-1] + length]])
    centre = np.stack([np.interp(stations, s, line[:, k]) for k in range(3)], axis=1)
    tangent = np.gradient(centre, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    aside = np.stack([-tangent[:, 1], tangent[:, 0], np.zeros(len(tangent))], axis=1)
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    up = np.cross(tangent, aside)
    # Pleats: zigzags that keep the width of the ribbon, and of the cloth.
    part = np.clip((np.hypot(centre[:, 0], centre[:, 1]) / unit - _NEAR) / (_FAR - _NEAR), 0.0, 1.0)
    narrow = gather + (1.0 - gather) * part * part * (3.0 - 2.0 * part)
    j = np.arange(ACROSS + 1)
    quarter = ACROSS // (4 * _PLEATS)
    wave = np.interp(j % (4 * quarter), quarter * np.array([0, 1, 3, 4]), [0.0, 1.0, -1.0, 0.0])
    deep = width / (4 * _PLEATS) * np.sqrt(1.0 - narrow**2)
    flat = (j / ACROSS - 0.5) * width
    centre[:, 2] *= high
    places = (
        centre[:, None, :]
        + (narrow[:, None] * flat)[:, :, None] * aside[:, None, :]
        + (deep[:, None] * wave)[:, :, None] * up[:, None, :]
    )
    return np.asarray(places.reshape(-1, 3))
