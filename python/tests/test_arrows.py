"""The crate arrows of ARCHITECTURE.md, and the tool that checks them."""

from __future__ import annotations

import copy
import json
import shutil
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from conftest import load_module

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    """Load tools/check_arrows.py, which is not part of a package."""
    return load_module(ROOT / "tools" / "check_arrows.py")


@pytest.fixture(scope="module")
def packages() -> list[dict[str, Any]]:
    """List the workspace's packages as cargo sees them."""
    if shutil.which("cargo") is None:
        pytest.skip("cargo is not on the PATH")
    out = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version", "1"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    found: list[dict[str, Any]] = json.loads(out.stdout)["packages"]
    return found


def test_the_workspace_keeps_to_the_arrows(tool: ModuleType, packages: list[dict[str, Any]]) -> None:
    """Find no arrow that the design does not allow."""
    assert tool.violations(packages) == []


@pytest.mark.parametrize(
    ("crate", "dependency"),
    [("cloth-mesh", "cloth-core"), ("cloth-py", "cloth-mesh"), ("cloth-sim", "pyo3"), ("cloth-sim", "faer")],
)
def test_a_planted_arrow_is_found(
    tool: ModuleType, packages: list[dict[str, Any]], crate: str, dependency: str
) -> None:
    """Complain about an arrow that is added where it is not allowed."""
    planted = copy.deepcopy(packages)
    next(p for p in planted if p["name"] == crate)["dependencies"].append({"name": dependency, "kind": None})
    found = tool.violations(planted)
    assert len(found) == 1
    assert found[0].startswith(f"{crate} -> {dependency}")
