"""The code blocks of the documentation: where they stand, and what it takes to run them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from conftest import ROOT

from clothsim import _toml

__all__ = ["Block", "blocks", "commands", "in_a_scene", "pages"]

_OPEN = re.compile(r"^(?P<indent> *)```(?P<language>[a-z]*)(?P<rest>[^`\n]*)$")
_NOT_RUN = re.compile(r"^ *<!-- not run: (?P<why>.+) -->$")


@dataclass(frozen=True)
class Block:
    """A fenced block: its page, line, language, title, text, and why it is not run (None: it is)."""

    page: Path
    line: int
    language: str
    title: str | None
    text: str
    not_run: str | None

    def __str__(self) -> str:
        page = self.page.relative_to(ROOT) if self.page.is_relative_to(ROOT) else self.page
        return f"{page}:{self.line}"


def pages() -> list[Path]:
    """All pages that people read: those of the repository's root and of ``docs``."""
    return [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "CHANGELOG.md")] + sorted(
        (ROOT / "docs").rglob("*.md")
    )


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page; one that is not closed is an error."""
    lines = page.read_text(encoding="utf-8").splitlines()
    number = 0
    while number < len(lines):
        opened = _OPEN.match(lines[number])
        if opened is None:
            assert "```" not in lines[number] or lines[number].count("```") % 2 == 0, f"{page}:{number + 1}"
            number += 1
            continue
        end = number + 1
        while lines[end].strip() != "```":
            end += 1
        indent = len(opened["indent"])
        text = "".join(line[indent:] + "\n" for line in lines[number + 1 : end])
        title = re.search(r'title="([^"]+)"', opened["rest"])
        mark = _NOT_RUN.match(lines[number - 1]) if number else None
        yield Block(page, number + 1, opened["language"], title and title[1], text, mark and mark["why"])
        number = end + 1


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words of each command of a shell block, comments left out."""
    for line in re.sub(r"\\\n\s*", " ", text).splitlines():
        words = shlex.split(line, comments=True)
        if words:
            yield words


def in_a_scene(text: str) -> dict[str, Any]:
    """Read a fragment of a scene file, and add what it needs to be a scene: meshes, shapes, places, named bodies."""
    scene = _toml.loads(text)
    scene.setdefault("duration", 0.1)
    mesh = {"generator": "grid", "width": 0.2, "height": 0.2, "nx": 5, "ny": 5}
    for k, cloth in enumerate(scene.setdefault("cloth", [{}])):
        apart = [float(k), 0.0, 0.0]
        for key, value in (("name", f"cloth-{k}"), ("mesh", mesh), ("material", "cotton"), ("position", apart)):
            cloth.setdefault(key, value)
    for k, collider in enumerate(scene.setdefault("collider", [])):
        collider.setdefault("name", f"collider-{k}")
        collider.setdefault("position", [float(k), 1.0, 0.0])
        if not {"shape", "mesh", "sequence"} & collider.keys():
            collider["shape"] = {"type": "sphere", "radius": 0.1}
    names = {body["name"] for body in scene["cloth"] + scene["collider"]}
    for pair in scene.get("contact", {}).get("pairs", []):
        missing = [name for name in pair["between"] if name not in names]
        scene["collider"] += [{"name": name, "shape": {"type": "sphere", "radius": 0.1}} for name in missing]
    return scene
