"""What a study found: rows, references, the front, orders."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from clothsim.study.axes import Axis
from clothsim.study.metrics import Metric
from clothsim.study.points import Settings, label
from clothsim.study.reference import Reference

__all__ = ["COSTS", "Order", "Row", "Study", "Value"]

# What a point can cost: attribute of a row, unit, words.
COSTS = {
    "seconds": ("s", "wall-clock time"),
    "cpu_seconds": ("s", "processor time"),
    "peak_bytes": ("B", "memory at its peak"),
    "state_bytes": ("B", "memory of the effects"),
}


@dataclass(frozen=True)
class Value:
    """A metric at a point.

    Attributes
    ----------
    value : float or None
        The metric, over seeds its mean; None where the scene has no such number.
    error : float or None
        Its error; None where there is no reference.
    spread : float or None
        Standard deviation over seeds.
    resolved : bool
        The error is more than twice what the reference and the value are uncertain by.
    uncertain : float
        Standard error of the mean over seeds.
    """

    value: float | None
    error: float | None
    spread: float | None = None
    resolved: bool = True
    uncertain: float = 0.0

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "value": self.value,
            "error": self.error,
            "spread": self.spread,
            "resolved": self.resolved,
            "uncertain": self.uncertain,
        }


@dataclass(frozen=True)
class Row:
    """A point of a study.

    Attributes
    ----------
    settings : dict
        Value by axis.
    error : str or None
        Why it could not be run.
    values : dict of str to Value
        By metric.
    seconds, cpu_seconds : float or None
        Median over repeats, for the scene's whole duration [s].
    spread : float or None
        Largest less smallest time over the median.
    repeats : int
        Timed runs.
    peak_bytes, state_bytes : int or None
        What memory grew by at its peak, and what the effects of the scene hold.
    totals : dict
        Steps, retries, iterations and more.
    notes : list of str
        What is to be known of it.
    """

    settings: Settings
    error: str | None = None
    values: dict[str, Value] = field(default_factory=dict)
    seconds: float | None = None
    cpu_seconds: float | None = None
    spread: float | None = None
    repeats: int = 0
    peak_bytes: int | None = None
    state_bytes: int | None = None
    totals: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def label(self) -> str:
        """Its settings in a few words."""
        return label(self.settings)

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "settings": self.settings, "error": self.error, "values": {k: v.facts() for k, v in self.values.items()},
            "seconds": self.seconds, "cpu_seconds": self.cpu_seconds, "spread": self.spread, "repeats": self.repeats,
            "peak_bytes": self.peak_bytes, "state_bytes": self.state_bytes, "totals": self.totals, "notes": self.notes,
        }  # fmt: skip


@dataclass(frozen=True)
class Order:
    """Order at which errors fall along an axis, all other settings fixed."""

    axis: str
    settings: Settings
    order: float

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {"axis": self.axis, "settings": self.settings, "order": round(self.order, 3)}


@dataclass(frozen=True, eq=False)
class Study:
    """A finished study.

    Attributes
    ----------
    name : str
        Of the scene.
    axes : list of Axis
        What was varied.
    fixed : dict
        What was set for all runs.
    metrics : list of Metric
        The first one is what the front and the plot are about.
    cost : str
        What the front and the plot weigh it against: a key of `COSTS`.
    rows : list of Row
        Every point, those that failed included.
    references : list of (settings, Reference)
        One per problem: values of the axes that change what is asked, and what their runs are compared with.
    front : list of int
        Rows that no other beats, cheapest first.
    orders : list of Order
        Measured orders of convergence.
    converged : bool
        Whether the references can be trusted (`statement` says why).
    statement : list of str
        What is to be known before reading a number.
    machine : dict
        Where it ran.
    command : str
        How to run it again.
    digest : str
        Fingerprint of the scene and of what was asked.
    duration : float
        Simulated time of a run [s].
    out : Path or None
        Where it was written.
    files : list of Path
        What was written.
    seconds : float
        Wall-clock time of all.
    per_point : int
        Runs of each point: more than one with seeds.
    """

    name: str
    axes: list[Axis]
    fixed: Settings
    metrics: list[Metric]
    cost: str
    rows: list[Row]
    references: list[tuple[Settings, Reference]]
    front: list[int]
    orders: list[Order]
    converged: bool
    statement: list[str]
    machine: dict[str, Any]
    command: str
    digest: str
    duration: float = 0.0
    out: Path | None = None
    files: list[Path] = field(default_factory=list)
    seconds: float = 0.0
    per_point: int = 1

    @property
    def metric(self) -> Metric:
        """What the front is about."""
        return self.metrics[0]

    def own_error(self, row: Row, metric: str | None = None) -> float:
        """How far the reference of a row may itself be off; 0 where the metric needs none.

        Parameters
        ----------
        row : Row
            A row of this study.
        metric : str, optional
            A metric's name; by default the one of the front.
        """
        name = metric or self.metric.name
        for problem, reference in self.references:
            if all(row.settings.get(k) == v for k, v in problem.items()):
                return reference.errors.get(name) or 0.0
        return 0.0

    def best(self) -> list[Row]:
        """The rows of the front."""
        return [self.rows[k] for k in self.front]

    def facts(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "name": self.name, "command": self.command, "digest": self.digest, "duration": self.duration,
            "axes": [a.facts() for a in self.axes], "fixed": self.fixed, "cost": self.cost,
            "metrics": [{"name": m.name, "unit": m.unit, "meaning": m.meaning} for m in self.metrics],
            "converged": self.converged, "statement": self.statement,
            "references": [{"problem": problem, **reference.facts()} for problem, reference in self.references],
            "orders": [order.facts() for order in self.orders],
            "front": self.front, "rows": [row.facts() for row in self.rows],
            "machine": self.machine, "seconds": round(self.seconds, 3), "runs_per_point": self.per_point,
        }  # fmt: skip
