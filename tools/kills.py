"""Kill a run at random times and resume it: every output has to have the bytes of a run that was left alone.

    python tools/kills.py --kills 100

Each kill is a new run: SIGKILL at a time drawn evenly over the time that the run takes once it has its folder, then one
``--resume`` on one or two threads. What is compared: the frames, states, OBJ, glTF and PC2 files byte by byte, and the
report without its clocks. The scene has what remembers: hysteresis, stick-slip friction, self-contact, a collider that
turns.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

SCENE = """
name = "kills"
duration = 0.5
[time]
dt = 0.005
[contact]
thickness = 0.006
friction = { law = "stribeck", mu_c = 0.3, mu_s = 0.4, v_s = 0.1, delta_s = 1.0 }
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 21, ny = 21 }
material = { fabric = "cotton", bending = "hysteresis", plasticity = 0.1, fatigue = 0.02 }
position = [0.02, 0.42, 0.01]
[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.4, tolerance = 0.02 }
keyframes = [
    { time = 0.0, rotation = { axis = [0, 1, 0], angle = 0.0 } },
    { time = 0.5, rotation = { axis = [0, 1, 0], angle = 1.0 } },
]
[output]
fps = 60
velocities = true
states = 4
obj = true
gltf = true
pc2 = true
usd = false
film_strip = false
plots = false
checkpoint_interval = 0.05
"""
# What two runs may differ in: clocks and what is chosen by them, threads, and the memory that contact happened to hold.
_CLOCKS = ("wall_seconds", "seconds", "choices", "threads", "effects", "detection", "python", "plan")


def main() -> int:
    """Kill, resume, compare; 1 if anything differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plant-fault", action="store_true", help="change one bit of a kept frame after each kill")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clothsim-kills-") as name:
        facts = run(Path(name), options.kills, random.Random(options.seed), plant_fault=options.plant_fault)
    print(json.dumps(facts) if options.json else _text(facts))
    return 1 if facts["different"] else 0


def run(folder: Path, kills: int, chance: random.Random, *, plant_fault: bool = False) -> dict[str, Any]:
    """Kill so many runs; returns what was found."""
    scene = folder / "scene.toml"
    scene.write_text(SCENE)
    began = time.monotonic()
    process = _start(scene, folder / "whole")
    appeared = _wait_for_work(folder / "whole", process)
    process.wait()
    span = time.monotonic() - appeared
    whole = fingerprints(folder / "whole")
    phases: Counter[str] = Counter()
    different: list[dict[str, Any]] = []
    finished_first = done = 0
    while done < kills:
        out = folder / f"out-{done}"
        process = _start(scene, out)
        appeared = _wait_for_work(out, process)
        after = chance.uniform(0.0, span)
        time.sleep(max(0.0, appeared + after - time.monotonic()))
        process.kill()
        if process.wait() == 0:
            finished_first += 1
            _remove(out)
            continue
        phase = _phase(out)
        if plant_fault and not _spoil(out):
            _remove(out)
            continue
        threads = str(chance.choice([1, 2]))
        resumed = subprocess.run(
            [*_command(scene, out), "--resume", "--threads", threads], capture_output=True, text=True, check=False
        )
        same = resumed.returncode == 0 and fingerprints(out) == whole
        if not same:
            different.append({"after": round(after, 3), "phase": phase, "stderr": resumed.stderr[-500:]})
        phases[phase] += 1
        done += 1
        _remove(out)
        if sys.stderr.isatty():
            print(f"\r{done}/{kills}", end="", file=sys.stderr)
    return {
        "kills": kills, "same": kills - len(different), "different": different, "phases": dict(phases),
        "finished_first": finished_first, "files": len(whole), "seconds_of_a_run": round(span, 2),
        "seconds": round(time.monotonic() - began, 1),
    }  # fmt: skip


def fingerprints(out: Path) -> dict[str, str]:
    """Digest of every file of a run, of the report without its clocks."""
    found = {}
    for path in sorted(p for p in out.rglob("*") if p.is_file()):
        content = path.read_bytes()
        if path.name == "report.json":
            content = json.dumps(_untimed(json.loads(content))).encode()
        found[str(path.relative_to(out))] = hashlib.sha256(content).hexdigest()
    return found


def _untimed(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _untimed(v) for k, v in value.items() if k not in _CLOCKS and "seconds" not in k}
    return [_untimed(v) for v in value] if isinstance(value, list) else value


def _command(scene: Path, out: Path) -> list[str]:
    return [sys.executable, "-m", "clothsim", "run", str(scene), "-o", str(out), "--quiet"]


def _start(scene: Path, out: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(_command(scene, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _wait_for_work(out: Path, process: subprocess.Popen[bytes]) -> float:
    while not (out / ".clothsim").exists():
        if process.poll() is not None:
            sys.exit(f"the run ended with {process.returncode} before it began")
        time.sleep(0.001)
    return time.monotonic()


def _phase(out: Path) -> str:
    """Where the kill came, by what it left."""
    work = out / ".clothsim"
    if not work.exists() or (work / "done").exists():
        return "while the work folder was removed"
    if any(path.name != ".clothsim" for path in out.iterdir()):
        return "while outputs were written"
    return "between checkpoints" if (work / "checkpoint").exists() else "before the first checkpoint"


def _spoil(out: Path) -> bool:
    """Change a bit of the first frame that a checkpoint counts, if there is one."""
    rows = out / ".clothsim" / "frames.bin"
    if not (out / ".clothsim" / "checkpoint").exists():
        return False
    with rows.open("r+b") as file:
        first = file.read(1)
        file.seek(0)
        file.write(bytes([first[0] ^ 1]))
    return True


def _remove(folder: Path) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    folder.rmdir()


def _text(facts: dict[str, Any]) -> str:
    lines = [
        f"{facts['kills']} kills, {facts['same']} resumed to the same bytes of {facts['files']} files, "
        f"{len(facts['different'])} not; a run takes {facts['seconds_of_a_run']} s, all of it {facts['seconds']} s"
    ]
    lines += [f"  {count:>4} {phase}" for phase, count in sorted(facts["phases"].items())]
    lines += [f"  different: {entry}" for entry in facts["different"]]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
