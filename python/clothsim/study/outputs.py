"""The files of a study, each whole or not at all."""

from __future__ import annotations

from pathlib import Path

from clothsim._arrays import optional
from clothsim._files import write_whole
from clothsim.study import plots, tables
from clothsim.study.result import Study

__all__ = ["check_packages", "write"]


def check_packages() -> None:
    """Say what is missing before anything runs."""
    optional("matplotlib.figure", extra="plot", purpose="drawing plots")


def write(study: Study, out: Path, bounds: tuple[float | None, float | None] = (None, None)) -> list[Path]:
    """Write tables and plots, with bounds of the error and of the cost; the JSON last: then the study is complete."""
    png, svg = plots.draw(study, *bounds)
    contents = {
        "study.csv": tables.csv_text(study).encode(),
        "study.md": tables.markdown(study).encode(),
        "study.png": png,
        "study.svg": svg,
        "study.json": tables.json_text(study).encode(),
    }
    for name, content in contents.items():
        write_whole(out / name, content)
    return [out / name for name in contents]
