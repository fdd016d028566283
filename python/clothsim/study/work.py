"""Work of many runs into one folder: begun or gone on with, locked, claimed, done, written, its traces removed."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from clothsim.study.folder import StudyFolder

__all__ = ["kept", "opened"]

_Folder = TypeVar("_Folder", bound=StudyFolder)
_Made = TypeVar("_Made")


def kept(
    kind: type[_Folder],
    out: Path | None,
    digest: str,
    make: Callable[[_Folder], _Made],
    write: Callable[[_Made, Path], _Made],
    *,
    check: Callable[[], None],
    resume: bool,
    overwrite: bool,
) -> _Made | dict[str, Any]:
    """Do a piece of work in its folder, which holds the results so far until all is written.

    Parameters
    ----------
    kind : type of folder
        What the work is, in messages, and what it may write.
    out : path or None
        The folder; None: one that goes when the work is done, and nothing is written.
    digest : str
        Fingerprint of all that the results depend on.
    make, write : callable
        Does the work with the folder's results so far; writes what was made.
    check : callable
        Raises what would keep ``write`` from its work, before anything runs.

    Returns
    -------
    What ``write`` returns, or the facts of the same work if it was complete already and ``resume`` is set.

    Raises
    ------
    OutputExists, CheckpointError
        As `StudyFolder.begin`.
    """
    with opened(kind, out) as folder:
        if out is not None:
            check()
            complete = folder.begin(digest, resume=resume, overwrite=overwrite)
            if complete is not None:
                return complete
        with folder.locked():
            folder.claim(digest, overwrite=overwrite)
            made = make(folder)
            if out is not None:
                made = write(made, out)
                folder.remove_work()
    return made


@contextlib.contextmanager
def opened(kind: type[_Folder], out: Path | None) -> Iterator[_Folder]:
    """Give the folder, or one that goes when the work is done."""
    if out is not None:
        yield kind(out)
        return
    with tempfile.TemporaryDirectory(prefix=f"clothsim-{kind.noun}-") as name:
        yield kind(Path(name))
