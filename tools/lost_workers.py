"""Kill workers of a sweep at random times: its tables have to have the bytes of a sweep that was left alone.

    python tools/lost_workers.py --runs 64 --kills 12

The first sweep is left alone, on one process. Of the second, on as many as there are cores, workers that have a run
under way are killed with SIGKILL at random times.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

SWEEP = """
name = "lost workers"
series = ["energy", "counts"]
keep = ["npz"]
retries = 20
checkpoint_interval = 0.03
[vary]
fabric = ["cotton", "silk"]
[seeds]
count = {seeds}
disturbance = 0.01
[seeds.draw]
contact.friction = {{ uniform = [0.0, 0.6] }}
[scene]
name = "cloth on a ball"
duration = 0.4
time.dt = 0.005
contact.thickness = 0.006
[[scene.cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 0.6, height = 0.6, nx = 19, ny = 19 }}
position = [0.02, 0.31, 0.01]
material = "cotton"
[[scene.collider]]
name = "ball"
shape = {{ type = "sphere", radius = 0.3, tolerance = 0.01 }}
[scene.output]
fps = 60
"""


def main() -> int:
    """Run both, kill, compare; 1 if anything differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=64)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clothsim-lost-") as name:
        facts = run(Path(name), options.runs, options.kills, random.Random(options.seed))
    print(json.dumps(facts) if options.json else _text(facts))
    return 0 if facts["same"] else 1


def run(folder: Path, runs: int, kills: int, chance: random.Random) -> dict[str, Any]:
    """Run a sweep twice; returns what was found."""
    (folder / "sweep.toml").write_text(SWEEP.format(seeds=runs // 2))
    alone = _start(folder, "alone", "--processes", "1")
    errors = alone.communicate()[1]
    if alone.returncode:
        sys.exit(f"the sweep ended with {alone.returncode}: {errors}")
    whole = json.loads((folder / "alone" / "sweep.json").read_text())
    process = _start(folder, "killed")
    gap = 0.5 * whole["seconds"] / kills
    killed = 0
    after = time.monotonic() + chance.uniform(0.0, gap)
    while process.poll() is None and killed < kills:
        time.sleep(0.01)
        busy = _busy(process.pid) if time.monotonic() > after else []
        if busy:
            time.sleep(chance.uniform(0.0, 0.3))
            chance.choice(busy).kill()
            killed += 1
            after = time.monotonic() + chance.uniform(0.0, gap)
    errors = process.communicate()[1]
    if process.returncode:
        sys.exit(f"the sweep ended with {process.returncode}: {errors}")
    import pyarrow.parquet as pq

    facts = json.loads((folder / "killed" / "sweep.json").read_text())
    costs = pq.read_table(folder / "killed" / "costs.parquet").to_pydict()
    files = sorted(p.relative_to(folder / "alone") for p in (folder / "alone").rglob("*.parquet"))
    files += sorted(p.relative_to(folder / "alone") for p in (folder / "alone").rglob("*.npz"))
    compared = [p for p in files if p.name != "costs.parquet"]
    different = [
        str(p) for p in compared if (folder / "alone" / p).read_bytes() != (folder / "killed" / p).read_bytes()
    ]
    return {
        "runs": whole["runs"], "workers": facts["workers"], "killed": killed, "started_again": facts["started_again"],
        "resumed_at_frames": sorted(n for n in costs["resumed_at"] if n), "counts": facts["counts"],
        "files": len(compared), "different": different, "same": not different,
        "seconds_alone": whole["seconds"], "seconds": facts["seconds"],
    }  # fmt: skip


def _start(folder: Path, out: str, *more: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "clothsim", "sweep", str(folder / "sweep.toml"), "-o", str(folder / out), "--quiet"]
    return subprocess.Popen([*words, *more], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def _busy(pid: int) -> list[Any]:
    """Workers that write frames."""
    import psutil

    found = []
    with contextlib.suppress(psutil.Error):
        for process in psutil.Process(pid).children():
            found += [process] * any(file.path.endswith("frames.bin") for file in process.open_files())
    return found


def _text(facts: dict[str, Any]) -> str:
    return (
        f"{facts['runs']} runs, {facts['killed']} workers killed, {facts['started_again']} runs started again, "
        f"{len(facts['resumed_at_frames'])} of them from a checkpoint (after {facts['resumed_at_frames']} frames); "
        f"{facts['files']} files compared, {len(facts['different'])} different; "
        f"{facts['seconds_alone']:.0f} s alone on one process, {facts['seconds']:.0f} s on {facts['workers']}"
    )


if __name__ == "__main__":
    sys.exit(main())
