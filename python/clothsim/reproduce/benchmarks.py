"""The benchmarks of chapters 5 and 6: three that are published, as far as their data are there, and generated ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats, Ints
from clothsim._data import VARIABLE, data_folder
from clothsim.reproduce import knots, pushed
from clothsim.reproduce.contract import Effort
from clothsim.reproduce.moving import Moving

__all__ = ["COLOURS", "SMALL", "Benchmark", "Suite", "suite"]

GENERATED, PUBLISHED = "generated", "UNC Dynamic Scene Benchmarks"
_THICKNESS = 0.1  # of discrete detection, over the median edge


@dataclass(frozen=True, eq=False)
class Benchmark:
    """Two or more frames of one mesh.

    Attributes
    ----------
    name : str
        As the figures call it.
    thesis : str
        The benchmark of the thesis that it is, or stands for.
    source : str
        Where the motion comes from.
    triangles : (m, 3) int64
        Vertex indices.
    steps : tuple of ((n, 3) float64, (n, 3) float64)
        Positions at both ends of each step [m].
    """

    name: str
    thesis: str
    source: str
    triangles: Ints
    steps: tuple[tuple[Floats, Floats], ...]
    _found: dict[tuple[str, int], collision.Detection] = field(default_factory=dict, repr=False)

    @property
    def thickness(self) -> float:
        """That of discrete detection [m]: a tenth of the median edge; continuous detection has none."""
        x = self.steps[0][0]
        ends = x[np.concatenate([self.triangles[:, [k, (k + 1) % 3]] for k in range(3)])]
        return float(_THICKNESS * np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))

    def on_cpu(self, mode: str, step: int, threads: int) -> collision.Detection:
        """What the CPU finds in a step, looked for once."""
        if (mode, step) not in self._found:
            thickness = self.thickness if mode == "discrete" else 0.0
            self._found[mode, step] = collision.detect(
                *self.steps[step], self.triangles, "bvh", mode, thickness, threads=threads
            )
        return self._found[mode, step]


@dataclass(frozen=True, eq=False)
class Suite:
    """The benchmarks of one run, and what was left out; ``is_quick``: they are smaller than the thesis's."""

    benchmarks: tuple[Benchmark, ...]
    left_out: tuple[str, ...]
    why: str
    is_quick: bool = False

    @property
    def note(self) -> str:
        """What was left out and why, or nothing."""
        return f"left out: {', '.join(self.left_out)} ({self.why})" if self.left_out else ""

    def named(self, name: str) -> Benchmark | None:
        """The one of that name, if it is there."""
        return next((b for b in self.benchmarks if b.name == name), None)


_FILES = {"Cloth on ball": "cloth-ball", "N-body": "n-body-simulation", "Funnel": "cloth-funnel"}
_MADE: dict[str, tuple[str, Callable[[bool, int], Moving]]] = {
    "Funnel (generated)": (
        "Funnel", lambda quick, steps: pushed.funnel(48 if quick else 96, steps=steps)
    ),
    "Skirt (generated)": (
        "Flamenco", lambda _, steps: pushed.skirt(steps=steps)
    ),
    "Reef knot (generated)": (
        "Reef knot", lambda quick, steps: knots.reef(120 if quick else 313, steps=steps)
    ),
    "Bowline (generated)": (
        "Bowline knot", lambda quick, steps: knots.bowline(120 if quick else 344, steps=steps)
    ),
}  # fmt: skip
SMALL = ("Funnel (generated)", "Reef knot (generated)", "Bowline (generated)")  # of the quick variants
COLOURS = {
    "Cloth on ball": "#9c2f35", "N-body": "#2f5d8c", "Funnel": "#c08a2e", "Funnel (generated)": "#d8b577",
    "Skirt (generated)": "#7a4f86", "Reef knot (generated)": "#3f7a57", "Bowline (generated)": "#8fb59c",
}  # fmt: skip


def suite(effort: Effort, *, steps: int = 3, quick: Sequence[str] = SMALL) -> Suite:
    """All benchmarks there are; the quick variant takes ``quick`` of the generated ones, small, of one step."""
    folder = data_folder()
    benchmarks, left_out = [], []
    for name, file in _FILES.items():
        path = None if folder is None else folder / "ccd" / f"{file}.npz"
        if effort.quick or path is None or not path.is_file():
            left_out.append(name)
            continue
        with np.load(path) as z:
            step = (z["V0"].astype(np.float64), z["V1"].astype(np.float64))
            benchmarks.append(Benchmark(name, name, PUBLISHED, z["F"].astype(np.int64), (step,)))
    for name, (thesis, make) in _MADE.items():
        if effort.quick and name not in quick:
            left_out.append(name)
            continue
        moving = make(effort.quick, 1 if effort.quick else steps)
        benchmarks.append(Benchmark(name, thesis, GENERATED, moving.triangles, moving.steps))
    why = (
        "the quick variant takes small generated benchmarks"
        if effort.quick
        else f"no data: {VARIABLE} names their folder"
    )
    return Suite(tuple(benchmarks), tuple(left_out), why, effort.quick)
