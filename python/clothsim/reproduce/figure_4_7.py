"""Figure 4.7 (b), (c), (d): moment over curvature of a full loop and of partial cycles.

Panel (a) is a measurement on a real fabric, printed without numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from clothsim import bending
from clothsim._arrays import Floats
from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import CURVATURE, MOMENT, Loop

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "b1 = 0.76, b2 = 0.26, c1 = −0.38, λ = 0.1 give a loop with smooth joins (by its formulas K0 = 0.658, M0 = 0.164), "
    "partial cycles that connect, and with plasticity disconnections where a cycle ends"
)

FABRIC = Loop(b1=0.76, b2=0.26, c1=-0.38)
PLASTICITY = 0.1
PEAK = 2.5  # 1/cm, the range of the KES bending tester
LOOP = {"0": 0.0, "Km": PEAK, "−Km": -PEAK, "Km again": PEAK}
# 0, Ka … Kg [1/cm]: the thesis plots them without values. Recoveries that begin on the line and on a parabola.
TURNS = {"0": 0.0, "Ka": 1.2, "Kb": 0.6, "Kc": 1.9, "Kd": -0.2, "Ke": 2.4, "Kf": -1.7, "Kg": 0.4}


@dataclass(frozen=True)
class Panel:
    """A path and what the law answers, in KES units."""

    title: str
    curvature: Floats
    moment: Floats
    rest: Floats
    dissipated: Floats  # gf/cm
    turns: dict[str, int]  # samples at which the path turns


@dataclass(frozen=True)
class Measured:
    """The three panels, and the loop as one reads it off its plot."""

    panels: dict[str, Panel]
    k0: float
    m0: float
    area: float
    kink: float  # largest change of slope from one sample to the next, over their distance [gf cm³/cm]


def measure(effort: Effort) -> Measured:
    """Trace the paths, and read K0, M0 and the loop's area off the curves."""
    per_unit = 200 if effort.quick else 500
    panels = {
        "b": trace("(b) full loop, λ = 0", LOOP, FABRIC, per_unit),
        "c": trace("(c) partial cycles, λ = 0", TURNS, FABRIC, per_unit),
        "d": trace(f"(d) partial cycles, λ = {PLASTICITY}", TURNS, replace(FABRIC, plasticity=PLASTICITY), per_unit),
    }
    full = panels["b"]
    down, up = (_between(full, *ends) for ends in (("Km", "−Km"), ("−Km", "Km again")))
    upper, lower = np.interp(0.0, down[0][::-1], down[1][::-1]), np.interp(0.0, *up)
    slopes = np.diff(up[1]) / np.diff(up[0])
    return Measured(
        panels,
        k0=_transition(*_between(full, "0", "Km")),
        m0=float(lower - upper) / 2.0 if lower > upper else float(upper - lower) / 2.0,
        area=_integral(*up) + _integral(*down),
        kink=float(np.abs(np.diff(slopes)).max()) * per_unit,
    )


def trace(title: str, turns: Mapping[str, float], fabric: Loop, per_unit: int) -> Panel:
    """Follow the law along a path given by its turning points [1/cm], with so many samples per 1/cm."""
    points = list(turns.values())
    path, at = [np.array(points[:1])], [0]
    for start, end in pairwise(points):
        count = max(2, math.ceil(abs(end - start) * per_unit))
        path.append(np.linspace(start, end, count + 1)[1:])
        at.append(at[-1] + count)
    curvature = np.concatenate(path)
    found = bending.trace(curvature * CURVATURE, "hysteresis", **fabric.si())
    return Panel(
        title, curvature, found.moment / MOMENT, found.rest_curvature / CURVATURE,
        found.dissipated / (MOMENT * CURVATURE), dict(zip(turns, at, strict=True)),
    )  # fmt: skip


def _between(panel: Panel, start: str, end: str) -> tuple[Floats, Floats]:
    part = slice(panel.turns[start], panel.turns[end] + 1)
    return panel.curvature[part], panel.moment[part]


def _integral(x: Floats, y: Floats) -> float:
    """∮ y dx by trapezoids."""
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)))


def _transition(k: Floats, m: Floats) -> float:
    """K0 of a first loading: where what it lacks to its final straight line, |c1| (K0 − K)², vanishes."""
    straight = k > 0.75 * k[-1]
    slope, intercept = np.polyfit(k[straight], m[straight], 1)
    lacking = slope * k + intercept - m
    curved = lacking > 0.01 * intercept
    falling, start = np.polyfit(k[curved], np.sqrt(lacking[curved]), 1)
    return float(-start / falling)


