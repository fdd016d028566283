"""What an installed clothsim has to do; run by `check_installed.py` with the Python of a clean environment.

Run: python -I probe.py STAGE [EXTRA ...]        in an empty folder, with no checkout on the path
"""

from __future__ import annotations

import importlib
import json
import logging
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import clothsim as cs

SCRIPTS = Path(sys.executable).parent
# What each extra is for, as a thing to do; without the extra it has to say how to get it.
MESH = (
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"
)


def command(*words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the installed command, which has to exit with this code."""
    done = subprocess.run([str(SCRIPTS / "clothsim"), *words], capture_output=True, text=True, check=False)
    assert done.returncode == code, f"clothsim {' '.join(words)}: exit code {done.returncode}\n{done.stderr}"
    return done


def frames() -> cs.Recording:
    """Two frames of a small cloth on a ball."""
    scene = cs.Scene(duration=0.05, contact={"thickness": 0.005})
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 11, 11), "cotton", position=(0.0, 0.51, 0.0))
    scene.add_collider("ball", shape={"type": "sphere", "radius": 0.5, "tolerance": 0.005})
    return cs.record(cs.Simulation(scene), fps=20, progress=False)


def load_stl() -> None:
    """Read a mesh, which needs no extra."""
    Path("one.stl").write_text(MESH)
    assert len(cs.Mesh.load("one.stl").triangles) == 1


def plots() -> None:
    """Run with plots."""
    command("example", "hanging", "-o", "plots.toml")
    text = Path("plots.toml").read_text().replace("[output]", "[output]\nplots = true\nfilm_strip = false\nusd = false")
    assert "plots = true" in text or "[output]" not in text
    if "[output]" not in text:
        text += "\n[output]\nplots = true\nfilm_strip = false\nusd = false\n"
    Path("plots.toml").write_text(text)
    done = subprocess.run(
        [str(SCRIPTS / "clothsim"), "run", "plots.toml", "-o", "plots", "--frames", "2", "--overwrite", "--quiet"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise cs.MissingDependency(done.stderr)
    assert Path("plots/plots.png").stat().st_size > 10_000


def gymnasium() -> None:
    """What the environment of the examples imports."""
    try:
        importlib.import_module("gymnasium")
    except ImportError as error:
        raise cs.MissingDependency("clothsim[robot]") from error


def sweep() -> None:
    """Two runs on processes of this machine, and their table."""
    scene = cs.Scene(duration=0.02, time={"dt": 0.005})
    scene.add_cloth(cs.Mesh.grid(0.4, 0.4, 5, 5), "silk", pins=[{"vertices": [0, 4]}])
    found = cs.sweep.run(scene, {"fabric": ["cotton", "silk"]}, metrics=["lowest"], out="sweep", progress=False)
    assert [row["status"] for row in found.rows()] == ["ok", "ok"], found.rows()
    parquet = importlib.import_module("pyarrow.parquet")
    assert parquet.read_table("sweep/runs.parquet")["fabric"].to_pylist() == ["cotton", "silk"]


def looks() -> None:
    """Run, and look at it: a still, coloured; a page for browsers; plots; without a display."""
    command("example", "hanging", "-o", "looks.toml")
    command("run", "looks.toml", "-o", "looks", "--frames", "2", "--quiet")
    command("view", "looks", "--still", "strain.png", "--color", "strain", "--size", "160x120", "--quiet")
    command("view", "looks", "--browser", "--quiet")
    command("view", "looks", "--plots", "plots.svg", "--quiet")
    for name, least in (("strain.png", 1000), ("looks/view.html", 50_000), ("plots.svg", 5000)):
        assert Path(name).stat().st_size > least, name
    assert "</html>" in Path("looks/view.html").read_text()[-20:], "the page's parts come with the wheel"


USES: dict[str, Callable[[], object]] = {
    "usd": lambda: frames().save_usd("scene.usdc"),
    "view": lambda: frames().film_strip("strip.png", moments=2),
    "plot": plots,
    "robot": gymnasium,
    "sweep": sweep,
}


def core() -> None:
    """Without extras: every module, both commands, a run of the demo, messages for what is missing."""
    here = Path(cs.__file__).resolve()
    assert here.is_relative_to(Path(sys.prefix).resolve()), f"{here}: not the installed package"
    assert (here.parent / "py.typed").exists() and (here.parent / "_core.pyi").exists()
    names = [m.name for m in pkgutil.walk_packages(cs.__path__, "clothsim.") if not m.name.endswith("__main__")]
    for name in names:
        importlib.import_module(name)
    version = f"clothsim {cs.__version__}"
    assert command("--version").stdout.strip() == version
    module = subprocess.run(
        [sys.executable, "-I", "-m", "clothsim", "--version"], capture_output=True, text=True, check=True
    )
    assert module.stdout.strip() == version
    assert "example" in command("--help").stdout
    demo = command("example", "drape").stdout
    for key, value in {"film_strip": "false", "plots": "false", "usd": "false"}.items():
        demo = f"{demo}\n" if demo.endswith("\n") else demo
        lines = [line for line in demo.splitlines() if not line.startswith(f"{key} ")]
        demo = "\n".join(lines).replace("[output]", f"[output]\n{key} = {value}")
    demo = demo.replace("nx = 101, ny = 101", "nx = 21, ny = 21")
    Path("demo.toml").write_text(demo)
    report = json.loads(command("run", "demo.toml", "-o", "demo", "--frames", "3", "--json", "--device", "cpu").stdout)
    assert report["frame_count"] == 4, report
    again = cs.Recording.load("demo/frames.npz")
    assert len(again) == 4 and np.isfinite(again.positions(again.cloth[0], -1)).all()
    found = cs.collision.detect(np.eye(3), np.eye(3), np.array([[0, 1, 2]]))
    assert len(found.vertex_triangle) == 0
    load_stl()
    assert cs.study.axis_names() and "compdef" in command("completion", "zsh").stdout
    assert [type(h) for h in logging.getLogger("clothsim").handlers] == [logging.NullHandler]


def missing(extras: list[str]) -> None:
    """Without these extras: what they are for says how to get them."""
    for extra in extras:
        try:
            USES[extra]()
        except cs.MissingDependency as error:
            assert f"clothsim[{extra}]" in str(error), f"{extra}: {error}"
        else:
            raise AssertionError(f"{extra}: worked without the extra")


def present(extras: list[str]) -> None:
    """With these extras: what they are for works."""
    for extra in extras:
        USES[extra]()
    looks()


if __name__ == "__main__":
    stage, *rest = sys.argv[1:]
    {"core": lambda _: core(), "missing": missing, "present": present}[stage](rest)
