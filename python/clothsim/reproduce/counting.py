"""What a method of detection on a GPU takes on a benchmark: tests, registrations, memory, seconds; is it right."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim import collision
from clothsim._arrays import optional
from clothsim.reproduce import pictures
from clothsim.reproduce.benchmarks import SMALL, Benchmark, Suite, suite
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = [
    "GRID", "METHODS", "OCTREE", "SINGLE", "VIRTUAL", "Compared", "Counted", "agreement", "bars", "chosen", "compare",
    "count", "device_words", "foot", "left_out", "logarithmic", "million", "plain", "scenes", "shares",
]  # fmt: skip

GRID, VIRTUAL = "grid", "virtual-subdivision"
SINGLE, OCTREE = "octree-single", "octree"
_WHOLE = ("device", "upload", "merge")  # not stages of the device: the call as a whole, and what the host copies
_SOFTWARE = ("llvmpipe", "lavapipe", "swiftshader", "basic render")
_ARRAYS = ("vertex_triangle", "time_vertex_triangle", "edge_edge", "time_edge_edge")


@dataclass(frozen=True)
class Counted:
    """Means over a benchmark's steps.

    Attributes
    ----------
    tests : float
        Broad-phase tests: pairs of triangles in one cell, duplicates included, before control bits or tokens.
    registrations, parts : float
        Of triangles in cells; what these come to, with the parts of subdivided ones where there are any.
    bytes : float
        On the device, the largest of the steps.
    contacts : int
        Of all steps.
    differing : int
        Steps whose contacts or times are not those of the CPU, bit for bit.
    seconds : dict
        By stage of the device and the narrow phase; of the fastest round.
    device : str
        As the driver calls it.
    """

    tests: float
    registrations: float
    parts: float
    bytes: float
    contacts: int
    differing: int
    seconds: dict[str, float]
    device: str

    @property
    def milliseconds(self) -> float:
        """All stages together."""
        return 1e3 * sum(self.seconds.values())


def count(
    benchmark: Benchmark,
    method: str,
    effort: Effort,
    *,
    mode: str = "continuous",
    rounds: int = 0,
    done: Callable[[], None] = lambda: None,
    **options: Any,
) -> Counted:
    """Detect in every step, once and ``rounds`` times more, which are then what is timed."""
    thickness = benchmark.thickness if mode == "discrete" else 0.0
    stats: list[dict[str, Any]] = []
    contacts = differing = 0
    for number, step in enumerate(benchmark.steps):
        fastest: dict[str, Any] = {}
        for turn in range(rounds + 1):
            found = collision.detect(
                *step, benchmark.triangles, method, mode, thickness, device="gpu", threads=effort.threads, **options
            )
            expected = benchmark.on_cpu(mode, number, effort.threads)
            same = all(np.array_equal(getattr(found, name), getattr(expected, name)) for name in _ARRAYS)
            if turn == min(1, rounds) or (turn > 1 and _seconds(found.stats) < _seconds(fastest)):
                fastest = found.stats
            done()
        contacts += len(found.vertex_triangle) + len(found.edge_edge)
        differing += not same
        stats.append(fastest)

    def mean(name: str) -> float:
        return float(np.mean([s[name] for s in stats]))

    names = dict.fromkeys(name for s in stats for name in s["seconds"] if name not in _WHOLE)
    parts = mean("parts") if "parts" in stats[0] else float(len(benchmark.triangles))
    seconds = {name: float(np.mean([s["seconds"].get(name, 0.0) for s in stats])) for name in names}
    return Counted(
        mean("broad_phase_tests"), mean("registrations"), parts, float(max(s["bytes"] for s in stats)), contacts,
        differing, seconds, str(stats[0]["device"]),
    )  # fmt: skip


def _seconds(stats: Mapping[str, Any]) -> float:
    return float(sum(s for name, s in stats["seconds"].items() if name not in _WHOLE))


def agreement(counted: Sequence[Counted]) -> list[Check]:
    """The contacts are those of the CPU; there are any."""
    reason = "contacts and times equal those of the tree on the CPU, bit for bit"
    return [
        Check("steps whose contacts are not those of the CPU", sum(c.differing for c in counted), 0.0, 0.0, reason),
        Check.true("there are contacts to find", all(c.contacts > 0 for c in counted), "each benchmark has some"),
    ]


@dataclass(frozen=True)
class Compared:
    """Counts of several methods on all benchmarks, by the names of both."""

    suite: Suite
    counts: dict[tuple[str, str], Counted]

    def times(self, name: str, one: str, other: str) -> float:
        """Tests of one method over those of another."""
        return self.counts[name, one].tests / self.counts[name, other].tests

    def table(self, column: str, ratio: Callable[[str, str], float]) -> dict[str, Table]:
        """One row per benchmark and method; ``column`` holds the ratio for the names of both."""
        columns = (
            "benchmark", "method", "broad-phase tests", column, "tests per triangle", "registrations",
            "memory on the device [MB]", "contacts",
        )  # fmt: skip
        triangles = {b.name: len(b.triangles) for b in self.suite.benchmarks}
        rows = [
            (name, method, c.tests, ratio(name, method), c.tests / triangles[name], c.registrations, c.bytes / 1e6,
             c.contacts)
            for (name, method), c in self.counts.items()
        ]  # fmt: skip
        return {"": Table(columns, rows)}


def compare(effort: Effort, methods: Sequence[str], figure: str, *, quick: Sequence[str] = SMALL) -> Compared:
    """Detect in each step of each benchmark, with each method."""
    found = suite(effort, quick=quick)
    with effort.bar(len(methods) * sum(len(b.steps) for b in found.benchmarks), figure, "call") as bar:
        counts = {
            (b.name, method): count(b, method, effort, done=bar.update) for b in found.benchmarks for method in methods
        }
    return Compared(found, counts)


def chosen(suite: Suite) -> dict[str, Any]:
    """Parameters: what was measured, and on what data."""
    found: dict[str, Any] = {
        b.name: f"{len(b.triangles)} triangles, {len(b.steps)} step{'s' if len(b.steps) > 1 else ''}, {b.source}"
        for b in suite.benchmarks
    }
    if suite.left_out:
        found["left out"] = f"{', '.join(suite.left_out)}: {suite.why}"
    found["tests"] = (
        "pairs of triangles that share a cell, duplicates included, before control bits or token positions; means over "
        "a benchmark's steps"
    )
    return found


def left_out(suite: Suite, text: str) -> str:
    """Add to a sentence what was left out."""
    return f"{text}; {suite.note}" if suite.left_out else text


def foot(suite: Suite, text: str) -> str:
    """Add to a picture's note what was left out."""
    return f"{text}\n{suite.note[0].upper()}{suite.note[1:]}." if suite.left_out else text


