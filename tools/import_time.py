"""How long `import clothsim` takes, cold and warm, and which packages it loads.

Run: python tools/import_time.py [RUNS]
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time

FRAMES = ("import numpy", "import clothsim", "import clothsim._cli; clothsim._cli.build_parser()")


def seconds(code: str) -> tuple[float, float]:
    """Wall and processor time of a fresh interpreter that runs this, beyond one that runs nothing [s]."""
    taken = []
    for text in ("pass", code):
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, "-c", text], check=True)
        wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append((wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
    (wall_none, cpu_none), (wall, cpu) = taken
    return wall - wall_none, cpu - cpu_none


def main(runs: int) -> None:
    """Print the first run (whatever the disk has cached) and medians of the others, and what is loaded."""
    for code in FRAMES:
        first, *rest = [seconds(code) for _ in range(runs + 1)]
        wall, cpu = (statistics.median(run[k] for run in rest) for k in (0, 1))
        print(f"{code:<62}first {first[0]:.2f} s, then {wall:.2f} s, of the processor {cpu:.2f} s")
    code = "import sys, clothsim; print(*sorted({m.partition('.')[0] for m in sys.modules} - sys.stdlib_module_names))"
    print(
        "loads", subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout, end=""
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
