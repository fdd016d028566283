"""Figure 4.13: strips clamped n times by two planes, then hung: the plastic law above, hysteresis below."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.recording import Body
from clothsim.reproduce import clamping, pictures
from clothsim.reproduce.clamping import Setup, Specimen
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "with hysteresis (b1 = 5.20, b2 = 2.51, c1 = −4.45, λ = 0.15, μ = 0.1) the residual wrinkle grows with n, most in "
    "the first cycle, ever less after it; with plasticity the increase depends only on how far the cloth is bent"
)

LAWS = ("plastic", "hysteresis")
CYCLES, QUICK_CYCLES = (1, 3, 8, 20), (1, 3)


@dataclass(frozen=True)
class Measured:
    """All strips."""

    setup: Setup
    specimens: dict[str, list[Specimen]]  # law → by number of cycles

    def angles(self, law: str) -> list[float]:
        """Fold angle of the hung strips [rad]."""
        return [specimen.fold_angle(self.setup) for specimen in self.specimens[law]]

    def rest(self, law: str) -> list[float]:
        """Angle by which the fold's rest shape is turned: sum of rest curvature times h̄ across the fold [rad]."""
        return [self.rest_angle(specimen.rest) for specimen in self.specimens[law]]

    def rest_angle(self, curvature: Floats) -> float:
        """∫ K ds along the strip."""
        return abs(float(curvature.sum())) * self.setup.cell


def measure(effort: Effort) -> Measured:
    """Clamp and hang one strip per law and number of cycles."""
    setup = Setup(rows=1, hang_time=1.0) if effort.quick else Setup()
    jobs = [(law, n) for law in LAWS for n in (QUICK_CYCLES if effort.quick else CYCLES)]
    with effort.bar(sum(n for _, n in jobs), "figure 4.13", "cycle") as bar:
        # The longest first, so that all threads are busy to the end.
        order = sorted(jobs, key=lambda job: -job[1])
        found = effort.each(lambda job: clamping.clamp(job[0], job[1], setup, hang=True, tick=bar.update), order, bar)
        done = dict(zip(order, found, strict=True))
    return Measured(setup, {law: [done[job] for job in jobs if job[0] == law] for law in LAWS})