def device_words(device: str) -> str:
    """The device, and whether its times mean anything."""
    if any(word in device.lower() for word in _SOFTWARE):
        return f"{device.split(' (', maxsplit=1)[0]}, a software adapter: times are for the record"
    return device


def million(tests: float) -> str:
    """A count in words."""
    return f"{tests / 1e6:.3g} M" if tests < 1e9 else f"{tests / 1e6:,.0f} M"


def plain(number: float) -> str:
    """Three digits, without an exponent."""
    return f"{number:,.0f}" if number >= 1000.0 else f"{number:.3g}"


def shares(seconds: Mapping[str, float], groups: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """Share of each group of stages in all of them [%]; a stage of no group counts as other."""
    total = sum(seconds.values())
    of = {stage: group for group, stages in groups.items() for stage in stages}
    found = dict.fromkeys(groups, 0.0)
    for stage, s in seconds.items():
        group = of.get(stage, "other")
        found[group] = found.get(group, 0.0) + 100.0 * s / total
    return found


METHODS = {GRID: "#c9c5be", VIRTUAL: "#2f5d8c", SINGLE: "#c08a2e", OCTREE: "#9c2f35"}


def bars(
    axis: Any,
    suite: Suite,
    counts: Mapping[tuple[str, str], Counted],
    methods: Sequence[str],
    of: Callable[[Counted], float] = lambda counted: counted.tests,
) -> None:
    """Tests (or another number) of each method on each benchmark, on a logarithmic axis."""
    width = 0.8 / len(methods)
    for number, method in enumerate(methods):
        values = [of(counts[b.name, method]) for b in suite.benchmarks]
        places = np.arange(len(values)) + (number - 0.5 * (len(methods) - 1)) * width
        axis.bar(places, values, 0.94 * width, color=METHODS[method], label=method)
    logarithmic(axis)
    axis.legend(frameon=False, fontsize=9.5, loc="upper right")
    scenes(axis, [b.name for b in suite.benchmarks])


def logarithmic(axis: Any) -> None:
    """Let y go in decades, whole ones, with plain numbers up to 1,000."""
    low, high = axis.dataLim.y0 if axis.dataLim.y0 > 0.0 else axis.dataLim.minposy, axis.dataLim.y1
    axis.set_yscale("log")
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(1.3 * high))
    axis.set_ylim(10.0**first, 10.0**last)
    decades = range(first, last + 1)
    axis.set_yticks([10.0**k for k in decades], [f"{10**k:g}" if k < 4 else f"$10^{{{k}}}$" for k in decades])
    axis.yaxis.set_minor_locator(_nothing())


def _nothing() -> Any:
    return optional("matplotlib.ticker", extra="plot", purpose="drawing plots").NullLocator()


def scenes(axis: Any, names: Sequence[str]) -> None:
    """Write the benchmarks' names below bars."""
    size = 9.5 if len(names) < 6 else 8.5
    axis.set_xticks(range(len(names)), [name.replace(" (", "\n(") for name in names], fontsize=size)
    room = max(0.0, 0.5 * (3 - len(names)))  # one or two bars are no wider than those of three
    axis.set_xlim(-0.5 - room, len(names) - 0.5 + room)
    axis.tick_params(axis="x", length=0)
    axis.grid(axis="x", visible=False)
    axis.spines["bottom"].set_color(pictures.GRID)
