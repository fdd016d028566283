"""One figure from measurement to files."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from clothsim._core import __version__
from clothsim._files import write_whole
from clothsim._run.folder import RunFolder
from clothsim.errors import InvalidInput, OutputExists
from clothsim.reproduce.catalogue import Entry, find
from clothsim.reproduce.contract import Check, Effort

__all__ = ["Outcome", "reproduce"]


@dataclass(frozen=True)
class Outcome:
    """What came of a reproduction.

    Attributes
    ----------
    entry : Entry
        The figure or table.
    here : str
        What came out, beside what the paper says.
    checks : list of Check
        Closed forms and findings, compared.
    files : list of Path
        What was written.
    seconds : float
        Wall-clock time.
    """

    entry: Entry
    thesis: str
    here: str
    checks: list[Check] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether every check did."""
        return all(check.passed for check in self.checks)

    @property
    def line(self) -> str:
        """The comparison in one line."""
        return f"the {self.entry.source}: {self.thesis} / here: {self.here}"

    def facts(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "name": self.entry.name, "title": self.entry.title, "thesis": self.thesis, "here": self.here,
            "line": self.line, "passed": self.passed, "checks": [check.facts() for check in self.checks],
            "files": [str(path) for path in self.files], "seconds": round(self.seconds, 3),
        }  # fmt: skip


def reproduce(name: str, out: str | Path, effort: Effort | None = None, *, overwrite: bool = False) -> Outcome:
    """Measure a figure or table again, and write it.

    ``<figure>.png``, its numbers as ``<figure>.csv`` (more of them where it has several tables), and
    ``<figure>.json`` with parameters and checks, each whole or not at all.

    Parameters
    ----------
    name : str
        A name of the catalogue, such as ``"4.7"`` or ``"table-4.1"``.
    out : path
        Output folder.
    effort : Effort, optional
        How much work to spend.
    overwrite : bool
        Replace what is there.

    Raises
    ------
    InvalidInput
        The name is not known (the nearest known one is named), there is nothing to measure, or the figure takes no
        mesh.
    OutputExists
        The folder holds a run or this figure already.
    """
    entry = find(name)
    module = entry.load()
    effort = effort or Effort()
    if effort.mesh is not None and not getattr(module, "TAKES_MESH", False):
        expected = f"no mesh: {entry.kind} {entry.number} has its own"
        raise InvalidInput(
            f"--mesh: expected {expected}, got {effort.mesh}", name="mesh", expected=expected, got=str(effort.mesh)
        )
    start = time.perf_counter()
    with _folder(Path(out), entry, overwrite=overwrite) as folder:
        measured = module.measure(effort)
        parameters = {
            "figure": f"{entry.paper}, {entry.kind} {entry.number}: {entry.title}",
            "made by": f"clothsim {__version__}: clothsim reproduce {entry.name}{_options(effort)}",
            **module.parameters(measured),
        }
        outcome = Outcome(entry, module.THESIS, module.here(measured), list(module.checks(measured)))
        contents = {
            f"{entry.stem}{'-' + end if end else ''}.csv": table.text(parameters).encode()
            for end, table in module.tables(measured).items()
        }
        contents[f"{entry.stem}.png"] = module.draw(measured)
        for file, content in contents.items():
            write_whole(folder / file, content)
            outcome.files.append(folder / file)
        outcome.files.append(folder / f"{entry.stem}.json")
        outcome = Outcome(
            entry, outcome.thesis, outcome.here, outcome.checks, outcome.files, time.perf_counter() - start
        )
        facts = {**outcome.facts(), "parameters": parameters}
        write_whole(folder / f"{entry.stem}.json", (json.dumps(facts, indent=2, ensure_ascii=False) + "\n").encode())
    return outcome


def _options(effort: Effort) -> str:
    mesh = f" --mesh {effort.mesh}" if effort.mesh is not None else ""
    return mesh + (" --quick" if effort.quick else "")


@contextmanager
def _folder(out: Path, entry: Entry, *, overwrite: bool) -> Iterator[Path]:
    """Hold the folder while its files are made; refuse one that is in use."""
    if out.exists() and not out.is_dir():
        raise OutputExists(f"{out}: expected a folder, got a file")
    run = RunFolder(out)
    if run.holds_work or run.present():
        raise OutputExists(f"{out}: holds a run of a scene; choose another folder")
    present = sorted(path.name for path in out.glob(f"{entry.stem}[.-]*")) if out.exists() else []
    if present and not overwrite:
        raise OutputExists(f"{out}: holds this figure already ({', '.join(present)}); --overwrite replaces it")
    fresh = not out.exists()
    with run.locked():
        try:
            yield out
        finally:
            run.remove_work()
            if fresh and not any(out.iterdir()):
                out.rmdir()  # what fails leaves no folder behind
