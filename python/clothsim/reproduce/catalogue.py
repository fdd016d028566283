"""Every figure and table of both papers, and its state."""

from __future__ import annotations

import difflib
import importlib
import re
from dataclasses import dataclass
from typing import cast

from clothsim.errors import InvalidInput
from clothsim.reproduce.contract import Reproduction

__all__ = ["CATALOGUE", "DRAWING", "INPUT", "PHOTOGRAPH", "REPRODUCED", "Entry", "find"]

THESIS = "Wong 2014"
SKIPPING = "Wong 2010"

REPRODUCED = "reproduced"
DRAWING = "drawing"
PHOTOGRAPH = "photograph"
INPUT = "input"


@dataclass(frozen=True)
class Entry:
    """A figure, a table, or a comparison that a paper makes in its text.

    Attributes
    ----------
    paper : str
        Wong 2014 (the thesis) or Wong 2010 (skipping frame session).
    kind : str
        figure, table or section.
    number : str
        As the paper counts.
    title : str
        What it shows.
    state : str
        ``"reproduced"``; ``"drawing"``, ``"photograph"`` or ``"input"`` (parameters, data sheets) where there is
        nothing to measure.
    module : str
        The module that reproduces it.
    """

    paper: str
    kind: str
    number: str
    title: str
    state: str
    module: str = ""

    @property
    def name(self) -> str:
        """What the command line calls it: ``4.7``, ``table-4.1``, ``2010-4``, ``2010-table-2``."""
        return self._prefix + ("" if self.kind == "figure" else f"{self.kind}-") + self.number

    @property
    def stem(self) -> str:
        """Beginning of its files' names: ``figure-4.7``."""
        return f"{self._prefix}{self.kind}-{self.number}"

    @property
    def _prefix(self) -> str:
        return "2010-" if self.paper == SKIPPING else ""

    @property
    def source(self) -> str:
        """What the comparison calls the paper."""
        return "paper" if self.paper == SKIPPING else "thesis"

    @property
    def command(self) -> str | None:
        """How to get it."""
        return f"clothsim reproduce {self.name} -o out/{self.stem}" if self.state == REPRODUCED else None

    def load(self) -> Reproduction:
        """Import the module that reproduces it.

        Raises
        ------
        InvalidInput
            There is none.
        """
        if self.state != REPRODUCED:
            known = ", ".join(entry.name for entry in CATALOGUE if entry.state == REPRODUCED)
            why = f"is {_ARTICLE[self.state]}: there is nothing to measure"
            expected = f"a figure or table that is reproduced ({known})"
            raise InvalidInput(
                f"FIGURE: {self.kind} {self.number} of {self.paper} {why}; reproduced are {known}",
                name="FIGURE", expected=expected, got=self.name,
            )  # fmt: skip
        return cast(Reproduction, importlib.import_module(f"clothsim.reproduce.{self.module}"))

    def facts(self) -> dict[str, str | None]:
        """The entry as a table for JSON."""
        return {
            "name": self.name, "paper": self.paper, "kind": self.kind, "number": self.number, "title": self.title,
            "state": self.state, "command": self.command,
        }  # fmt: skip


_ARTICLE = {DRAWING: "a drawing", PHOTOGRAPH: "a photograph", INPUT: "what an experiment was given"}


def _thesis(number: str, title: str, state: str = REPRODUCED, *, module: str = "", kind: str = "figure") -> Entry:
    return Entry(THESIS, kind, number, title, state, module)


def _skipping(number: str, title: str, state: str = REPRODUCED, *, module: str = "", kind: str = "figure") -> Entry:
    return Entry(SKIPPING, kind, number, title, state, module)


