"""The files of an atlas, each whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import shlex
from pathlib import Path

from clothsim._arrays import optional
from clothsim._files import write_whole
from clothsim.stability import maps
from clothsim.stability.atlas import Atlas, Cell, value_text
from clothsim.stability.verdict import Verdict

__all__ = ["FACTS", "FILES", "check_packages", "csv_text", "summary", "write"]

FACTS = "stability.json"
FILES = ("stability.json", "stability.csv", "README.md", "overview.png", "overview.svg")

_COLUMNS = (
    "verdict", "promised", "why", "time", "steps", "substeps", "retries", "growth", "growth_left", "intersections",
    "passed", "not_converged", "zones", "held_vertices", "cpu_seconds",
)  # fmt: skip


def check_packages() -> None:
    """Say what is missing before anything runs."""
    optional("matplotlib.figure", extra="plot", purpose="drawing maps")


def write(atlas: Atlas, out: Path) -> None:
    """Write tables and maps; the JSON last: then the atlas is complete."""
    for own in atlas.maps:
        for suffix, content in zip((".png", ".svg"), maps.draw(own), strict=True):
            write_whole(out / (own.case.name + suffix), content)
    for suffix, content in zip((".png", ".svg"), maps.overview(atlas), strict=True):
        write_whole(out / ("overview" + suffix), content)
    write_whole(out / "stability.csv", csv_text(atlas).encode())
    write_whole(out / "README.md", markdown(atlas, out).encode())
    write_whole(out / FACTS, json.dumps(atlas.facts(), indent=1, allow_nan=True).encode())


def csv_text(atlas: Atlas) -> str:
    """One row per cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["case", "x_name", "x", "y_name", "y", *_COLUMNS])
    for own in atlas.maps:
        for cell, facts in zip(own.cells, own.facts()["cells"], strict=True):
            values = [facts.get(name, "") for name in _COLUMNS]
            shown = [f"{v:.6g}" if isinstance(v, float) else v for v in values]
            writer.writerow([own.case.name, own.case.x.name, cell.x, own.case.y.name, cell.y, *shown])
    return text.getvalue()


def markdown(atlas: Atlas, out: Path) -> str:
    """The page of the atlas: one row per case."""
    beside = (out.resolve().parent / "docs" / "stability.md").exists()
    docs = "[docs/stability.md](../docs/stability.md)" if beside else "docs/stability.md"
    present = [v for v in Verdict if any(v in own.counts() for own in atlas.maps)]
    where = atlas.machine
    lines = [
        "# The stability atlas",
        "",
        f"Written by the command below on {where['processor']}, {where['cores']} cores, in {atlas.seconds:.0f} s.",
        f"What the verdicts mean and how to read a map: {docs}. Every cell is a row",
        "of [stability.csv](stability.csv).",
        "",
        "```sh",
        atlas.command,
        "```",
        "",
        "![all cases](overview.png)",
        "",
        f"{len(atlas.cells)} cells; in {len(atlas.broken)} of them a promise was broken"
        + (":" if atlas.broken else "."),
        "",
    ]
    lines += [f"- `{again(cell)}`: {cell.judged.verdict.words}, {cell.judged.why}" for cell in atlas.broken]
    lines += ["", "| case | over | cells | " + " | ".join(v.words for v in present) + " | map |"]
    lines.append("|---|---|" + "---:|" * (1 + len(present)) + "---|")
    for own in atlas.maps:
        counts = own.counts()
        numbers = " | ".join(str(counts.get(v, "")) for v in present)
        axes = f"{own.case.x.name} × {own.case.y.name}"
        name = own.case.name
        lines.append(f"| **{own.case.title}** | {axes} | {len(own.cells)} | {numbers} | [{name}]({name}.svg) |")
    for own in atlas.maps:
        lines += ["", f"## {own.case.title}", "", own.case.about, "", f"![{own.case.name}]({own.case.name}.png)"]
    return "\n".join(lines) + "\n"


def again(cell: Cell) -> str:
    """The command that runs one cell."""
    case = cell.case
    at = [f"{axis.name}={value_text(value)}" for axis, value in ((case.x, cell.x), (case.y, cell.y))]
    return shlex.join(["clothsim", "stability", case.name, "--at", at[0], "--at", at[1]])


def summary(atlas: Atlas) -> str:
    """Maps in letters, what the letters mean, and what was broken."""
    present = [v for v in Verdict if any(v in own.counts() for own in atlas.maps)]
    parts = [maps.text(own) for own in atlas.maps]
    parts.append("\n".join(f"  {v.letter} {v.words}" for v in present))
    total = {v: sum(own.counts().get(v, 0) for own in atlas.maps) for v in present}
    counted = ", ".join(f"{n} {v.words}" for v, n in total.items())
    parts.append(f"{len(atlas.cells)} cells in {atlas.seconds:.0f} s: {counted}")
    broken = [f"  {again(c)}\n    {c.judged.verdict.words}: {c.judged.why}" for c in atlas.broken]
    parts.append("\n".join(["promise broken:", *broken]) if broken else "no promise broken")
    return "\n\n".join(parts)
