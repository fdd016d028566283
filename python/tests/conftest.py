"""Fixtures shared by all tests."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import numpy as np
import pytest

import clothsim as cs
from clothsim._data import VARIABLE, data_folder

ROOT = Path(__file__).resolve().parents[2]

# A small cloth that falls on a ball: half a second, all stages at work, a second or two to run.
SCENE = """
name = "test"
duration = 0.5
[time]
dt = 0.005
[contact]
thickness = 0.006
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 17, ny = 17 }
material = "cotton"
position = [0.02, 0.42, 0.01]
[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.4, tolerance = 0.02 }
keyframes = [
    { time = 0.0, rotation = { axis = [0, 1, 0], angle = 0.0 } },
    { time = 0.5, rotation = { axis = [0, 1, 0], angle = 1.0 } },
]
[output]
fps = 30
usd = false
film_strip = false
plots = false
checkpoint_interval = 0.1
"""

GPU_METHODS = ["grid", "virtual-subdivision", "octree-single", "octree"]

RunCli = Callable[..., subprocess.CompletedProcess[str]]


def load_module(path: Path) -> ModuleType:
    """A Python file that is part of no package: a tool or an example."""
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up there
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def run_cli() -> RunCli:
    """Run the command line in a process of its own."""

    def run(*arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
        done: subprocess.CompletedProcess[str] = subprocess.run(
            cli_command(*arguments),
            capture_output=True,
            text=True,
            check=False,
            timeout=240,
            **options,  # type: ignore[call-overload]
        )
        return done

    return run


def cli_command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "clothsim", *map(str, arguments)]


@pytest.fixture(scope="session")
def ccd_data() -> Path:
    """The folder with the ground truth for collision detection."""
    folder = data_folder()
    if folder is None:
        if os.environ.get("CLOTHSIM_REQUIRE_DATA"):
            pytest.fail(f"no ground truth: set {VARIABLE}")
        pytest.skip(f"no ground truth: neither ${VARIABLE} nor ../shared/data is there")
    return folder / "ccd"


@pytest.fixture(scope="session")
def gpu() -> str:
    """Name of the adapter that detection finds; skips where there is none."""
    x = np.eye(3)
    try:
        found = cs.collision.detect(x, x, [[0, 1, 2]], "grid", device="gpu")
    except cs.GpuUnavailable as reason:
        without_gpu(reason)
    return str(found.stats["device"])


def without_gpu(reason: object) -> NoReturn:
    """Skip what needs an adapter and got none, or fail where there has to be one."""
    if os.environ.get("CLOTHSIM_REQUIRE_GPU") == "1":
        pytest.fail(f"CLOTHSIM_REQUIRE_GPU=1, but {reason}")
    pytest.skip(str(reason))