CATALOGUE = (
    _thesis("2.1", "In-plane and out-of-plane deformation", DRAWING),
    _thesis("3.1", "A linear spring for force computation", DRAWING),
    _thesis("3.2", "2D plane coordinates used for in-plane deformation of a triangle", DRAWING),
    _thesis("3.3", "Cell types", DRAWING),
    _thesis("3.4", "A 2D example of the control bits scheme", DRAWING),
    _thesis("4.1", "Permanent wrinkles of cloth and results of simulation", PHOTOGRAPH),
    _thesis("4.2", "A bending element and the curvature-moment relationship of force loading", DRAWING),
    _thesis("4.3", "A typical bending hysteresis loop for woven fabrics", DRAWING),
    _thesis("4.4", "A bilinear bending hysteresis loop and three recovery cases", DRAWING),
    _thesis("4.5", "Moment change in a practical simulation system", DRAWING),
    _thesis("4.6", "The decrease in bending hysteresis", DRAWING),
    _thesis("4.7", "A full loop and partial cycles of bending, curvature against moment", module="figure_4_7"),
    _thesis("4.8", "A cloth twisted by a rotating rod, let go and spread out", module="figure_4_8"),
    _thesis("4.9", "A closed body of cloth squeezed by a shrinking box and let go", module="figure_4_9"),
    _thesis("4.10", "A figure in trousers sits down and stands up", module="figure_4_10"),
    _thesis("4.11", "A sphere hits a piece of hanging cloth, four bending laws", module="figure_4_11"),
    _thesis("4.12", "A walking figure in a skirt, four bending laws", module="figure_4_12"),
    _thesis("4.13", "Cloth clamped n times by two planes, then hung, two bending laws", module="figure_4_13"),
    _thesis("4.14", "Fatigue of one bending element on the fold, cycle by cycle", module="figure_4_14"),
    _thesis("4.1", "Running time and share of the bending component", module="table_4_1", kind="table"),
    _thesis("5.1", "The reef knot benchmark", module="figure_5_1"),
    _thesis("5.2", "Some well known triangle subdivision rules", DRAWING),
    _thesis("5.3", "Shorten the trajectory of the triangle", DRAWING),
    _thesis("5.4", "A new triangle ID list", DRAWING),
    _thesis("5.5", "Redundant cell-triangle registration", DRAWING),
    _thesis("5.6", "Scan to find out duplicate registrations", DRAWING),
    _thesis("5.7", "Most duplicate registrations are removed", DRAWING),
    _thesis("5.8", "Duplicate tests introduced by the virtual subdivision scheme", DRAWING),
    _thesis("5.9", "The workload distribution scheme", DRAWING),
    _thesis("5.10", "Benchmarks used for performance measuring", module="figure_5_10"),
    _thesis("5.11", "The flamenco benchmark", module="figure_5_11"),
    _thesis("5.12", "Broad phase tests for the cloth on ball benchmark with varying λ", module="figure_5_12"),
    _thesis("5.13", "Data of newly created child triangles for continuous collision detection", module="figure_5_13"),
    _thesis("5.14", "Broad phase tests: virtual subdivision against a traditional uniform grid", module="figure_5_14"),
    _thesis("5.15", "Time ratio of steps for N-body benchmark", module="figure_5_15"),
    _thesis("5.16", "Performance: virtual subdivision against a traditional uniform grid", module="figure_5_16"),
    _thesis("5.1", "The average timings of the virtual subdivision scheme method", module="table_5_1", kind="table"),
    _thesis("5.2", "Specifications of three different graphics cards", INPUT, kind="table"),
    _thesis("6.1", "A uniform subdivision technique and a non-uniform subdivision technique", DRAWING),
    _thesis("6.2", "The subdivision reduces the number of tests", DRAWING),
    _thesis("6.3", "The subdivision increases the number of tests", DRAWING),
    _thesis("6.4", "The limitation of a simple top-down scheme", DRAWING),
    _thesis("6.5", "The limitation of a simple bottom-up scheme", DRAWING),
    _thesis("6.6", "A 1D example of the two-stage scheme", DRAWING),
    _thesis("6.7", "The pipeline of the CD algorithm", DRAWING),
    _thesis("6.8", "Benchmarks used for performance measuring", module="figure_6_8"),
    _thesis("6.9", "The reef knot benchmark for performance measuring", module="figure_6_9"),
    _thesis("6.10", "Average number of broad phase tests in several methods", module="figure_6_10"),
    _thesis("6.11", "Time proportions of each step for cloth on ball benchmark", module="figure_6_11"),
    _thesis("6.1", "The octree grid data", module="table_6_1", kind="table"),
    _thesis("6.2", "Timings of the octree grid method", module="table_6_2", kind="table"),
    _thesis("6.3", "Timings of the virtual subdivision scheme method", module="table_6_3", kind="table"),
    _thesis("7.1", "A contact model", DRAWING),
    _thesis("7.2", "Several friction models, force against velocity", module="figure_7_2"),
    _thesis("7.3", "A piece of cloth falls on an inclined plane, two friction laws", module="figure_7_3"),
    _thesis("7.4", "A walking figure in a skirt, two friction laws", module="figure_7_4"),
    _thesis("7.5", "A stick–slip experiment, displacement and velocity", module="figure_7_5"),
    _thesis("7.6", "Four cards on an inclined plane, one friction law each", module="figure_7_6"),
    _thesis("7.7", "The cards' displacement, velocity and friction over time", module="figure_7_7"),
    _thesis("7.8", "A cloth draped over an accelerating rotating sphere", module="figure_7_8"),
    _thesis("7.1", "Values of parameters used in experiments", INPUT, kind="table"),
    _thesis("7.2", "Running time of collision response by friction law", module="table_7_2", kind="table"),
    _skipping("1", "The feature assignment for two triangles", DRAWING),
    _skipping("2", "The changes of a triangle's normal vector; its canonical cone", DRAWING),
    _skipping("3", "Movement without collision", DRAWING),
    _skipping(
        "4", "Expected free movement distance; probability of penetration free movement", module="skipping_figure_4"
    ),
    _skipping("5", "Snapshots of experiment set one", module="skipping_figure_5"),
    _skipping("6", "Snapshots of experiment set two", module="skipping_figure_6"),
    _skipping(
        "7", "Experiment set two: performance statistics of animation two, three and four", module="skipping_figure_7"
    ),
    _skipping("1", "The model complexities", module="skipping_table_1", kind="table"),
    _skipping("2", "Performance statistics of experiment set one", module="skipping_table_2", kind="table"),
    _skipping("9.3", "Comparison with other methods: spinning ball", module="skipping_section_9_3", kind="section"),
)


def find(name: str) -> Entry:
    """Return the entry of that name; ``"Figure 4.7"``, ``"fig-4.7"`` and ``"Table 4.1"`` are understood too.

    Raises
    ------
    InvalidInput
        The name is not known; the nearest known one is named.
    """
    wanted = re.sub(r"[\s_]+", "-", name.strip().lower())
    wanted = re.sub(r"^(2010-)?(figure|fig\.?)-?", r"\1", wanted)
    wanted = re.sub(r"(^|-)table-?(?=\d)", r"\1table-", wanted)
    names = {entry.name: entry for entry in CATALOGUE}
    if wanted in names:
        return names[wanted]
    near = difflib.get_close_matches(wanted, names, n=1, cutoff=0.0)[0]
    expected = "a name that clothsim reproduce --list names"
    raise InvalidInput(
        f"FIGURE: expected {expected}, got {name!r} (did you mean {near!r}?)",
        name="FIGURE",
        expected=expected,
        got=name,
    )
