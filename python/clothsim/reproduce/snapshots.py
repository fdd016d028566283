"""The benchmarks of chapters 5 and 6 in pictures, and what makes them hard (figures 5.1, 5.10, 5.11, 6.8, 6.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats, Ints
from clothsim.recording import Body
from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import PUBLISHED, Benchmark, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THOUSANDS", "Shot", "Shown", "shoot"]

# Triangles of the thesis's benchmarks, in thousands: 5.4.1 (6.4.1 counts 20 for the funnel, Table 6.2 again 18).
THOUSANDS = {"Funnel": 18, "Cloth on ball": 92, "Flamenco": 49, "N-body": 146, "Reef knot": 20, "Bowline knot": 11}
_EVEN_SHARE = 10.0  # per cent of the triangles in a tenth of the cells, were all cells filled alike
_CLOTH_SHARE = 0.15  # of all triangles that a piece has at least to be cloth and not a tool
_PALETTE = 4  # colours of cloth
_COLUMNS = (
    "benchmark", "thesis: benchmark", "source", "step", "vertices", "triangles", "thesis: triangles, thousands",
    "pieces",    "largest over median triangle area", "triangles in the densest tenth of the cells [%]", "median edge",
    "largest motion in the step over the median edge", "contacts vertex-triangle", "contacts edge-edge",
    "triangle pairs that intersect at the start",
)  # fmt: skip


@dataclass(frozen=True)
class Shot:
    """A benchmark at the start of one step.

    Attributes
    ----------
    benchmark : Benchmark
        Which one.
    step : int
        Counted from 0.
    vertex_triangle, edge_edge : int
        Contacts on the way to the end of the step.
    passing : int
        Pairs of triangles that pass through each other at its start.
    """

    benchmark: Benchmark
    step: int
    vertex_triangle: int
    edge_edge: int
    passing: int

    @property
    def x(self) -> Floats:
        """Positions at the start of the step."""
        return self.benchmark.steps[self.step][0]

    @property
    def contacts(self) -> int:
        """Of both kinds."""
        return self.vertex_triangle + self.edge_edge

    def _corners(self) -> Floats:
        return self.x[self.benchmark.triangles]

    @property
    def edge(self) -> float:
        """Median length of the triangles' edges, in the benchmark's unit."""
        corners = self._corners()
        return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))

    @property
    def motion(self) -> float:
        """Largest way of a vertex in the step, over `edge`."""
        return float(np.linalg.norm(self.benchmark.steps[self.step][1] - self.x, axis=1).max()) / self.edge

    @property
    def uneven_sizes(self) -> float:
        """Area of the largest triangle over that of the median one."""
        a, b, c = self._corners().transpose(1, 0, 2)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return float(areas.max() / np.median(areas))

    @property
    def uneven_places(self) -> float:
        """Share of the triangles, by their centroids, in the fullest tenth of the cells that hold any [%].

        Cells have the side of the thesis's grid, 3 λ times the mean radius of the triangles' spheres about their
        centroids, λ = 1.2 (Eq. 5.1). Were all cells filled alike, it would be 10 %.
        """
        corners = self._corners()
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1).mean()
        cells = np.floor(centre / (3.0 * 1.2 * radius)).astype(np.int64)
        filled = np.sort(np.unique(cells, axis=0, return_counts=True)[1])[::-1]
        # A tenth of the cells is seldom a whole number of them.
        return (
            100.0
            * float(np.interp(0.1 * len(filled), np.arange(len(filled) + 1), [0, *np.cumsum(filled)]))
            / len(self.benchmark.triangles)
        )

    def row(self) -> tuple[Any, ...]:
        """Of the table."""
        b = self.benchmark
        return (
            b.name, b.thesis, b.source, self.step + 1, len(self.x), len(b.triangles), THOUSANDS[b.thesis],
            int(_pieces(b.triangles, len(self.x)).max()) + 1, self.uneven_sizes, self.uneven_places, self.edge,
            self.motion, self.vertex_triangle, self.edge_edge, self.passing,
        )  # fmt: skip


def _pieces(triangles: Ints, vertices: int) -> Ints:
    """Number of the connected piece that each triangle belongs to."""
    label = np.arange(vertices)
    ends = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    while True:
        low = np.minimum(label[ends[:, 0]], label[ends[:, 1]])
        after = label.copy()
        np.minimum.at(after, ends[:, 0], low)
        np.minimum.at(after, ends[:, 1], low)
        after = after[after]
        if np.array_equal(after, label):
            return np.unique(label[triangles[:, 0]], return_inverse=True)[1].reshape(-1)
        label = after


@dataclass(frozen=True)
class Shown:
    """The shots of a figure, and the benchmarks of the thesis that it shows."""

    suite: Suite
    wanted: tuple[str, ...]
    shots: tuple[Shot, ...]

    @property
    def last(self) -> list[Shot]:
        """The last step of each benchmark."""
        return list({s.benchmark.name: s for s in self.shots}.values())

    @property
    def missing(self) -> list[str]:
        """Benchmarks of the figure that are not there."""
        return [name for name in self.wanted if name not in {s.benchmark.thesis for s in self.shots}]

    def _left_out(self) -> str:
        return f"left out: {', '.join(self.missing)} ({self.suite.why})" if self.missing else ""

    def parameters(self) -> dict[str, Any]:
        """Where the motion comes from."""
        found: dict[str, Any] = {
            s.benchmark.name: f"{s.benchmark.source}: {_SOURCES[s.benchmark.source == PUBLISHED]}" for s in self.last
        }
        if self.missing:
            found["left out"] = self._left_out()
        return {
            **found, "contacts": "continuous, on the way to the end of the step, method bvh, thickness 0",
            "cells": "side 3 λ times the mean radius of the triangles' spheres (Eq. 5.1), λ = 1.2",
            "units": "published meshes have none; lengths of generated ones in m",
        }  # fmt: skip

    def tables(self) -> dict[str, Table]:
        """One row per benchmark and step."""
        return {"": Table(_COLUMNS, [shot.row() for shot in self.shots])}

    def here(self) -> str:
        """Size and contacts of each."""
        words = [
            f"{s.benchmark.name} {len(s.benchmark.triangles):,} triangles, the largest {s.uneven_sizes:.3g} times the "
            f"median one, {s.uneven_places:.0f} % of them in the densest tenth of the cells, {s.contacts:,} contacts"
            for s in self.last
        ]
        return "; ".join([*words, *([self._left_out()] if self.missing else [])])

    def checks(self) -> list[Check]:
        """What makes each of them fit for its experiment."""
        found = [
            Check(f"{s.benchmark.name}: thousands of triangles", len(s.benchmark.triangles) / 1e3,
                  float(THOUSANDS[s.benchmark.thesis]), 1.0, "thesis 5.4.1, in whole thousands, rounded or cut off")
            for s in self.last if not self.suite.is_quick
        ]  # fmt: skip
        return [
            *found,
            Check("pairs of triangles that intersect at the start of a generated step",
                  float(sum(s.passing for s in self.shots if s.benchmark.source != PUBLISHED)), 0.0, 0.0,
                  "a simulation has none; the published frames have some, as the table says"),
            Check.true("each has contacts in its last step", all(s.contacts > 0 for s in self.last), "what it is for"),
        ]  # fmt: skip

    def crowded(self) -> Check:
        """Finding of 6.4.1."""
        least = min(s.uneven_places for s in self.last)
        return Check.true(
            "over twice as many triangles in the densest tenth of the cells as in an even filling, each benchmark",
            least > 2.0 * _EVEN_SHARE, "thesis 6.4.1: the density is uneven",
        )  # fmt: skip

    def differing_sizes(self) -> Check:
        """Finding of 5.4.1; the ribbons of the knots have triangles of one size here."""
        ratios = [s.uneven_sizes for s in self.last if "knot" not in s.benchmark.thesis]
        return Check.true(
            "the largest triangle has over ten times the median area, each benchmark but knots", min(ratios) > 10.0,
            "thesis 5.4.1: sizes vary considerably",
        )  # fmt: skip

    def draw(self, title: str) -> bytes:
        """One tile per shot."""
        note = (
            "Start of each step; contacts are those on the way to its end. Published meshes: UNC Dynamic Scene "
            "Benchmarks, one step each; generated ones move by formulas."
        )
        if self.missing:
            note += f"\n{self._left_out()[0].upper()}{self._left_out()[1:]}."
        tiles = [(shot, near) for near in (False, True) for shot in self.shots if near in self._views(shot.benchmark)]
        columns = min(3, len(tiles))
        rows = -(-len(tiles) // columns)
        figure = pictures.figure(title, (max(4.6 * columns, 9.0), 1.0 + 4.5 * rows), note)
        figure.get_layout_engine().set(h_pad=0.06, hspace=0.05)
        axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        images = {}
        for b in {shot.benchmark.name: shot.benchmark for shot in self.shots}.values():
            for near in self._views(b):
                steps = [shot.step for shot in self.shots if shot.benchmark is b]
                rendered = _render(b, [b.steps[step][0] for step in steps], near=near)
                images.update({(b.name, step, near): image for step, image in zip(steps, rendered, strict=True)})
        for axis, (shot, near) in zip(axes, tiles, strict=False):
            b = shot.benchmark
            each = f", step {shot.step + 1} of {len(b.steps)}" if len(b.steps) > 1 else ""
            kind = "" if "generated" in b.name else " (published)"
            words = f"{len(b.triangles):,} triangles, {shot.contacts:,} contacts"
            if near:
                words += f"; shown: {2e3 * _NEAR[b.thesis]:.0f} mm about the knot"
            pictures.show(axis, images[b.name, shot.step, near], f"{b.name}{kind}{each}", words)
        for axis in axes[len(tiles) :]:
            axis.set_visible(False)
        return pictures.png(figure)

    def _views(self, benchmark: Benchmark) -> tuple[bool, ...]:
        """Whole, or from near, or both: a knot is small in its ribbon."""
        if benchmark.thesis not in _NEAR:
            return (False,)
        return (False, True) if len(self.last) == 1 else (True,)


_SOURCES = {
    True: "two frames",
    False: "by formula, not simulated; shapes, sizes and motion are chosen",
}


_NEAR = {"Reef knot": 0.075, "Bowline knot": 0.115}  # from the middle of a knot to the edge of its picture [m]
_UP_IS_Z = ("Funnel",)  # published with z up


def _render(benchmark: Benchmark, states: Sequence[Floats], *, near: bool = False) -> list[Any]:
    """Tiles; pieces with a large share of the triangles are cloth, of at most four colours, the others tools.

    ``near``: only what lies round the knot in all states.
    """
    triangles = benchmark.triangles
    pieces = _pieces(triangles, len(states[0]))
    count = np.bincount(pieces)
    cloth = np.flatnonzero(count >= _CLOTH_SHARE * len(pieces))
    if len(cloth) == 0:  # many small ones: those of one size have one colour
        groups = [np.flatnonzero(count == size) for size in np.unique(count)[:_PALETTE]]
    else:
        groups = [np.array([piece]) for piece in cloth]
    rest = np.setdiff1d(np.arange(len(count)), np.concatenate(groups))
    kinds: list[tuple[Ints, Literal["cloth", "collider"]]] = [(group, "cloth") for group in groups]
    kinds += [(rest, "collider")] if len(rest) else []
    images = []
    for each in [[state] for state in states] if near else [states]:
        seen = np.ones(len(triangles), dtype=bool)
        if near:
            seen = np.linalg.norm(each[0][triangles], axis=2).max(axis=1) < _NEAR[benchmark.thesis]
        bodies: list[Body] = []
        order: list[Ints] = []
        for group, kind in kinds:
            used, shown = np.unique(triangles[np.isin(pieces, group) & seen], return_inverse=True)
            bodies.append(Body(f"{kind} {len(bodies)}", kind, len(used), shown.reshape(-1, 3)))
            order.append(used)
        places = np.concatenate(order)
        images += pictures.tiles(bodies, [_turned(benchmark, state)[places] for state in each], size=(560, 520))
    return images


def _turned(benchmark: Benchmark, x: Floats) -> Floats:
    """With y up; a knot, which lies in a plane, with that plane towards the camera."""
    if benchmark.thesis in _NEAR:
        front = np.array([0.5, 0.9, 1.0]) / np.linalg.norm([0.5, 0.9, 1.0])
        right = np.array([front[2], 0.0, -front[0]]) / np.hypot(front[0], front[2])
        return np.asarray(x @ np.stack([right, np.cross(front, right), front]))
    return x[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0]) if benchmark.name in _UP_IS_Z else x


def shoot(effort: Effort, wanted: Sequence[str], quick: Sequence[str], figure: str) -> Shown:
    """Detect in each step of the thesis's benchmarks that are ``wanted``: the published data, or the generated one.

    ``quick``: names of the generated ones that the quick variant takes.
    """
    found = suite(effort, quick=quick)
    chosen = [next((b for b in found.benchmarks if b.thesis == name), None) for name in wanted]
    steps = [(b, number) for b in chosen if b is not None for number in range(len(b.steps))]
    shots = []
    with effort.bar(len(steps), figure, "step") as bar:
        for b, number in steps:
            detected = b.on_cpu("continuous", number, effort.threads)
            through = len(collision.self_intersections(b.steps[number][0], b.triangles))
            shots.append(Shot(b, number, len(detected.vertex_triangle), len(detected.edge_edge), through))
            bar.update()
    return Shown(found, tuple(wanted), tuple(shots))
