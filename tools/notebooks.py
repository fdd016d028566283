"""Run the notebooks and keep what they print and draw, so that they can be read without running them.

Run: python tools/notebooks.py [NOTEBOOK ...]      (default: all of examples/notebooks)
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "notebooks"
TIMEOUT = 120  # s, for a cell


def execute(path: Path) -> nbformat.NotebookNode:
    """Run a notebook in a kernel of this interpreter; raises ``CellExecutionError`` for a cell that fails."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=TIMEOUT, kernel_name="python3", record_timing=False,
        resources={"metadata": {"path": str(path.parent)}},
    )  # fmt: skip
    client.execute()
    return notebook


def main(names: list[str]) -> None:
    """Run and write them, and say how long each took and how large it is."""
    for path in [Path(name) for name in names] or sorted(FOLDER.glob("*.ipynb")):
        began = time.perf_counter()
        notebook = execute(path)
        notebook.metadata["language_info"] = {"name": "python"}  # without the version of this machine
        for cell in notebook.cells:
            cell["outputs"] = [o for o in cell.get("outputs", []) if o.get("name") != "stderr"]
            if cell.cell_type != "code":
                del cell["outputs"]
        nbformat.write(notebook, path)
        print(f"{path.name}: {time.perf_counter() - began:.1f} s, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
