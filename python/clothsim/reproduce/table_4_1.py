"""Table 4.1: running time of the bending component with and without hysteresis, by the number of sub-steps α."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.reproduce import pictures
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.kes import Loop
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["THESIS", "checks", "draw", "here", "measure", "parameters", "tables"]

THESIS = (
    "18,000 triangles, α = 1, 2, 3: 1.35, 2.70, 4.04 ms (11.4, 20.5, 27.9 % of the running time) without hysteresis, "
    "2.04, 4.07, 6.10 ms (16.3, 28.0, 36.9 %) with it, on a GeForce 470 GTX"
)
PRINTED = {
    ("linear", 1): (1.35, 11.4), ("linear", 2): (2.70, 20.5), ("linear", 3): (4.04, 27.9),
    ("hysteresis", 1): (2.04, 16.3), ("hysteresis", 2): (4.07, 28.0), ("hysteresis", 3): (6.10, 36.9),
}  # fmt: skip

ALPHAS = (1, 2, 3)
LAWS = ("linear", "hysteresis")
# The name that a force model has in a step's report.
MODEL = {"linear": "hinge", "hysteresis": "hysteresis"}

FABRIC = Loop(b1=3.4, b2=2.0, c1=-2.23, plasticity=0.2, fatigue=0.02)  # of figure 4.11
CELLS, QUICK_CELLS = (90, 100), (18, 20)  # 18,000 triangles
CELL = 0.01  # m
STEP = 2e-4  # h_e [s]: the time step of the explicit bending, h_i = α h_e
DENSITY, STRETCH, SHEAR, DAMPING = 0.2, 300.0, 30.0, 1e-3  # kg/m², N/m, N/m, s
# Rounds of a few steps per variant in turn, so that what else the machine does meets all alike.
ROUNDS, STEPS = 12, 10
QUICK_ROUNDS = 3
SETTLING = 30  # steps before the first round: the start is flat, and an element at rest costs less


@dataclass(frozen=True)
class Measured:
    """Milliseconds of the bending and of the whole step, per step."""

    triangles: int
    threads: int
    bending: dict[tuple[str, int], Floats]
    step: dict[tuple[str, int], Floats]
    iterations: dict[tuple[str, int], float]

    def median(self, law: str, alpha: int) -> float:
        """Median over the steps [ms]."""
        return float(np.median(self.bending[law, alpha]))

    def share(self, law: str, alpha: int) -> float:
        """Median share of a step [%]."""
        return float(100.0 * np.median(self.bending[law, alpha] / self.step[law, alpha]))


def measure(effort: Effort) -> Measured:
    """Step six simulations in turn."""
    cells = QUICK_CELLS if effort.quick else CELLS
    rounds = QUICK_ROUNDS if effort.quick else ROUNDS
    keys = [(law, alpha) for law in LAWS for alpha in ALPHAS]
    simulations = {key: Simulation(_scene(*key, cells), threads=effort.threads) for key in keys}
    reports: dict[tuple[str, int], list[dict[str, Any]]] = {key: [] for key in keys}
    with effort.bar(len(keys) * (SETTLING + rounds * STEPS), "table 4.1") as bar:
        for key in keys:
            for _ in range(SETTLING):
                simulations[key].step()
                bar.update()
        for _ in range(rounds):
            for key in keys:
                for _ in range(STEPS):
                    reports[key].append(simulations[key].step())
                    bar.update()
    return Measured(
        triangles=2 * cells[0] * cells[1],
        threads=effort.threads,
        bending={key: np.array([1e3 * dict(r["forces"])[MODEL[key[0]]] for r in reports[key]]) for key in keys},
        step={key: np.array([1e3 * sum(dict(r["seconds"]).values()) for r in reports[key]]) for key in keys},
        iterations={key: float(np.median([r["linear_iterations"] for r in reports[key]])) for key in keys},
    )


def _scene(law: str, alpha: int, cells: tuple[int, int]) -> Scene:
    nx, ny = cells[0] + 1, cells[1] + 1
    scene = Scene(
        name=f"{law}, alpha = {alpha}",
        duration=10.0,
        time={"dt": alpha * STEP, "integrator": "semi-implicit", "bending_substeps": alpha},
    )
    scene.add_cloth(
        Mesh.grid(cells[0] * CELL, cells[1] * CELL, nx, ny),
        {
            "areal_density": DENSITY,
            "in_plane": {
                "model": "baraff-witkin", "warp": STRETCH, "weft": STRETCH, "shear": SHEAR, "damping": DAMPING,
            },
            "bending": FABRIC.law(law),
        },
        pins=[{"vertices": [0, nx - 1]}],
    )  # fmt: skip
    return scene


def parameters(measured: Measured) -> Mapping[str, Any]:
    """What was timed, on what."""
    from clothsim._cli.doctor import findings

    machine = findings()
    return {
        **FABRIC.named(), "triangles": measured.triangles, "threads": measured.threads,
        "processor": machine["processor"]["model"], "cell [m]": CELL, "areal density [kg/m2]": DENSITY,
        "stretch [N/m]": STRETCH, "shear [N/m]": SHEAR, "in-plane damping [s]": DAMPING, "h_e [s]": STEP,
        "h_i": "alpha h_e", "scene": "falls from flat, held at two corners, no collision handling",
        "without": "linear hinge of rigidity b2", "rounds": "the six variants take turns, ten steps each",
        "chosen": "all but 18,000 triangles and alpha: the thesis states no other value",
    }  # fmt: skip


def tables(measured: Measured) -> Mapping[str, Table]:
    """One row per variant: quartiles over the steps, beside the thesis."""
    columns = (
        "hysteresis", "alpha", "bending [ms]", "first quartile [ms]", "third quartile [ms]", "share of step [%]",
        "step [ms]", "linear iterations", "thesis [ms]", "thesis [%]",
    )  # fmt: skip
    rows = []
    for (law, alpha), times in measured.bending.items():
        low, high = np.percentile(times, [25, 75])
        rows.append(
            (
                "with" if law == "hysteresis" else "without", alpha, measured.median(law, alpha), float(low),
                float(high), measured.share(law, alpha), float(np.median(measured.step[law, alpha])),
                measured.iterations[law, alpha], *PRINTED[law, alpha],
            )
        )  # fmt: skip
    return {"": Table(columns, rows)}


def here(measured: Measured) -> str:
    """The table's two rows, and what hysteresis adds."""
    words = []
    for law in LAWS:
        times = ", ".join(f"{measured.median(law, alpha):.2f}" for alpha in ALPHAS)
        shares = ", ".join(f"{measured.share(law, alpha):.1f}" for alpha in ALPHAS)
        words.append(f"{times} ms ({shares} %) {'with it' if law == 'hysteresis' else 'without hysteresis'}")
    added = 100.0 * (measured.median("hysteresis", 1) / measured.median("linear", 1) - 1.0)
    step = {law: float(np.median(measured.step[law, 1])) for law in LAWS}
    whole = 100.0 * (step["hysteresis"] / step["linear"] - 1.0)
    return (
        f"{measured.triangles:,} triangles: {', '.join(words)}, on {measured.threads} CPU threads; hysteresis adds "
        f"{added:.0f} % to the bending (the thesis: 51 %) and {whole:.0f} % to a step at α = 1"
    )


