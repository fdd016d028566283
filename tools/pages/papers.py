"""The papers' results beside ours, where a page has ``<!-- comparison: PAPER -->``: from docs/reproduction.json.

``python tools/pages/papers.py FOLDER`` writes that file from what ``clothsim reproduce NAME --json`` printed into
``FOLDER/NAME.json``.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
STORE = ROOT / "docs" / "reproduction.json"

_MARK = re.compile(r"<!-- comparison: (.*?) -->")


def load() -> dict[str, Any]:
    """What was measured: machine, commit, and per name the paper's line, ours, and the checks."""
    stored: dict[str, Any] = json.loads(STORE.read_text(encoding="utf-8"))
    return stored


def fill(markdown: str) -> str:
    """Replace the marks of a page."""
    if not _MARK.search(markdown):
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

    return _MARK.sub(one, markdown)


def _line(name: str, result: dict[str, Any]) -> str:
    checks = result["checks"]
    passed = sum(check["passed"] for check in checks)
    mark = f"{passed} of {len(checks)}" if checks else "–"
    quick = " (quick variant)" if result["quick"] else ""
    return f"| `{name}`{quick} | {_cell(result['thesis'])} | {_cell(result['here'])} | {mark} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ").replace("*", "\\*").replace("_", "\\_")


def collect(folder: Path, machine: str, commit: str) -> None:
    """Write the store from the outputs in a folder, in the catalogue's order; what it holds of others stays."""
    sys.path.insert(0, str(ROOT / "python"))
    from clothsim.reproduce import CATALOGUE

    results = load()["results"] if STORE.exists() else {}
    for path in folder.glob("*.json"):
        found = json.loads(path.read_text(encoding="utf-8"))
        keys = ("title", "thesis", "here", "checks")
        checks = [{key: check[key] for key in ("what", "passed")} for check in found["checks"]]
        kept = {**{key: found[key] for key in keys}, "checks": checks, "quick": "-quick" in path.stem}
        results[found["name"]] = {**kept, "machine": machine, "commit": commit}
    order = [entry.name for entry in CATALOGUE]
    ordered = {name: results[name] for name in order if name in results}
    STORE.write_text(json.dumps({"results": ordered}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    collect(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