def first_cycle(fabric: Loop, peak: float, moment_at_end: float) -> float:
    """ξ λ K_r of a cycle that starts flat, by (4.6), (4.7) and the intercept of its recovery curve [1/cm]."""
    top = fabric.b2 * peak + fabric.m0
    share = min(1.0, (top - moment_at_end) / (2.0 * fabric.ma))
    c = abs(fabric.c1)
    case_2 = top <= 2.0 * fabric.ma
    intercept = peak + (math.sqrt(fabric.b1**2 - 2.0 * c * top) - fabric.b1) / c if case_2 else fabric.m0 / fabric.b2
    return share * fabric.plasticity * intercept


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The fabric of the figure's caption, and the curvatures that the thesis leaves open."""
    turns = " ".join(f"{name}={value}" for name, value in TURNS.items())
    samples = sum(len(panel.curvature) for panel in measured.panels.values())
    return {
        **FABRIC.named(), "lambda": f"0; panel d: {PLASTICITY}", "Km [1/cm]": f"{PEAK} (range of the KES tester)",
        "turning points of c, d [1/cm]": f"{turns} (chosen: the thesis plots them without values)", "samples": samples,
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """All samples; K counts from the rest shape θ0, K − rest from the residual angle θr."""
    columns = (
        "panel", "turning point", "K [1/cm]", "K - rest [1/cm]", "M [gf cm/cm]", "rest [1/cm]", "dissipated [gf/cm]",
        "K [1/m]", "M [N]",
    )  # fmt: skip
    rows = []
    for name, panel in measured.panels.items():
        turning = {index: turn for turn, index in panel.turns.items()}
        values = zip(
            panel.curvature.tolist(), panel.moment.tolist(), panel.rest.tolist(), panel.dissipated.tolist(), strict=True
        )
        rows += [
            (name, turning.get(i, ""), k, k - rest, m, rest, lost, k * CURVATURE, m * MOMENT)
            for i, (k, m, rest, lost) in enumerate(values)
        ]
    return {"": Table(columns, rows)}


def here(measured: Measured) -> str:
    """K0, M0, area, and how far the cycles of panel d move the rest curvature."""
    moves = np.count_nonzero(np.diff(measured.panels["d"].rest))
    return (
        f"K0 = {measured.k0:.3f} /cm (closed form {FABRIC.k0:.3f}), M0 = {measured.m0:.4f} gf cm/cm ({FABRIC.m0:.4f}), "
        f"loop area {measured.area:.4f} gf/cm ({FABRIC.area(PEAK):.4f}), no kink at any join; {moves} disconnections "
        f"with λ = {PLASTICITY}, none without"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """Closed forms of papers/notes 4.1, and (4.6) with (4.7) for the first cycle of panel d."""
    full, free, plastic = (measured.panels[name] for name in "bcd")
    span = len(full.curvature) / (5.0 * PEAK)
    chord = abs(FABRIC.c1) / span**2  # between samples a parabola is off its chord by less
    loop = full.dissipated[full.turns["Km again"]] - full.dissipated[full.turns["Km"]]
    after = plastic.turns["Kb"] + 1
    moved = first_cycle(replace(FABRIC, plasticity=PLASTICITY), TURNS["Ka"], float(plastic.moment[plastic.turns["Kb"]]))
    sums = chord * 4.0 * PEAK
    return [
        Check("K0 [1/cm]", measured.k0, FABRIC.k0, 1e-6, "(b1 − b2)/(2|c1|); a straight line fitted to exact samples"),
        Check("M0 [gf cm/cm]", measured.m0, FABRIC.m0, chord, "(b1 − b2) K0/2; half the gap at K = 0, between samples"),
        Check("loop area [gf/cm]", measured.area, FABRIC.area(PEAK), sums, "4 M0 (Km − 2/3 K0); trapezoids"),
        Check("dissipated in the loop [gf/cm]", float(loop), FABRIC.area(PEAK), 1e-9, "4 M0 (Km − 2/3 K0); exact"),
        Check("largest dM/dK change per K [gf cm3/cm]", measured.kink, abs(FABRIC.c1), 0.05 * abs(FABRIC.c1),
              "|c1|: a full reversal bends half as much as the virgin curve; a kink would be (b1 − b2) over a sample"),
        Check("rest curvature after the first cycle of d [1/cm]", float(plastic.rest[after]), moved, 1e-9,
              "ξ λ K_r, (4.6), (4.7), recovery on the quadratic curve"),
        Check("rest curvature without plasticity [1/cm]", float(np.abs(free.rest).max()), 0.0, 0.0, "λ = 0"),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """Three panels side by side, KES units with SI on the other sides."""
    note = "Curvature from the rest shape; in (d) from the residual angle θr, whose jumps are the dotted lines."
    figure = pictures.figure("Figure 4.7: bending hysteresis of one element", (17.5, 6.4), note)
    figure.get_layout_engine().set(wspace=0.06)
    axes = figure.subplots(1, 3)
    for axis, panel in zip(axes, measured.panels.values(), strict=True):
        pictures.tidy(axis, x="K [1/cm]", y="M [gf cm/cm]")
        axis.set_title(panel.title, fontsize=12, color=pictures.INK, loc="left", pad=34)
        axis.axhline(0.0, color=pictures.FAINT, linewidth=0.9)
        axis.axvline(0.0, color=pictures.FAINT, linewidth=0.9)
        _draw_path(axis, panel)
        axis.margins(0.09)
        for place, scale, label in (("top", CURVATURE, "K [1/m]"), ("right", 1e3 * MOMENT, "M [mN]")):
            make = axis.secondary_xaxis if place == "top" else axis.secondary_yaxis
            second = make(place, functions=(lambda v, s=scale: v * s, lambda v, s=scale: v / s))
            second.tick_params(colors=pictures.FAINT, labelsize=8.5)
            (second.set_xlabel if place == "top" else second.set_ylabel)(label, color=pictures.FAINT, fontsize=9)
    _annotate_loop(axes[0], measured)
    jumps = np.abs(np.diff(measured.panels["d"].rest))
    pictures.caption(axes[1], "order 0, Ka, Kb, … Kg\ncurves connect at every reversal")
    pictures.caption(
        axes[2],
        f"largest jump {jumps.max():.3f} /cm\nrest curvature at the end {measured.panels['d'].rest[-1]:.3f} /cm",
    )
    inset = axes[2].inset_axes((0.63, 0.06, 0.36, 0.34))
    _draw_path(inset, measured.panels["d"])
    inset.set(xlim=(0.4, 0.8), ylim=(-0.055, 0.055), xticks=[0.5, 0.7], yticks=[-0.04, 0.0, 0.04])
    inset.tick_params(labelsize=8, colors=pictures.FAINT)
    inset.axhline(0.0, color=pictures.FAINT, linewidth=0.9)
    axes[2].indicate_inset_zoom(inset, edgecolor=pictures.FAINT)
    return pictures.png(figure)


def _draw_path(axis: Any, panel: Panel) -> None:
    k, m = panel.curvature - panel.rest, panel.moment
    ends = [*np.flatnonzero(np.diff(panel.rest)).tolist(), len(k) - 1]
    start = 0
    for end in ends:
        axis.plot(k[start : end + 1], m[start : end + 1], color=pictures.LAWS["hysteresis"], linewidth=1.8)
        if end + 1 < len(k):
            axis.plot(
                k[end : end + 2],
                m[end : end + 2],
                color=pictures.LAWS["linear"],
                linewidth=2.0,
                linestyle=(0, (1, 0.7)),
                zorder=6,
            )
        start = end + 1
    for name, index in panel.turns.items():
        if name.startswith("K") and len(name) == 2 and name != "Km":
            right = k[index] > k[max(index - 10, 0)]  # the upper line passes there: its labels go to the left
            axis.plot(k[index], m[index], "o", color=pictures.LAWS["linear"], markersize=4.5, zorder=5)
            axis.annotate(
                f"$K_{name[1]}$", (k[index], m[index]), xytext=(-6 if right else 6, 8 if right else -8), fontsize=12,
                textcoords="offset points", ha="right" if right else "left", va="center", color=pictures.LAWS["linear"],
            )  # fmt: skip


def _annotate_loop(axis: Any, measured: Measured) -> None:
    fabric, blue = FABRIC, pictures.LAWS["linear"]
    axis.fill(
        *_between(measured.panels["b"], "Km", "Km again"), color=pictures.LAWS["hysteresis"], alpha=0.08, linewidth=0
    )
    axis.plot(fabric.k0, fabric.ma, "o", color=blue, markersize=4.5, zorder=5)
    axis.annotate(
        "$(K_0, M_a)$", (fabric.k0, fabric.ma), xytext=(8, -6), textcoords="offset points", fontsize=10.5, color=blue,
        va="top",
    )  # fmt: skip
    axis.annotate(
        "", (0.0, fabric.m0), xytext=(0.0, -fabric.m0),
        arrowprops={"arrowstyle": "<->", "color": blue, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    axis.annotate(
        "$2M_0$",
        (0.0, -0.5 * fabric.m0),
        xytext=(6, 0),
        textcoords="offset points",
        fontsize=10.5,
        color=blue,
        va="center",
    )
    text = (
        f"measured (closed form)\n$K_0$ = {measured.k0:.4f} ({fabric.k0:.4f}) /cm\n"
        f"$M_0$ = {measured.m0:.4f} ({fabric.m0:.4f}) gf cm/cm\n"
        f"area = {measured.area:.4f} ({fabric.area(PEAK):.4f}) gf/cm"
    )
    pictures.caption(axis, text)
