"""Install the wheel into clean environments and use it there; build another wheel from the source distribution.

For each Python 3.10 to 3.13 that the machine has: the package alone (commands, a shrunken demo, the message of each
missing extra, a typed user's script under mypy), then with all extras what each is for, the pages that people read
first, and part of the tests; on the newest one more of them. On the oldest one also with the oldest packages that the
metadata allows. Nothing of the checkout is on a path.

Run: python tools/wheel/check_installed.py DIST [--python 3.10 ...] [--quick]       (by `make wheel-test`)
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pages

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
VERSIONS = ("3.10", "3.11", "3.12", "3.13")
EXTRAS = ("usd", "view", "plot", "robot", "sweep")
# What package indices show, and what the documentation begins with.
PAGES = ("python/README.md", "docs/get-started.md")
# Tests that need neither Rust, nor the repository's folders, nor pictures.
SUITE = (
    "test_bending", "test_collision", "test_effects", "test_friction", "test_mesh", "test_recording",
    "test_restart", "test_scene", "test_session", "test_simulation", "test_steer",
)  # fmt: skip
# Those of the extras and of the command line, and what they need beyond the extras.
WIDER = (
    "test_animations", "test_cli", "test_export", "test_garments", "test_mesh_files", "test_moving_meshes",
    "test_robot", "test_sweep", "test_view", "test_view_fields",
)  # fmt: skip
HELPERS = ("conftest", "comparison", "disks", "study_scenes", "view_runs")
TEST_PACKAGES = ("pytest", "pytest-timeout", "trimesh", "pygltflib")
TYPED = """
import clothsim as cs

scene = cs.Scene(duration=0.1)
scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 5, 5), "cotton")
sim: cs.Simulation = cs.Simulation(scene)
sim.advance(0.01)
clock: float = sim.time
found: cs.collision.Detection = cs.collision.detect(sim.positions, sim.positions, sim.bodies[0].triangles)
print(clock, found.vertex_triangle.shape)
"""


def pythons(wanted: Sequence[str]) -> Iterator[tuple[str, str | None]]:
    """Each version with an interpreter of it, on the path or of pyenv, or None."""
    folders = [Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"]
    for version in wanted:
        found = shutil.which(f"python{version}")
        if found is None or not works(found):
            places = (p for folder in folders for p in sorted(folder.glob(f"{version}.*/bin/python")))
            found = next((str(p) for p in places if works(str(p))), None)
        yield version, found


def works(python: str) -> bool:
    """Whether the interpreter can make environments."""
    return subprocess.run([python, "-c", "import venv, ensurepip"], capture_output=True, check=False).returncode == 0


def environment(python: str, folder: Path, *packages: str) -> str:
    """Make an environment with these packages; returns its interpreter."""
    run([python, "-m", "venv", str(folder)], folder.parent)
    inside = str(folder / "bin" / "python")
    if packages:
        run([inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages], folder.parent)
    return inside


def run(command: Sequence[str], folder: Path, **more: str) -> str:
    """Run a command in a folder with nothing of this checkout on a path; its output, if it succeeds."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV", "MAKE"))}
    done = subprocess.run(
        command, cwd=folder, env={**kept, **more}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"check_installed: {' '.join(command)}: exit code {done.returncode}\n{done.stdout[-6000:]}")
    return done.stdout


def probe(python: str, folder: Path, stage: str, *extras: str) -> None:
    """Do one stage of `probe.py` in an empty folder."""
    work = folder / f"probe-{stage}-{len(list(folder.iterdir()))}"
    work.mkdir()
    shutil.copy(HERE / "probe.py", work)
    run([python, "-I", "probe.py", stage, *extras], work)


def first_pages(python: str, folder: Path) -> int:
    """Do what the first pages say, of each run two frames; how many blocks they have."""
    return sum(pages.follow(ROOT / name, folder / Path(name).stem, python, run, frames=2) for name in PAGES)