def parameters(measured: Measured) -> Mapping[str, Any]:
    """The caption's coefficients; everything else is chosen."""
    fabric = clamping.FABRIC
    return {
        **clamping.parameters(measured.setup),
        "plastic law": f"rigidity b2, elastic limit K0 = {fabric.k0:.4f} 1/cm, hardening {clamping.HARDENING} b2",
    }


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per strip, and their middle lines as they hang."""
    columns = ("law", "n", "fold angle hung [rad]", "fold angle at rest [rad]", "largest rest curvature [1/m]")
    rows = [
        (law, s.cycles, angle, rest, float(np.abs(s.rest).max()))
        for law in LAWS
        for s, angle, rest in zip(measured.specimens[law], measured.angles(law), measured.rest(law), strict=True)
    ]
    shapes = []
    for law in LAWS:
        for s in measured.specimens[law]:
            line = _lines(s, measured.setup).mean(axis=0)
            shapes += [(law, s.cycles, i, float(x), float(y)) for i, (x, y, _) in enumerate(line)]
    return {"": Table(columns, rows), "shapes": Table(("law", "n", "vertex", "x [m]", "y [m]"), shapes)}


def _lines(specimen: Specimen, setup: Setup) -> Floats:
    assert specimen.hung is not None
    return specimen.hung.reshape(setup.rows + 1, setup.cells + 1, 3)


def here(measured: Measured) -> str:
    """Fold angles over n, per law."""
    words = []
    for law in reversed(LAWS):
        hung = ", ".join(f"{math.degrees(a):.0f}°" for a in measured.angles(law))
        rest = ", ".join(f"{math.degrees(a):.1f}°" for a in measured.rest(law))
        words.append(f"{law} keeps a fold of {hung} when hung (its rest shape {rest})")
    cycles = ", ".join(str(s.cycles) for s in measured.specimens[LAWS[0]])
    return f"after n = {cycles} cycles " + "; ".join(words)


def checks(measured: Measured) -> Sequence[Check]:
    """What the thesis finds."""
    hysteresis, n = measured.rest("hysteresis"), [s.cycles for s in measured.specimens["hysteresis"]]
    rates = [(b - a) / (m - k) for a, b, k, m in zip([0.0, *hysteresis], hysteresis, [0, *n], n, strict=False)]
    plastic = measured.specimens["plastic"][-1].lifted["rest_curvature"]
    first, last = (measured.rest_angle(plastic[k]) for k in (0, -1))
    angles = measured.angles("hysteresis")
    return [
        Check.true("hysteresis: the rest shape's fold grows with n", all(r > 0.0 for r in rates), "thesis 4.5.4"),
        Check.true("hysteresis: most at first, ever less", rates == sorted(rates, reverse=True), "thesis 4.5.4"),
        Check.true("hysteresis: the hung fold grows with n", angles == sorted(angles), "thesis 4.5.4"),
        Check("plastic: fold at rest after the last over after the first cycle", last / first, 1.0, 0.25,
              "clamped as far each time, it flows once; the strip's creep between the planes moves the fold a little"),
    ]  # fmt: skip


def draw(measured: Measured) -> bytes:
    """The hung strips, plastic above, hysteresis below, and their fold angles over n."""
    count = len(measured.specimens[LAWS[0]])
    note = (
        "Each strip hangs by one short side after n cycles. Stretch, density, size and the planes' motion are chosen; "
        "bending coefficients as in the thesis, read in KES units."
    )
    figure = pictures.figure("Figure 4.13: clamped n times, then hung", (3.1 * count + 5.6, 7.6), note)
    grid = figure.add_gridspec(2, count + 1, width_ratios=[1.0] * count + [1.7])
    for row, (law, images) in enumerate(_render(measured).items()):
        for column, (specimen, image) in enumerate(zip(measured.specimens[law], images, strict=True)):
            axis = figure.add_subplot(grid[row, column])
            title = f"{law}, n = {specimen.cycles}" if column == 0 else f"n = {specimen.cycles}"
            pictures.show(axis, image, title, f"fold {math.degrees(measured.angles(law)[column]):.0f}°")
    for row, (what, values) in enumerate(
        (("fold angle, hung [°]", measured.angles), ("fold angle of the rest shape [°]", measured.rest))
    ):
        axis = figure.add_subplot(grid[row, count])
        pictures.tidy(axis, what, "cycles n")
        for law in LAWS:
            n = [s.cycles for s in measured.specimens[law]]
            axis.plot(n, np.degrees(values(law)), "o-", color=pictures.LAWS[law], label=law, linewidth=1.8)
        axis.set_ylim(bottom=0.0)
        axis.set_xticks(n)
        axis.legend(frameon=False, fontsize=9.5)
    return pictures.png(figure)


def _render(measured: Measured) -> dict[str, list[Any]]:
    """Tiles by law: the strip wider (its shape does not vary across), turned to the camera, hanging from a rod."""
    setup = measured.setup
    copies = 11
    width = 0.05
    turn = math.radians(125.0)  # the hollow of the fold faces the light
    rotation = np.array([[math.cos(turn), 0, -math.sin(turn)], [0, 1, 0], [math.sin(turn), 0, math.cos(turn)]])
    states = []
    for law in LAWS:
        for specimen in measured.specimens[law]:
            line = _lines(specimen, setup).mean(axis=0)
            sheet = np.repeat(line[None], copies, axis=0)
            sheet[:, :, 2] = np.linspace(-0.5 * width, 0.5 * width, copies)[:, None]
            states.append(sheet.reshape(-1, 3) @ rotation.T)
    grid = Mesh.grid(setup.length, width, setup.cells + 1, copies)
    rod = Mesh.box((0.005, 0.005, width * 1.25))
    bodies = [
        Body("strip", "cloth", len(grid.vertices), grid.triangles, None),
        Body("rod", "collider", len(rod.vertices), rod.triangles, None, static=True),
    ]
    standing = (rod.vertices + np.array([0.0, states[0][:, 1].max(), 0.0])) @ rotation.T
    images = pictures.tiles(bodies, states, standing, size=(420, 420))
    count = len(images) // len(LAWS)
    return {law: images[k * count : (k + 1) * count] for k, law in enumerate(LAWS)}
