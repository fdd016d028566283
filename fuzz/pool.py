"""Slices of all targets, side by side in processes of their own, until the time is over."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["Pool", "Tally", "replay", "slice_of"]

_ROOT = Path(__file__).resolve().parents[1]
# A process runs one target so long [s]: it is started and warm in two, and what it leaks goes with it.
SLICE = 45.0


@dataclass
class Tally:
    """What came of a target so far.

    Attributes
    ----------
    cases : int
        Cases checked.
    seconds : float
        How long its processes ran [s].
    slowest : float
        Most processor time of a case [s].
    findings : list of dict
        Error, place, and the file in which the shrunk case is; each place once.
    last : float or None
        When the last finding came, in seconds since the start; also one that was known by then.
    """

    cases: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    findings: list[dict[str, Any]] = field(default_factory=list)
    last: float | None = None


def _command(name: str, current: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "fuzz.slice", name, str(current), *more]


def slice_of(name: str, current: Path, *more: str) -> list[dict[str, Any]]:
    """Facts that a process prints, and a finding made of its death where it died."""
    process = subprocess.Popen(
        _command(name, current, *more),
        cwd=_ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )
    return _facts(process, current)


def _facts(process: subprocess.Popen[str], current: Path) -> list[dict[str, Any]]:
    out, err = process.communicate()
    facts = [json.loads(line) for line in out.splitlines() if line.startswith("{")]
    if process.returncode != 0:
        head, _, content = current.read_bytes().partition(b"\n") if current.exists() else (b".bin", b"", b"")
        facts.append({
            "cases": 1, "seconds": 0.0, "slowest": 0.0,
            "finding": {"error": f"the process ended with {process.returncode}: {err.strip()[-500:]}",
                        "where": "process",
                        "suffix": head.decode(), "content": content.hex(), "traceback": err[-6000:]},
        })  # fmt: skip
    return facts


def replay(name: str, files: Sequence[Path], *more: str) -> list[dict[str, Any]]:
    """Check files of the corpus in one process; facts of each, and of its death."""
    if not files:
        return []
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(path.resolve()) for path in files]
        return slice_of(name, Path(folder) / "current", "--most", "0", *more, "--replay", *paths)


class Pool:
    """Fuzz for some minutes.

    Parameters
    ----------
    names : sequence of str
        Targets.
    minutes : float
        How long.
    processes : int
        How many slices side by side.
    seed : int
        Slice number n of a target has a seed that depends on this and n alone.
    out : Path
        Folder for findings and ``summary.json``.
    """

    def __init__(self, names: Sequence[str], minutes: float, processes: int, seed: int, out: Path) -> None:
        self.tallies = {name: Tally() for name in names}
        self._minutes, self._processes, self._seed, self._out = minutes, processes, seed, out
        self._started = time.monotonic()
        self._slices = dict.fromkeys(names, 0)

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._started

    def run(self, progress: Any) -> None:
        """Run to the end; ``progress`` is called now and then."""
        running: dict[subprocess.Popen[str], tuple[str, Path, float]] = {}
        self._out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            try:
                while running or self.elapsed < 60.0 * self._minutes:
                    while len(running) < self._processes and self.elapsed < 60.0 * self._minutes:
                        running.update(self._begin(Path(folder), [name for name, _, _ in running.values()]))
                    done = next((p for p in running if p.poll() is not None), None)
                    if done is None:
                        time.sleep(0.2)
                    else:
                        self._end(done, *running.pop(done))
                    progress(self)
            finally:
                for process in running:
                    process.kill()

    def _begin(self, folder: Path, busy: list[str]) -> dict[subprocess.Popen[str], tuple[str, Path, float]]:
        """The target that had least time so far, one that does not run if there is."""
        name = min(self.tallies, key=lambda n: (busy.count(n), self.tallies[n].seconds))
        number = self._slices[name]
        self._slices[name] += 1
        current = folder / f"{name}-{number}"
        seconds = max(1.0, min(SLICE, 60.0 * self._minutes - self.elapsed))
        seed = int.from_bytes(hashlib.sha256(f"{self._seed}-{number}".encode()).digest()[:4], "little")
        command = _command(name, current, "--seconds", str(seconds), "--seed", str(seed))
        environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
        process = subprocess.Popen(
            command,
            cwd=_ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=environment,
        )
        return {process: (name, current, self.elapsed)}

    def _end(self, process: subprocess.Popen[str], name: str, current: Path, began: float) -> None:
        tally = self.tallies[name]
        tally.seconds += self.elapsed - began
        for facts in _facts(process, current):
            tally.cases += facts["cases"]
            tally.slowest = max(tally.slowest, facts["slowest"])
            if facts["finding"] is not None:
                self._keep(name, facts["finding"])
        current.unlink(missing_ok=True)
        self._write()

    def _keep(self, name: str, finding: dict[str, Any]) -> None:
        tally = self.tallies[name]
        tally.last = self.elapsed
        key = (finding["error"].partition(":")[0], finding["where"])
        if any((f["error"].partition(":")[0], f["where"]) == key for f in tally.findings):
            return
        content = bytes.fromhex(finding["content"])
        folder = self._out / name
        folder.mkdir(exist_ok=True)
        path = folder / f"{hashlib.sha256(content).hexdigest()[:12]}{finding['suffix']}"
        path.write_bytes(content)
        path.with_suffix(".txt").write_text(f"{finding['error']}\n\n{finding['traceback']}")
        tally.findings.append({"error": finding["error"], "where": finding["where"], "file": str(path)})

    def facts(self) -> dict[str, Any]:
        """What came of it, for JSON."""
        return {
            "seed": self._seed, "seconds": self.elapsed, "processes": self._processes,
            "cases": sum(t.cases for t in self.tallies.values()),
            "findings": sum(len(t.findings) for t in self.tallies.values()),
            "last_finding_at": max((t.last for t in self.tallies.values() if t.last is not None), default=None),
            "targets": {name: vars(tally) for name, tally in self.tallies.items()},
        }  # fmt: skip

    def _write(self) -> None:
        part = self._out / ".summary.part"
        part.write_text(json.dumps(self.facts(), indent=1) + "\n")
        part.replace(self._out / "summary.json")
