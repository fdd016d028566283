"""What the package says about itself: examples in docstrings, stubs, light imports, the table of errors."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT

import clothsim as cs

MODULES = sorted(m.name for m in pkgutil.walk_packages(cs.__path__, "clothsim.") if not m.name.endswith("__main__"))
WITH_EXAMPLES = {
    "clothsim",
    "clothsim.collision",
    "clothsim.material",
    "clothsim.mesh",
    "clothsim.scene",
    "clothsim.simulation",
}


@pytest.mark.parametrize("name", ["clothsim", *MODULES])
def test_docstring_examples_run(name: str) -> None:
    module = importlib.import_module(name)
    result = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0
    assert (result.attempted > 0) or name not in WITH_EXAMPLES, "the examples are gone"


def test_the_stub_says_what_the_module_has() -> None:
    pytest.importorskip("mypy", reason="the extra 'dev' is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "clothsim._core"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_importing_is_light() -> None:
    heavy = {"matplotlib", "pyvista", "vtk", "vtkmodules", "pxr", "trimesh", "tqdm", "PIL", "distributed", "pyarrow"}
    code = "import sys, clothsim, clothsim._cli; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert heavy.isdisjoint(loaded)


def test_all_names_exist_and_are_documented() -> None:
    for name in cs.__all__:
        value = getattr(cs, name)
        if name not in {"__version__", "materials"}:
            assert (value.__doc__ or "").strip(), name
    assert (Path(cs.__file__).parent / "py.typed").exists()
    assert (Path(cs.__file__).parent / "_core.pyi").exists()


def test_every_error_has_its_place_in_the_tree() -> None:
    tree = {
        "ClothSimError": (Exception,),
        "InvalidInput": (cs.ClothSimError, ValueError),
        "InvalidScene": (cs.ClothSimError, ValueError),
        "MeshError": (cs.ClothSimError, ValueError),
        "IntersectingStart": (cs.ClothSimError, ValueError),
        "CheckpointError": (cs.ClothSimError, ValueError),
        "SimulationDiverged": (cs.ClothSimError,),
        "SimulationStuck": (cs.ClothSimError,),
        "SolverFailed": (cs.ClothSimError,),
        "DeviceError": (cs.ClothSimError, RuntimeError),
        "GpuUnavailable": (cs.DeviceError,),
        "ClusterError": (cs.ClothSimError, ConnectionError),
        "MissingDependency": (cs.ClothSimError, ImportError),
        "OutputError": (cs.ClothSimError, OSError),
        "OutputExists": (cs.ClothSimError, FileExistsError),
    }
    assert sorted(tree) == sorted(cs.errors.__all__)
    for name, bases in tree.items():
        assert getattr(cs.errors, name).__bases__ == bases
        assert getattr(cs, name) is getattr(cs.errors, name)


def test_the_published_schema_is_the_present_one() -> None:
    schema = subprocess.run(
        [sys.executable, "-m", "clothsim", "schema"], capture_output=True, text=True, check=True
    ).stdout
    assert (ROOT / "docs" / "scene.schema.json").read_text() == schema, "run `make schema`"


def test_the_table_of_methods_has_every_method() -> None:
    """A detector that is added is in the documentation, the schema and the error that lists them."""
    with pytest.raises(cs.InvalidInput) as caught:
        cs.collision.detect(np.eye(3), np.eye(3), [[0, 1, 2]], "none")
    known = set(caught.value.expected.removeprefix("one of ").split(" (")[0].replace('"', "").split(", "))
    table = (ROOT / "docs" / "gpu.md").read_text().split("|---|---|---|\n")[1].split("\n\n")[0]
    listed = {name for row in table.splitlines() for name in row.split("|")[1].replace("`", "").split('"')[1::2]}
    assert listed == known
    schema = (ROOT / "docs" / "scene.schema.json").read_text()
    assert all(f'\\"{name}\\"' in schema for name in known)


def _on_reference_pages() -> dict[str, Any]:
    """The objects of docs/api, by their full names."""
    found: dict[str, Any] = {}
    for page in sorted((ROOT / "docs" / "api").glob("*.md")):
        for name in re.findall(r"^::: (\S+)$", page.read_text(), flags=re.MULTILINE):
            module, _, last = name.rpartition(".")
            value = importlib.import_module(name) if name == "clothsim.errors" else None
            value = value or getattr(importlib.import_module(module), last)
            if inspect.ismodule(value):
                found |= {f"{name}.{inner}": getattr(value, inner) for inner in value.__all__}
            else:
                found[name] = value
    return found


def _callables(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """A function, or a class and its public methods."""
    yield name, value
    for key, member in vars(value).items() if inspect.isclass(value) else ():
        method = getattr(member, "__func__", member)
        if not key.startswith("_") and (inspect.isfunction(method) or isinstance(method, property)):
            yield f"{name}.{key}", method


def _undocumented(value: Any) -> list[str]:
    """Parameters that the docstring's numpy sections do not name; everything if there is none."""
    text = inspect.getdoc(value) or ""
    if isinstance(value, property):
        return [] if text else ["a docstring"]
    if inspect.isclass(value) and not inspect.isfunction(value.__init__):  # a built-in's: nothing of ours to name
        return [] if text else ["a docstring"]
    given = [p.name for p in inspect.signature(value).parameters.values() if p.name not in ("self", "cls")]
    heads = re.findall(r"^(\*{0,2}\w[\w, *]*?)(?: : .*)?$", text, flags=re.MULTILINE)
    named = {part.strip().lstrip("*") for head in heads for part in head.split(",")}
    if inspect.isclass(value) and issubclass(value, Exception):
        named.add("message")
    return [name for name in given if name not in named] if text else ["a docstring"]


def test_every_parameter_of_the_reference_is_documented() -> None:
    missing = {
        f"{name}: {', '.join(undocumented)}"
        for top, value in _on_reference_pages().items()
        for name, member in _callables(top, value)
        if (undocumented := _undocumented(member))
    }
    assert not missing, "\n".join(sorted(missing))


def test_every_public_name_is_in_the_reference() -> None:
    shown = list(_on_reference_pages().values())
    for module in (cs, cs.bending, cs.collision, cs.errors, cs.friction, cs.stability, cs.study):
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isclass(value) or inspect.isfunction(value):
                assert any(value is other for other in shown), f"{module.__name__}.{name} is on no page of docs/api"


def test_a_parameter_without_a_word_is_found() -> None:
    """Planted faults: a parameter that is left out, and one that only the prose names."""

    def said(width: float, *, height: float) -> None:
        """Make a thing of ``height``.

        Parameters
        ----------
        width : float
            Along x [m].
        """

    assert _undocumented(said) == ["height"]
    said.__doc__ = None
    assert _undocumented(said) == ["a docstring"]
