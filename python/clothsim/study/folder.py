"""The folder of a study: what it may hold, and the work folder that makes it resumable.

``OUT/.clothsim`` holds a result for every run so far, named for a fingerprint of all that the run depends on, and the
study they belong to. It is removed when the tables and plots are written.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any, ClassVar

from clothsim._files import write_whole
from clothsim._run.folder import RunFolder
from clothsim.errors import CheckpointError, OutputExists

__all__ = ["OUTPUTS", "StudyFolder", "fingerprint"]

OUTPUTS = ("study.json", "study.csv", "study.md", "study.png", "study.svg")
_STUDY = "study"


def fingerprint(facts: Any, extra: bytes = b"") -> str:
    """Digest of anything that JSON holds, and of bytes."""
    text = json.dumps(facts, sort_keys=True, default=str).encode()
    return hashlib.sha256(text + b"\0" + extra).hexdigest()[:24]


class StudyFolder(RunFolder):
    """``OUT`` and its work folder.

    Attributes
    ----------
    noun, article : str
        What it holds, in messages.
    outputs : tuple of str
        What may be written into it.
    facts_file : str
        The one of them that is written last and has the digest.
    strangers : dict
        Files that say that the folder holds something else, and what.
    """

    noun, article = "study", "a"
    outputs: tuple[str, ...] = (*OUTPUTS, "tuned.toml", "tune.json")
    facts_file = "study.json"
    strangers: ClassVar[dict[str, str]] = {"stability.json": "an atlas"}

    def present(self) -> list[str]:
        """Outputs that are there."""
        return [name for name in self.outputs if (self.out / name).exists()]

    def begin(self, digest: str, *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Refuse a folder in use; return the facts of the same study if it is complete and to be resumed.

        Raises
        ------
        OutputExists
            The folder holds a study, or a run, and neither ``resume`` nor ``overwrite`` is set.
        CheckpointError
            What is to be resumed is another study.
        """
        if self.out.exists() and not self.out.is_dir():
            raise OutputExists(f"{self.out}: expected a folder, got a file")
        runs = RunFolder(self.out).present()
        if runs or (self.holds_work and not self._digest_file.exists()):
            raise OutputExists(f"{self.out}: holds a run of a scene; choose another folder")
        if stranger := next((what for name, what in self.strangers.items() if (self.out / name).exists()), None):
            raise OutputExists(f"{self.out}: holds {stranger}; choose another folder")
        noun = self.noun
        if overwrite:
            return None
        if self.started and self._digest_file.exists():
            if not resume:
                raise OutputExists(
                    f"{self.out}: holds an unfinished {noun}; --resume goes on with it, --overwrite starts anew"
                )
            if self._digest_file.read_text() != digest:
                raise CheckpointError(f"{self.out}: the unfinished {noun} is another one; --overwrite starts anew")
            return None
        present = self.present()
        if present and not resume:
            raise OutputExists(
                f"{self.out}: holds {self.article} {noun} already ({', '.join(present)}); --overwrite replaces it"
            )
        return self._complete(digest) if present else None

    def _complete(self, digest: str) -> dict[str, Any]:
        try:
            facts = json.loads((self.out / self.facts_file).read_bytes())
            same = facts["digest"] == digest
        except (OSError, ValueError, KeyError, TypeError):
            same = False
        if not same:
            raise CheckpointError(f"{self.out}: the finished {self.noun} is another one; --overwrite starts anew")
        return dict(facts)

    @property
    def _digest_file(self) -> Path:
        return self.work / _STUDY

    @property
    def word(self) -> Path:
        """The file that makes the work folder an unfinished study."""
        return self._digest_file

    def claim(self, digest: str, *, overwrite: bool) -> None:
        """Say whose the work folder is, with the folder locked; forget the results of another study."""
        if overwrite or (self._digest_file.exists() and self._digest_file.read_text() != digest):
            for path in self.work.iterdir():
                if path.is_dir():
                    shutil.rmtree(path)
                elif path.name != "lock":
                    path.unlink()
        write_whole(self._digest_file, digest.encode())
