"""The price of an effect, where a page has ``<!-- price: NAME -->``: from README.md's table and the cost model.

``<!-- price table -->`` becomes the whole table.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
BEGIN, END = "<!-- effect prices: begin -->", "<!-- effect prices: end -->"

_ONE = re.compile(r"<!-- price: ([^>]*?) -->")
_ALL = "<!-- price table -->"


@dataclass(frozen=True)
class Price:
    """A row of the table."""

    effect: str
    scene: str
    milliseconds: str
    share: str
    memory: str
    by: str


def block() -> str:
    """The table as README.md has it, its caption included."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return text.split(BEGIN)[1].split(END)[0].strip()


def rows() -> dict[str, Price]:
    """The measured prices by effect."""
    lines = [line for line in block().splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {row[0]: Price(*row) for row in cells}


def model() -> dict[str, float]:
    """Nanoseconds per element, from which plans estimate."""
    path = ROOT / "crates" / "cloth-sim" / "src" / "cost_model.json"
    table: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))["nanoseconds"]
    return table


def fill(markdown: str) -> str:
    """Replace the marks of a page."""
    if _ALL in markdown:
        markdown = markdown.replace(_ALL, block())
    if not _ONE.search(markdown):
        return markdown
    table, nanoseconds = rows(), model()

    def one(match: re.Match[str]) -> str:
        lines = []
        for name in match[1].split(", "):
            price = table.get(name)
            if price is None and name not in nanoseconds:
                raise ValueError(f"{name}: neither the table of prices nor the cost model has it")
            lines.append(_line(name, price, nanoseconds.get(name)))
        head = ["| price | ms in a step | of the step | bytes | scene | ns per element |", "|---|--:|--:|--:|---|--:|"]
        return "\n".join(["", '<div class="price" markdown>', "", *head, *lines, "", "</div>", ""])

    return _ONE.sub(one, markdown)


def _line(name: str, price: Price | None, nanoseconds: float | None) -> str:
    estimate = "" if nanoseconds is None else f"{nanoseconds:g}"
    if price is None:
        return f"| {name} | – | – | – | – | {estimate} |"
    by = "" if price.by == "row" else " †"
    return f"| {name}{by} | {price.milliseconds} | {price.share} | {price.memory} | {price.scene} | {estimate} |"
