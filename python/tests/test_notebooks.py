"""The notebooks run, and what they show is stored in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, load_module

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
LIMIT = 400e3  # bytes: pictures are small enough to be kept


def tool() -> Any:
    return load_module(ROOT / "tools" / "notebooks.py")


def shown(notebook: Any) -> list[list[str]]:
    """Kinds of output of each cell: text, picture, error."""
    kinds = []
    for cell in notebook.cells:
        outputs = [o for o in cell.get("outputs", []) if o.get("name") != "stderr"]
        kinds.append(sorted({"image/png" if "image/png" in o.get("data", {}) else o.output_type for o in outputs}))
    return kinds


def test_there_are_notebooks() -> None:
    assert {path.stem for path in NOTEBOOKS} >= {"first_drape", "what_accuracy_costs", "detect_collisions"}


@pytest.mark.filterwarnings("ignore")  # of the kernel's own packages
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_is_stored(path: Path) -> None:
    for module in ("nbclient", "ipykernel", "matplotlib", "pyvista", "pxr"):
        pytest.importorskip(module, reason="the extra 'dev' is not installed")
    import nbformat

    stored = nbformat.read(path, as_version=4)
    nbformat.validate(stored)
    assert path.stat().st_size < LIMIT
    assert any("image/png" in kinds for kinds in shown(stored)), "no picture is stored: make notebooks"
    assert shown(tool().execute(path)) == shown(stored), "run make notebooks"


@pytest.mark.filterwarnings("ignore")
def test_a_cell_that_fails_fails_the_test(tmp_path: Path) -> None:
    for module in ("nbclient", "ipykernel"):
        pytest.importorskip(module, reason="the extra 'dev' is not installed")
    import nbformat
    from nbclient.exceptions import CellExecutionError

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("assert 1 == 2, 'planted'")])
    nbformat.write(notebook, tmp_path / "bad.ipynb")
    with pytest.raises(CellExecutionError, match="planted"):
        tool().execute(tmp_path / "bad.ipynb")
