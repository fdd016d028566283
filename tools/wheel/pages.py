"""Do what a page of the documentation says, with an installed clothsim, as somebody would who pastes its blocks."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = ["blocks", "follow"]

# What installs or builds is done already; what opens a window needs somebody to look at it.
_DONE = ("pip ", "make ", "source ")
_BLOCK = re.compile(r"^```(sh|python|toml)([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(text: str) -> Iterator[tuple[str, str | None, str]]:
    """Yield language, title and text of each block that is something to do."""
    for language, rest, body in _BLOCK.findall(text):
        title = re.search(r'title="([^"]+)"', rest)
        yield language, title and title[1], body


def follow(page: Path, folder: Path, python: str, run: Callable[..., str], *, frames: int | None = None) -> int:
    """Do a page from top to bottom in an empty folder; returns how many blocks it has.

    Parameters
    ----------
    page : Path
        A page in Markdown. TOML blocks with a title become files; Python blocks share their names.
    folder : Path
        Where to do it.
    python : str
        The interpreter of the environment.
    run : callable
        Runs a command in a folder and stops at a failure.
    frames : int, optional
        So many frames of each run, in place of all.
    """
    folder.mkdir()
    path = f"{Path(python).parent}:/usr/bin:/bin"
    known, count = "", 0
    for language, title, text in blocks(page.read_text()):
        count += 1
        if language == "toml":
            assert title, f"{page.name}: a TOML block without a name"
            (folder / title).write_text(text)
        elif language == "python":
            known += text
            run([python, "-I", "-c", known], folder)
        else:
            for line in text.splitlines():
                words = line.split(" #")[0].strip()
                if frames is not None:
                    words = words.replace("clothsim run ", f"clothsim run --overwrite --frames {frames} ")
                if words and not words.startswith(_DONE):
                    run(["bash", "-ec", words], folder, PATH=path)
    assert count, f"{page.name}: no blocks"
    return count
