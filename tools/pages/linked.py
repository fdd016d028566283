"""Files of the repository outside ``docs`` that pages link to: they become part of the site, under ``repository/``."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
PREFIX = "repository/"
# A page called README would become the index of its section of the navigation.
CONTENTS = "contents.md"
# Pages of the navigation that no other page need link to.
PAGES = ("ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "gallery/README.md", "stability/README.md")

_FENCE = re.compile(r"^(```|~~~).*?^\1\s*$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(\]\()([^)\s]+)(\))")


def repository_path(source: str) -> str:
    """Where a page of the site lies in the repository."""
    if not source.startswith(PREFIX):
        return f"docs/{source}"
    return re.sub(rf"(^|/){CONTENTS}$", r"\1README.md", source.removeprefix(PREFIX))


def site_path(path: str) -> str:
    """Where a file of the repository lies in the site."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return PREFIX + re.sub(r"(^|/)README\.md$", rf"\1{CONTENTS}", path)


def files(present: Files, config: MkDocsConfig) -> Iterator[File]:
    """Yield what the pages link to outside ``docs``, what that links to, and so on."""
    todo = [repository_path(file.src_uri) for file in present.documentation_pages()]
    todo += PAGES
    done = set(todo)
    for page in PAGES:
        yield File.generated(config, site_path(page), abs_src_path=str(ROOT / page))
    while todo:
        page = todo.pop()
        if not (ROOT / page).is_file():  # generated
            continue
        for target in _targets((ROOT / page).read_text(encoding="utf-8"), page):
            if target in done or target.startswith("docs/") or not (ROOT / target).is_file():
                continue
            done.add(target)
            yield File.generated(config, site_path(target), abs_src_path=str(ROOT / target))
            if target.endswith(".md"):
                todo.append(target)


def rewrite(markdown: str, source: str) -> str:
    """Point the relative links of a page to where the site has their targets."""
    page = repository_path(source)

    def one(match: re.Match[str]) -> str:
        target, anchor = _split(match[2])
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), target)) if target else page
        if not target or not _is_relative(match[2]) or not (ROOT / path).is_file():
            return match[0]
        there = posixpath.relpath(site_path(path), posixpath.dirname(source) or ".")
        return f"{match[1]}{there}{anchor}{match[3]}"

    return outside_fences(markdown, lambda text: _LINK.sub(one, text))


def outside_fences(markdown: str, change: Callable[[str], str]) -> str:
    """Apply ``change`` to a page's text, and leave its code blocks as they are."""
    parts, end = [], 0
    for fence in _FENCE.finditer(markdown):
        parts += [change(markdown[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, change(markdown[end:])])


def _targets(markdown: str, page: str) -> Iterator[str]:
    for match in _LINK.finditer(_FENCE.sub("", markdown)):
        target, _ = _split(match[2])
        if target and _is_relative(target):
            yield posixpath.normpath(posixpath.join(posixpath.dirname(page), target))


def _split(link: str) -> tuple[str, str]:
    target, mark, anchor = link.partition("#")
    return target, mark + anchor


def _is_relative(link: str) -> bool:
    return not re.match(r"[a-z]+:|/|#", link)
