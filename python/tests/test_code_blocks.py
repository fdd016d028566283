"""Every code block of the documentation runs, page by page, from top to bottom, in a folder of its own.

Python blocks of a page share their names. A TOML block with a title is written to a file of that name and loaded; one
without is a part of a scene file. Shell lines run in their quick form. What cannot run says why, and there are few.
"""

from __future__ import annotations

import contextlib
import io
import json
import logging
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from code_blocks import Block, blocks, commands, in_a_scene, pages
from conftest import ROOT, without_gpu

import clothsim as cs
from clothsim import _core
from clothsim._cli import main
from clothsim.reproduce import find
from clothsim.sweep.file import read as read_sweep

PAGES = [page for page in pages() if any(True for _ in blocks(page))]
LANGUAGES = {"python", "sh", "toml", "json", "text"}
NOT_RUN_AT_MOST = 2

# Options that make a documented command quick; what it does stays the same.
QUICK = {
    "run": ["--quiet"],
    "export": ["--quiet"],
    "study": ["--repeats", "1", "--quiet"],
    "tune": ["--repeats", "1", "--quiet"],
    "stability": ["--quick", "--quiet"],
    "sweep": ["--quiet"],
    "reproduce": ["--quick", "--quiet"],
}
# What is installed, built or measured for minutes: that the target or file is there is checked, not what it does.
TOOLS = {"make", "cargo", "source", "python", "pip", "valgrind", "chromium"}


def test_every_block_has_a_language_and_few_are_not_run() -> None:
    found = [block for page in pages() for block in blocks(page)]
    assert {block.language for block in found} <= LANGUAGES, Counter(block.language for block in found)
    not_run = [block for block in found if block.not_run]
    assert len(not_run) <= NOT_RUN_AT_MOST, [f"{block}: {block.not_run}" for block in not_run]
    assert len(found) > 60


@pytest.fixture(autouse=True)
def logging_as_it_was() -> Iterator[None]:
    """A page that turns logging on does it for itself."""
    root, package = logging.getLogger(), logging.getLogger("clothsim")
    level, handlers = package.level, root.handlers[:]
    yield
    package.setLevel(level)
    root.handlers[:] = handlers


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_blocks_of_a_page_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page):
        if block.not_run:
            continue
        try:
            _run(block, names)
        except cs.GpuUnavailable as reason:
            without_gpu(reason)
        except Exception as error:
            raise AssertionError(f"{block}: {error}") from error


def _run(block: Block, names: dict[str, Any]) -> None:
    if block.language == "python":
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(block.text, str(block), "exec"), names)
    elif block.language == "json":
        json.loads(block.text)
    elif block.language == "toml" and block.title and "[vary]" in block.text:
        Path(block.title).write_text(block.text)
        read_sweep(block.title)
    elif block.language == "toml" and block.title:
        Path(block.title).write_text(_without_pictures(block.text))
        cs.Scene.load(block.title)
    elif block.language == "toml":
        scene = cs.Scene(**in_a_scene(block.text))
        scene.check()
        cs.Simulation(scene, device="cpu")
    elif block.language == "sh":
        for words in commands(block.text):
            _command(words)


def _without_pictures(scene: str) -> str:
    """The file without what takes seconds to draw: `test_export` looks at pictures."""
    for key in ("film_strip", "plots"):
        scene = scene.replace(f"\n{key} = true", f"\n{key} = false")
    extra = "".join(f"{key} = false\n" for key in ("film_strip", "plots", "usd") if f"\n{key} =" not in scene)
    head, mark, tail = scene.partition("[output]\n")
    return head + mark + extra + tail if mark else f"{scene}\n[output]\n{extra}"


def _command(words: list[str]) -> None:
    if words[0] in TOOLS:
        _tool(words)
        return
    assert words[0] == "clothsim", f"no rule for {words}"
    name = words[1]
    quick = [option for option in QUICK.get(name, []) if option not in words]
    if name == "run" and words[2].startswith("examples/"):
        words = [*words[:2], str(_shortened(Path(words[2]))), *words[3:]]
    if name == "reproduce" and "-o" in words and words[2] != "4.7":
        find(words[2]).load()  # test_reproduce runs the quick variant of each
        return
    if name == "view":  # of two frames; `test_view` looks at pictures
        words = ["1" if before == "--frame" else word for before, word in zip(["", *words], words, strict=False)]
        quick = ["--size", "160x100", "--fps", "5", "--quiet"]
    if name == "sweep" and words[2].startswith("examples/"):
        quick.append("--dry-run")
    if name == "run" and "--resume" not in words:
        quick.append("--overwrite")
    if name in ("study", "tune"):
        words = [word.replace("duration=0.2", "duration=0.05") for word in words]
        if name == "tune":
            words[words.index("--error") + 1] = "20mm"
        quick += ["--sample", "3"] if name == "study" else []
        quick += [] if "resolution=9" in words else ["--set", "resolution=9"]
        quick += [] if name == "study" or "--vary" in words else ["--vary", "integrator=implicit-euler,midpoint"]
    if "--list" in words:
        quick = []
    said = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        code = main([*words[1:], *quick])
    if code and "adapter" in said.getvalue() and not json.loads(_core.gpu_adapters()[0]):
        raise cs.GpuUnavailable(said.getvalue())
    assert code == 0, f"{' '.join(words)} ended with {code}: {said.getvalue()}"


def _shortened(example: Path) -> Path:
    """A copy of an example that ends after two frames and draws nothing; `test_examples` runs the whole ones."""
    keys = cs.Scene.load(example).to_dict()
    keys["duration"] = 2 / keys["output"]["fps"]
    keys["output"] |= {"film_strip": False, "plots": False, "usd": False}
    scene = cs.Scene(**keys)
    copy = example.parent.parent / example.name
    scene.save(copy)
    return copy


def _tool(words: list[str]) -> None:
    if words[0] == "make":
        targets = (ROOT / "Makefile").read_text()
        for target in words[1:]:
            assert f"\n{target}: " in targets, f"make {target}: there is no such target"
    for word in words[1:]:
        if word.endswith((".py", ".toml", ".md")) and "/" in word:
            assert (ROOT / word).exists(), f"{' '.join(words)}: {word} is not there"


def test_a_block_that_fails_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted faults, one per language."""
    monkeypatch.chdir(tmp_path)
    faults = {
        "python": "import clothsim as cs\ncs.Mesh.gird(1.0, 1.0, 2, 2)\n",
        "toml": "[contact]\nfrictoin = 0.3\n",
        "sh": "clothsim plan nowhere.toml\n",
        "json": "{\n",
    }
    for language, text in faults.items():
        page = tmp_path / f"{language}.md"
        page.write_text(f"# A page\n\n```{language}\n{text}```\n")
        (block,) = blocks(page)
        assert (block.language, block.text) == (language, text)
        with (
            pytest.raises((AttributeError, cs.InvalidScene, AssertionError, json.JSONDecodeError)),
            contextlib.redirect_stderr(io.StringIO()),
        ):
            _run(block, {})
    assert shutil.which("make") is None or (ROOT / "Makefile").exists()
    with pytest.raises(AssertionError, match="no such target"):
        _tool(["make", "coffee"])


def test_the_page_on_formats_wrote_what_it_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = ROOT / "docs" / "formats.md"
    test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch)
    out = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert {"frames.npz", "obj", "pc2", "report.json", "scene.glb", "vtk"} <= set(out)
    assert (tmp_path / "later" / "report.json").exists()
    assert np.load(tmp_path / "out" / "frames.npz")["times"].shape == (13,)
