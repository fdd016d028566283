"""The quick part of the fuzzing: known inputs, some hundred cases with a fixed seed, and a planted fault per target.

`make fuzz` runs for longer, with other seeds.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("hypothesis")
TARGETS = (
    "scenes", "sweeps", "meshes", "animations", "recordings", "checkpoints", "detection", "sessions", "runs",
    "arrays", "commands",
)  # fmt: skip
# Cases within which each planted fault is found; those of random scenes and of detection are the slowest.
ENOUGH = 3000


@pytest.fixture(autouse=True)
def _path() -> Iterator[None]:
    sys.path.insert(0, str(ROOT))
    yield
    sys.path.remove(str(ROOT))


def pool() -> Any:
    return importlib.import_module("fuzz.pool")


def test_every_target_is_here() -> None:
    assert importlib.import_module("fuzz.targets").NAMES == TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_known_inputs_and_a_few_random_ones(name: str, tmp_path: Path) -> None:
    corpus = sorted((ROOT / "fuzz" / "corpus" / name).glob("*"))
    quick = importlib.import_module("fuzz.targets").TARGETS[name]().quick
    files = ["--replay", *map(str, corpus)] if corpus else []
    facts = pool().slice_of(
        name, tmp_path / "current", "--most", str(quick), "--seconds", "1e9", "--seed", "0", "--as-found", *files
    )
    findings = [f["finding"]["traceback"] for f in facts if f["finding"] is not None]
    assert not findings, findings[0]
    assert len(facts) == len(corpus) + 1
    assert facts[-1]["cases"] == quick


@pytest.mark.parametrize("name", TARGETS)
def test_a_planted_fault_is_found(name: str, tmp_path: Path) -> None:
    more = ("--most", str(ENOUGH), "--seconds", "1e9", "--seed", "0", "--as-found", "--plant")
    (facts,) = pool().slice_of(name, tmp_path / "current", *more)
    assert facts["finding"] is not None, f"no finding in {facts['cases']} cases"
    case = importlib.import_module("fuzz.targets").TARGETS[name]()
    content = bytes.fromhex(facts["finding"]["content"])
    again = case.dump(case.load(facts["finding"]["suffix"], content))
    assert again == (facts["finding"]["suffix"], content), "the file of a finding is the finding"


def test_a_finding_is_shrunk_and_kept(tmp_path: Path) -> None:
    more = ("--most", str(ENOUGH), "--seconds", "1e9", "--seed", "0", "--plant")
    (facts,) = pool().slice_of("commands", tmp_path / "current", *more)
    files = pool().Pool(["commands"], 0.0, 1, 0, tmp_path / "found")
    (tmp_path / "found").mkdir()
    files._keep("commands", facts["finding"])
    files._keep("commands", facts["finding"])
    (kept,) = (tmp_path / "found" / "commands").glob("*.json")
    (known,) = files.facts()["targets"]["commands"]["findings"]
    assert known["file"] == str(kept)
    bad, good = (pool().replay("commands", [kept], *plant)[0]["finding"] for plant in (["--plant"], []))
    assert bad is not None
    assert good is None


def test_a_process_that_dies_or_never_ends_is_a_finding(tmp_path: Path) -> None:
    watched = importlib.import_module("fuzz.slice")
    target = importlib.import_module("fuzz.target")
    current = tmp_path / "current"

    def endless(_: Any) -> None:
        while True:
            pass

    slow = target.Target(
        "slow", "", None, endless, target.dump_json, target.load_json, lambda: None, quick=1, seconds=0.2
    )
    with pytest.raises(watched.TooLong):
        watched._Watched(slow, current)({"a": 1})
    assert current.read_bytes().startswith(b".json\n")

    class Dead:
        returncode = -6

        def communicate(self) -> tuple[str, str]:
            return "", "memory allocation failed"

    (facts,) = pool()._facts(Dead(), current)
    assert "ended with -6: memory allocation failed" in facts["finding"]["error"]
    assert bytes.fromhex(facts["finding"]["content"]) == target.dump_json({"a": 1})[1]
