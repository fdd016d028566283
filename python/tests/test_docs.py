"""What the package says about itself: examples in docstrings, stubs, light imports, the table of errors."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

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
    heavy = {"matplotlib", "pyvista", "vtk", "vtkmodules", "pxr", "trimesh", "tqdm", "PIL"}
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