def typed(python: str, folder: Path) -> None:
    """Check a user's script against the installed types, with this interpreter's mypy; a wrong use has to be found."""
    for name, text, code in (("good", TYPED, 0), ("bad", TYPED.replace("clock: float", "clock: str"), 1)):
        (folder / f"{name}.py").write_text(text)
        command = [sys.executable, "-m", "mypy", "--strict", "--python-executable", python, f"{name}.py"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != code or "missing library stubs" in done.stdout:
            raise SystemExit(f"check_installed: mypy on {name}.py: exit code {done.returncode}\n{done.stdout}")


def suite(python: str, folder: Path, names: Sequence[str]) -> str:
    """Run these tests from a copy of them; their last line."""
    tests = folder / "copy" / "python" / "tests"
    tests.mkdir(parents=True)
    for name in [*names, *HELPERS]:
        shutil.copy(ROOT / "python" / "tests" / f"{name}.py", tests)
    for name in ("examples", "docs", "README.md", "REFERENCES.bib"):  # what tests read beside the package
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / "copy" / name)
    run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *TEST_PACKAGES], folder)
    marks = ["-m", "not slow and not data", "-p", "no:cacheprovider", "-q", "--timeout", "300"]
    config = folder / "copy" / "pytest.ini"
    warnings = "\n    ".join(_table("pyproject.toml")["tool"]["pytest"]["ini_options"]["filterwarnings"])
    config.write_text(f"[pytest]\nmarkers =\n    slow: slow\n    data: data\nfilterwarnings =\n    {warnings}\n")
    return run([python, "-m", "pytest", "-c", str(config), *marks, str(tests)], folder).strip().splitlines()[-1]


def _table(name: str) -> dict[str, Any]:
    import tomllib

    return tomllib.loads((ROOT / name).read_text())


def oldest(wheel: Path) -> list[str]:
    """The least versions that the metadata allows on the oldest Python."""
    import email
    import zipfile

    with zipfile.ZipFile(wheel) as archive:
        [name] = [n for n in archive.namelist() if n.endswith(".dist-info/METADATA")]
        metadata = email.message_from_bytes(archive.read(name))
    lines = [line for line in metadata.get_all("Requires-Dist", []) if "extra" not in line and ">= '3.13'" not in line]
    return [re.sub(r"([\w-]+)>=([\d.]+).*", r"\1==\2", line) for line in lines]


def from_sdist(python: str, sdist: Path, folder: Path) -> None:
    """Build a wheel from the source distribution as pip does, in an environment of its own, and use it."""
    target = ROOT / "target" / "sdist"  # so that the next time compiles clothsim alone
    # All files of the archive have one date: cargo would take the clothsim of the last time for that of this one.
    for known in target.glob("release/.fingerprint/cloth-*"):
        shutil.rmtree(known)
    inside = environment(python, folder / "build")
    wheels = folder / "wheels"
    command = [inside, "-m", "pip", "wheel", "--disable-pip-version-check", "--no-deps", "-w", str(wheels), str(sdist)]
    run(command, folder, CARGO_TARGET_DIR=str(target))
    [wheel] = wheels.glob("*.whl")
    probe(environment(python, folder / "use", str(wheel)), folder, "core")


def main() -> None:
    """Say what was done with which Python, and how long it took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dist", type=Path, help="folder with the wheel and the source distribution")
    parser.add_argument("--python", action="append", help="versions to try (default: all)")
    parser.add_argument("--quick", action="store_true", help="no extras, no tests, no source distribution")
    options = parser.parse_args()
    [wheel], [sdist] = options.dist.resolve().glob("*.whl"), options.dist.resolve().glob("*.tar.gz")
    found = list(pythons(options.python or VERSIONS))
    newest = next((version for version, python in reversed(found) if python is not None), None)
    if newest is None:
        raise SystemExit(f"check_installed: none of Python {', '.join(v for v, _ in found)} is on this machine")
    for version, python in found:
        if python is None:
            print(f"Python {version}: not on this machine, skipped", flush=True)
            continue
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            bare = environment(python, folder / "bare", str(wheel))
            probe(bare, folder, "core")
            probe(bare, folder, "missing", *EXTRAS)
            typed(bare, folder)
            done = "alone"
            if not options.quick:
                names = [*SUITE, *(WIDER if version == newest else ())]
                run([bare, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{wheel}[all]"], folder)
                probe(bare, folder, "present", *EXTRAS)
                done += f", all extras, first pages ({first_pages(bare, folder)} blocks)"
                done += f", tests: {suite(bare, folder, names)}"
            if version == VERSIONS[0]:
                probe(environment(python, folder / "oldest", str(wheel), *oldest(wheel)), folder, "core")
                done += f"; oldest packages: {' '.join(oldest(wheel))}"
        print(f"Python {version}: {done} ({time.perf_counter() - began:.0f} s)", flush=True)
    if not options.quick:
        began = time.perf_counter()
        python = dict(found)[newest]
        assert python is not None
        with tempfile.TemporaryDirectory() as name:
            from_sdist(python, sdist, Path(name))
        print(f"source distribution: builds a wheel that works ({time.perf_counter() - began:.0f} s)")


if __name__ == "__main__":
    main()