def checks(measured: Measured) -> Sequence[Check]:
    """Only what does not depend on the machine: sub-steps cost in proportion."""
    grows = all(measured.median(law, 3) > measured.median(law, 2) > measured.median(law, 1) for law in LAWS)
    return [Check.true("the bending's time grows with α", grows, "α evaluations per step")]


def draw(measured: Measured) -> bytes:
    """Bars of milliseconds and of shares, ours beside the thesis's."""
    note = (
        "Bars: medians over the steps, quartiles as whiskers; dashes: the thesis, on a GeForce 470 GTX. "
        f"Here {measured.threads} CPU threads, {measured.triangles:,} triangles, no collision handling."
    )
    figure = pictures.figure("Table 4.1: running time of the bending component", (11.5, 5.2), note)
    left, right = figure.subplots(1, 2)
    pictures.tidy(left, "time per step [ms]", "$α = h_i/h_e$")
    pictures.tidy(right, "share of the step [%]", "$α = h_i/h_e$")
    for number, law in enumerate(LAWS):
        at = np.array(ALPHAS) + (number - 0.5) * 0.34
        median = np.array([measured.median(law, a) for a in ALPHAS])
        spread = np.array([np.percentile(measured.bending[law, a], [25, 75]) for a in ALPHAS]).T
        label = "with hysteresis" if law == "hysteresis" else "without (linear)"
        left.bar(at, median, 0.32, color=pictures.LAWS[law], label=label)
        left.errorbar(at, median, np.abs(spread - median), fmt="none", ecolor=pictures.INK, capsize=3, linewidth=1.2)
        right.bar(at, [measured.share(law, a) for a in ALPHAS], 0.32, color=pictures.LAWS[law])
        for axis, column in ((left, 0), (right, 1)):
            printed = [PRINTED[law, a][column] for a in ALPHAS]
            axis.hlines(printed, at - 0.16, at + 0.16, colors=pictures.INK, linestyles=(0, (3, 1.2)), linewidth=1.8)
    for axis in (left, right):
        axis.set_xticks(ALPHAS)
    left.plot([], [], color=pictures.INK, linestyle=(0, (3, 1.2)), linewidth=1.8, label="the thesis (GPU)")
    left.legend(frameon=False, fontsize=9.5, loc="upper left")
    return pictures.png(figure)
