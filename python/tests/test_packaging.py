"""What the wheel rests on: old Pythons, light imports, a look at what is built that finds faults."""

from __future__ import annotations

import ast
import email
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, RunCli, load_module

import clothsim as cs
from clothsim import _core

PACKAGE = ROOT / "python" / "clothsim"


def tool(name: str) -> Any:
    return load_module(ROOT / "tools" / "wheel" / f"{name}.py")


# Names of the standard library that Python 3.10 has not.
LATER = {"tomllib", "StrEnum", "Self", "LiteralString", "ExceptionGroup", "TaskGroup", "assert_never", "UTC", "batched"}


def later(source: str) -> set[str]:
    """Names in a module that Python 3.10 would not know; raises ``SyntaxError`` for syntax that it would not."""
    tree = ast.parse(source, feature_version=(3, 10))
    names = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    names |= {a.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom | ast.Import) for a in node.names}
    return names & LATER


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_nothing_is_newer_than_python_3_10(path: Path) -> None:
    if path.name != "_toml.py":
        assert later(path.read_text()) == set()


def test_newer_things_would_be_found() -> None:
    assert later("import tomllib\nfrom typing import Self") == {"tomllib", "Self"}
    with pytest.raises(SyntaxError):
        later("type Number = int")


def loaded(code: str) -> set[str]:
    """Packages outside the standard library that a fresh interpreter has loaded after this."""
    code += "\nimport sys; print(*sorted({m.partition('.')[0] for m in sys.modules} - sys.stdlib_module_names))"
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    return {name for name in done.stdout.split() if not name.startswith("_")}


@pytest.mark.parametrize("code", ["import clothsim", "from clothsim._cli import build_parser; build_parser()"])
def test_importing_loads_numpy_alone(code: str) -> None:
    before = loaded("pass")  # what .pth files bring
    assert loaded(code) - before == {"clothsim", "numpy"}
    assert "matplotlib" in loaded(f"{code}; import matplotlib"), "a heavy import would be seen"


def test_every_example_that_stands_alone_comes_along() -> None:
    texts = {path.stem: path.read_text() for path in (ROOT / "examples").glob("*.toml")}
    scenes = {name: text for name, text in texts.items() if "[[cloth]]" in text and name != "sweep"}
    alone = {name: text for name, text in scenes.items() if not re.search(r"\.(ply|obj|usd)", text)}
    assert dict(_core.example_scenes()) == alone


def test_the_command_lists_and_prints_examples(tmp_path: Path, run_cli: RunCli) -> None:
    listed = run_cli("example").stdout.splitlines()
    assert [line.split()[0] for line in listed] == [name for name, _ in _core.example_scenes()]
    text = run_cli("example", "drape").stdout
    assert text == (ROOT / "examples" / "drape.toml").read_text()
    assert run_cli("example", "drape", "-o", tmp_path / "mine.toml").returncode == 0
    assert cs.Scene.load(tmp_path / "mine.toml").to_dict()["name"] == "drape"
    again = run_cli("example", "drape", "-o", tmp_path / "mine.toml")
    assert again.returncode == 2
    assert "is there already" in again.stderr
    unknown = run_cli("example", "drapery")
    assert unknown.returncode == 2
    assert "NAME: expected one of cantilever" in unknown.stderr


# The look at what is built -------------------------------------------------------------------------------------------

WHEEL = "clothsim-0.1.0-cp310-abi3-manylinux_2_35_x86_64.whl"
FILES = dict.fromkeys(
    (
        "clothsim/__init__.py", "clothsim/py.typed", "clothsim/_core.pyi", "clothsim/_core.abi3.so",
        "clothsim/_cli/__init__.py", "clothsim-0.1.0.dist-info/licenses/LICENSE-MIT",
        "clothsim-0.1.0.dist-info/licenses/LICENSE-APACHE", "clothsim-0.1.0.dist-info/METADATA",
    ),
    1000,
)  # fmt: skip


def metadata(change: str = "", to: str = "") -> Any:
    lines = [
        "Name: clothsim", "Summary: cloth", "Requires-Python: >=3.10", "License-Expression: MIT OR Apache-2.0",
        "License-File: LICENSE-MIT", "License-File: LICENSE-APACHE",
        "Description-Content-Type: text/markdown; charset=UTF-8; variant=GFM",
        *(f"Classifier: Programming Language :: Python :: 3.{k}" for k in (10, 11, 12, 13)),
        *(f"Provides-Extra: {extra}" for extra in ("usd", "view", "plot", "sweep", "robot", "all")),
    ]  # fmt: skip
    return email.message_from_string("\n".join(lines).replace(change, to) + "\n\nText\n")


def test_a_good_wheel_is_found_good() -> None:
    assert tool("check_dist").wheel_findings(WHEEL, FILES, metadata(), ["cp310-abi3-manylinux_2_35_x86_64"]) == []


@pytest.mark.parametrize(
    ("name", "files", "change", "finding"),
    [
        (WHEEL.replace("cp310-abi3", "cp311-cp311"), FILES, ("", ""), "stable ABI"),
        (WHEEL.replace("manylinux_2_35", "linux"), FILES, ("", ""), "manylinux"),
        (WHEEL, {k: v for k, v in FILES.items() if "py.typed" not in k}, ("", ""), "py.typed: missing"),
        (WHEEL, {k: v for k, v in FILES.items() if "MIT" not in k}, ("", ""), "LICENSE-MIT: missing"),
        (WHEEL, {**FILES, "clothsim/tests/test_a.py": 1}, ("", ""), "does not belong"),
        (WHEEL, {**FILES, "examples/drape.toml": 1}, ("", ""), "outside the package"),
        (WHEEL, FILES, (">=3.10", ">=3.11"), "Requires-Python"),
        (WHEEL, FILES, ("Python :: 3.12", "Python"), "no classifier"),
        (WHEEL, FILES, ("Provides-Extra: usd\n", ""), "no extra usd"),
    ],
)
def test_faults_of_a_wheel_are_found(name: str, files: dict[str, int], change: tuple[str, str], finding: str) -> None:
    tags = ["cp310-abi3-manylinux_2_35_x86_64"] if "manylinux" in name else []
    assert any(finding in line for line in tool("check_dist").wheel_findings(name, files, metadata(*change), tags))


def test_faults_of_a_source_distribution_are_found() -> None:
    check = tool("check_dist")
    lock = 'name = "cloth-sim"\nname = "cloth-benches"\n'
    good = dict.fromkeys(
        (
            "pyproject.toml", "PKG-INFO", "Cargo.toml", "Cargo.lock", "python/README.md", "examples/drape.toml",
            "LICENSE-MIT", "LICENSE-APACHE", "crates/cloth-sim/Cargo.toml", "crates/cloth-sim/src/lib.rs",
        ),
        1000,
    )  # fmt: skip
    locked = {"cloth-sim", "cloth-benches"}
    assert check.sdist_findings(good, ["cloth-sim"], lock, locked) == []
    for change, finding in (
        ({"crates/cloth-sim/tests/big.rs": 1}, "does not belong"),
        ({"crates/cloth-sim/src/table.rs": 10**6}, "1000 kB"),
    ):
        assert any(finding in line for line in check.sdist_findings({**good, **change}, ["cloth-sim"], lock, locked))
    assert check.sdist_findings(good, ["cloth-sim", "cloth-gpu"], lock, locked) != []
    assert check.sdist_findings(good, ["cloth-sim"], lock, {*locked, "wgpu"}) == ["Cargo.lock: not that of the tree"]
