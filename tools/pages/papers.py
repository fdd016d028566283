"""The papers' results beside ours, from docs/reproduction.json.

Where a page has ``<!-- comparison: NAMES -->`` each figure or table is a row with the paper's line and ours; where it
has ``<!-- table: NAME -->`` a table is printed whole, the paper's columns beside ours.

``python tools/pages/papers.py FOLDER MACHINE COMMIT`` writes that file from what ``clothsim reproduce NAME --json``
printed into ``FOLDER/NAME.json`` (``FOLDER/NAME-quick.json`` with ``--quick``) and from the CSV files that it names.
"""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
STORE = ROOT / "docs" / "reproduction.json"

_MARK = re.compile(r"<!-- comparison: (.*?) -->")
_TABLE = re.compile(r"<!-- table: (.*?) -->")
# Of the papers' tables: what a page shows, each of our columns before the paper's.
TABLES = {
    "table-4.1": (
        "hysteresis", "alpha", "bending [ms]", "thesis [ms]", "share of step [%]", "thesis [%]",
    ),
    "table-5.1": (
        "benchmark", "triangles", "thesis: triangles, thousands", "DCD [ms]", "thesis: DCD [ms]", "CCD [ms]",
        "thesis: CCD [ms]", "CCD tests",
    ),
    "table-6.1": (
        "benchmark", "level", "active in steps [%]", "thesis: active in steps [%]", "registrations [%]",
        "thesis: registrations [%]",
    ),
    "table-6.2": (
        "benchmark", "triangles", "DCD [ms]", "thesis: GTX 470 DCD [ms]", "thesis: GTX 780 DCD [ms]", "CCD [ms]",
        "thesis: GTX 470 CCD [ms]", "thesis: GTX 780 CCD [ms]", "CCD tests",
    ),
    "table-6.3": (
        "benchmark", "DCD [ms]", "thesis: DCD [ms]", "DCD speed-up", "thesis: DCD speed-up", "CCD [ms]",
        "thesis: CCD [ms]", "CCD speed-up", "thesis: CCD speed-up",
    ),
    "table-7.2": (
        "model", "over 5 s [s]", "thesis, 5 s [s]", "friction's share [%]", "thesis, share [%]",
    ),
    "2010-table-1": ("set", "animation", "what", "rigid", "rigid (paper)", "cloth", "cloth (paper)"),
    "2010-table-2": (
        "animation", "what", "variant", "time [ms]", "paper [ms]", "speed-up to NoDup", "paper's speed-up",
    ),
}  # fmt: skip


def load() -> dict[str, Any]:
    """What was measured: machine, commit, and per name the paper's line, ours, and the checks."""
    stored: dict[str, Any] = json.loads(STORE.read_text(encoding="utf-8"))
    return stored


def fill(markdown: str) -> str:
    """Replace the marks of a page."""
    if not (_MARK.search(markdown) or _TABLE.search(markdown)):
        return markdown
    stored = load()["results"]

    def one(match: re.Match[str]) -> str:
        wanted = match[1].split(", ")
        names = [name for name in stored if any(re.fullmatch(pattern, name) for pattern in wanted)]
        if not names:
            raise ValueError(f"comparison: nothing matches {match[1]!r}")
        lines = ["| | the paper | here | checks |", "|---|---|---|--:|"]
        lines += [_line(name, stored[name]) for name in names]
        return "\n".join(["", '<div class="comparison" markdown>', "", *lines, "", "</div>", ""])

    return _TABLE.sub(lambda match: _whole(match[1], stored), _MARK.sub(one, markdown))


def _whole(name: str, stored: dict[str, Any]) -> str:
    """A paper's table beside ours, with what made it."""
    if name not in TABLES or "table" not in stored.get(name, {}):
        raise ValueError(f"table: no such table in the store: {name!r}")
    result = stored[name]
    columns, *rows = result["table"]
    quick = " --quick" if result["quick"] else ""
    lines = [
        f"**{result['title']}**", "", "| " + " | ".join(_cell(name) for name in columns) + " |",
        "|---" * len(columns) + "|", *("| " + " | ".join(_cell(value) for value in row) + " |" for row in rows), "",
        f"`clothsim reproduce {name}{quick}` at {result['commit']}, {result['machine']}.",
    ]  # fmt: skip
    return "\n".join(["", *lines, ""])


def _line(name: str, result: dict[str, Any]) -> str:
    checks = result["checks"]
    passed = sum(check["passed"] for check in checks)
    mark = f"{passed} of {len(checks)}" if checks else "–"
    quick = " (quick variant)" if result["quick"] else ""
    return f"| `{name}`{quick} | {_cell(result['thesis'])} | {_cell(result['here'])} | {mark} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ").replace("*", "\\*").replace("_", "\\_")


def _read(name: str, path: Path) -> list[list[str]]:
    """The columns of a table that a page shows, from its CSV file; the first row has their names."""
    with path.open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(line for line in file if not line.startswith("#")))
    rows = [[_number(row[column]) for column in TABLES[name]] for row in found]
    if name == "table-6.1":  # levels with no registration in either
        rows = [row for row in rows if any(value not in ("0", "–") for value in row[2:])]
    return [list(TABLES[name]), *rows]


def _number(text: str) -> str:
    """Four digits of a number; a dash for none; other text as it is."""
    try:
        value = float(text)
    except ValueError:
        return text
    if math.isnan(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def collect(folder: Path, machine: str, commit: str) -> None:
    """Write the store from the outputs in a folder, in the catalogue's order; what it holds of others stays."""
    sys.path.insert(0, str(ROOT / "python"))
    from clothsim.reproduce import CATALOGUE

    results = load()["results"] if STORE.exists() else {}
    for path in folder.glob("*.json"):
        found = json.loads(path.read_text(encoding="utf-8"))
        keys = ("title", "thesis", "here", "checks")
        checks = [{key: check[key] for key in ("what", "passed")} for check in found["checks"]]
        kept: dict[str, Any] = {**{key: found[key] for key in keys}, "checks": checks, "quick": "-quick" in path.stem}
        if found["name"] in TABLES:
            main = next(Path(file) for file in found["files"] if file.endswith(f"{found['name']}.csv"))
            kept["table"] = _read(found["name"], main)
        results[found["name"]] = {**kept, "machine": machine, "commit": commit}
    order = [entry.name for entry in CATALOGUE]
    ordered = {name: results[name] for name in order if name in results}
    STORE.write_text(json.dumps({"results": ordered}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    collect(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
