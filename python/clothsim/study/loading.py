"""A study that was written, read again."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from typing import Any

from clothsim._files import path_from
from clothsim.errors import InvalidInput
from clothsim.study import evaluate
from clothsim.study.axes import axis
from clothsim.study.metrics import metrics
from clothsim.study.reference import Reference
from clothsim.study.result import Row, Study, Value

__all__ = ["load"]


def load(folder: str | os.PathLike[str]) -> Study:
    """Read ``study.json`` of a folder; runs and their states are not in it.

    Raises
    ------
    InvalidInput
        There is none, or it is damaged.
    """
    where = path_from(folder, "folder")
    path = where / "study.json"
    try:
        facts = json.loads(path.read_bytes())
        made = Study(
            facts["name"], [axis(a["name"], a["values"]) for a in facts["axes"]], facts["fixed"],
            metrics([m["name"] for m in facts["metrics"]]), facts["cost"], [_row(row) for row in facts["rows"]],
            [(r["problem"], _reference(r)) for r in facts["references"]], facts["front"], [], facts["converged"],
            facts["statement"], facts["machine"], facts["command"], facts["digest"], facts["duration"], where,
            seconds=facts["seconds"], per_point=facts["runs_per_point"],
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidInput(f"{path}: expected the file of a study: {error}", name="folder", got=str(path)) from error
    return replace(made, orders=evaluate.orders(made))


def _row(facts: dict[str, Any]) -> Row:
    values = {name: Value(**value) for name, value in facts["values"].items()}
    return Row(**{**facts, "values": values})


def _reference(facts: dict[str, Any]) -> Reference:
    return Reference(
        facts["kind"], facts["statement"], values=facts["values"], errors=facts["own_errors"],
        settings=facts["settings"],
    )  # fmt: skip
