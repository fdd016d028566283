"""Where the ground truth for collision detection lies."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["VARIABLE", "data_folder"]

VARIABLE = "CLOTHSIM_DATA"


def data_folder() -> Path | None:
    """Return ``$CLOTHSIM_DATA``, else ``../shared/data`` beside the repository; None where neither is a folder."""
    named = os.environ.get(VARIABLE)
    candidates = [Path(named)] if named else []
    candidates.append(Path(__file__).resolve().parents[3] / "shared" / "data")
    return next((folder for folder in candidates if (folder / "ccd").is_dir()), None)
