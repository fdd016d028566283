"""The folder of a sweep."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clothsim._files import output_error, write_whole
from clothsim.errors import OutputExists
from clothsim.study.folder import StudyFolder
from clothsim.sweep.task import Work

__all__ = ["COSTS", "FACTS", "FRAMES", "KEPT", "RUNS", "SweepFolder"]

RUNS, FRAMES, COSTS, FACTS, KEPT = "runs.parquet", "frames", "costs.parquet", "sweep.json", "runs"


class SweepFolder(StudyFolder):
    """``OUT`` and its work folder, which has a result of every run so far, and a folder of every run under way."""

    noun, article = "sweep", "a"
    outputs: tuple[str, ...] = (RUNS, FRAMES, COSTS, KEPT, FACTS)
    facts_file = FACTS

    def begin(self, digest: str, *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Refuse a folder in use, that of a study too; return the facts of the same sweep if it is complete."""
        if StudyFolder(self.out).present():
            raise OutputExists(f"{self.out}: holds a study; choose another folder")
        return super().begin(digest, resume=resume, overwrite=overwrite)

    def work_of(self) -> Work:
        """Make ready for runs."""
        path = self.work / "token"
        try:
            for name in ("results", "runs"):
                (self.work / name).mkdir(exist_ok=True)
            token = path.read_text() if path.exists() else secrets.token_hex(16)
            write_whole(path, token.encode())
        except OSError as error:
            raise output_error(self.work, error) from error
        return Work(str(self.work.resolve()), token)

    def move_kept(self, names: Sequence[str]) -> None:
        """Give the outputs of runs their place, if any are kept; those of a sweep before go."""
        there, here = self.out / KEPT, self.work / "runs"
        try:
            if not names:
                if there.exists():
                    shutil.rmtree(there)
            elif here.exists():
                if there.exists():
                    shutil.rmtree(there)
                os.replace(here, there)
        except OSError as error:
            raise output_error(there, error) from error

    def files(self, names: Sequence[str]) -> list[Path]:
        """Paths of outputs."""
        return [self.out / name for name in names]
