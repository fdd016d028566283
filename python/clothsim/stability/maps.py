"""Coloured maps of verdicts."""

from __future__ import annotations

import io
import math
from typing import Any

from clothsim._arrays import optional
from clothsim.reproduce.pictures import FAINT, INK, figure
from clothsim.stability.atlas import Atlas, Map, value_text
from clothsim.stability.verdict import Verdict

__all__ = ["draw", "overview", "text"]

_COLUMNS = 6  # of the overview
_DARK = (Verdict.SILENT, Verdict.INTERSECTED, Verdict.CAUGHT, Verdict.STABLE, Verdict.TUNNELLED)


def text(own: Map) -> str:
    """The map in letters, for a terminal."""
    width = max(len(value_text(y)) for y in own.ys)
    columns = [max(3, len(value_text(x))) for x in own.xs]
    lines = [f"{own.case.name}: {own.case.title}"]
    for row in reversed(own.rows()):
        letters = "  ".join(c.judged.verdict.letter.rjust(w) for c, w in zip(row, columns, strict=True))
        lines.append(f"  {value_text(row[0].y):>{width}}  {letters}")
    below = "  ".join(value_text(x).rjust(w) for x, w in zip(own.xs, columns, strict=True))
    lines.append(f"  {'':>{width}}  {below}   {own.case.x.label} →, {own.case.y.label} ↑")
    return "\n".join(lines)


def draw(own: Map) -> tuple[bytes, bytes]:
    """PNG and SVG of one case."""
    size = (2.6 + 0.85 * len(own.xs) + 2.0, 1.9 + 0.5 * len(own.ys))
    made = figure(f"{own.case.name}: {own.case.title}", (max(size[0], 7.0), max(size[1], 3.0)))
    axis = made.subplots()
    _cells(axis, own, letters=True)
    axis.set_xlabel(own.case.x.label, color=INK)
    axis.set_ylabel(own.case.y.label, color=INK)
    _legend(axis, list(own.counts().items()))
    return _bytes(made)


def overview(atlas: Atlas) -> tuple[bytes, bytes]:
    """PNG and SVG of all cases in small."""
    columns = min(_COLUMNS, len(atlas.maps))
    rows = math.ceil(len(atlas.maps) / columns)
    note = f"{len(atlas.cells)} cells; {len(atlas.broken)} break a promise (black, red, orange, pink); {atlas.command}"
    made = figure("Stability atlas", (2.7 * columns + 0.4, 2.1 * rows + 1.1), note)
    axes = made.subplots(rows, columns, squeeze=False).ravel()
    for axis, own in zip(axes, atlas.maps, strict=False):
        _cells(axis, own, letters=False)
        axis.set_title(own.case.name, fontsize=9.5, color=INK, loc="left")
        axis.set_xlabel(own.case.x.name, fontsize=7.5, color=FAINT, labelpad=1)
        axis.set_ylabel(own.case.y.name, fontsize=7.5, color=FAINT, labelpad=1)
        axis.tick_params(labelsize=6, length=1.5, pad=1.5)
    for axis in axes[len(atlas.maps) :]:
        axis.set_axis_off()
    present = {v: sum(own.counts().get(v, 0) for own in atlas.maps) for v in Verdict}
    handles = _handles([(v, n) for v, n in present.items() if n])
    made.legend(handles=handles, loc="outside upper right", ncols=5, frameon=False, fontsize=9, labelcolor=INK)
    return _bytes(made)


def _cells(axis: Any, own: Map, *, letters: bool) -> None:
    patches = optional("matplotlib.patches", extra="plot", purpose="drawing maps")
    for j, row in enumerate(own.rows()):
        for i, cell in enumerate(row):
            verdict = cell.judged.verdict
            axis.add_patch(
                patches.Rectangle(
                    (i - 0.47, j - 0.46), 0.94, 0.92, facecolor=verdict.colour, lw=0.8,
                    edgecolor=FAINT if verdict is Verdict.UNKNOWN else verdict.colour,
                )
            )  # fmt: skip
            if letters:
                ink = "white" if verdict in _DARK else INK
                axis.text(i, j, _inside(verdict, cell.facts), ha="center", va="center", fontsize=8, color=ink)
    axis.set_xlim(-0.5, len(own.xs) - 0.5)
    axis.set_ylim(-0.5, len(own.ys) - 0.5)
    axis.set_xticks(range(len(own.xs)), [value_text(x) for x in own.xs])
    axis.set_yticks(range(len(own.ys)), [value_text(y) for y in own.ys])
    axis.tick_params(colors=INK, length=0)
    for spine in axis.spines.values():
        spine.set_visible(False)


def _inside(verdict: Verdict, facts: Any) -> str:
    """What stands in a cell: by how much the energy grew, how many pairs intersect, or how many retries it took."""
    if verdict is Verdict.GREW or (verdict is Verdict.SILENT and facts.get("finite", True)):
        return f"×{facts['growth']:.2g}"
    if verdict is Verdict.INTERSECTED:
        return f"{facts['intersections']}"
    if verdict is Verdict.STABLE:
        return f"{facts['retries']}↓" if facts.get("retries") else ""
    return verdict.letter


def _handles(counts: list[tuple[Verdict, int]]) -> list[Any]:
    patches = optional("matplotlib.patches", extra="plot", purpose="drawing maps")
    return [patches.Patch(facecolor=v.colour, edgecolor=FAINT, lw=0.5, label=f"{v.words} ({n})") for v, n in counts]


def _legend(axis: Any, counts: list[tuple[Verdict, int]]) -> None:
    axis.legend(
        handles=_handles(counts), loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=9,
        labelcolor=INK,
    )  # fmt: skip


def _bytes(made: Any) -> tuple[bytes, bytes]:
    png, svg = io.BytesIO(), io.BytesIO()
    made.savefig(png, format="png", dpi=110, facecolor="white", metadata={"Software": None})
    made.savefig(svg, format="svg", facecolor="white", metadata={"Date": None})
    return png.getvalue(), svg.getvalue()
