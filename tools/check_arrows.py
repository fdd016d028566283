"""Compare the workspace's dependencies with the arrows that ARCHITECTURE.md allows.

Run by ``make lint``. Prints each arrow that is not allowed and exits with 1; ``cargo metadata`` is the witness.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable, Mapping

# Direct dependencies between the workspace's crates. A lower crate is reached through the re-exports of the one
# above it.
ALLOWED: dict[str, set[str]] = {
    "cloth-mesh": set(),
    "cloth-core": {"cloth-mesh"},
    "cloth-collision": {"cloth-mesh"},
    "cloth-gpu": {"cloth-collision"},
    "cloth-response": {"cloth-collision"},
    "cloth-sim": {"cloth-core", "cloth-collision", "cloth-gpu", "cloth-response"},
    "cloth-py": {"cloth-sim"},
    "cloth-benches": {"cloth-mesh", "cloth-core", "cloth-collision", "cloth-gpu", "cloth-response", "cloth-sim"},
}

# Libraries that only the named crates may know.
CONFINED: dict[str, set[str]] = {
    "faer": {"cloth-core"},
    "parry3d-f64": {"cloth-collision"},
    "pyo3": {"cloth-py"},
    "numpy": {"cloth-py"},
    "wgpu": {"cloth-gpu"},
    "criterion": {"cloth-benches"},
}


def violations(packages: Iterable[Mapping[str, object]]) -> list[str]:
    """Arrows in ``packages`` (as in ``cargo metadata --no-deps``) that are not allowed, one line each.

    Development dependencies count for confined libraries but may point at any crate of the workspace below.
    """
    found = []
    for package in packages:
        name = str(package["name"])
        if name not in ALLOWED:
            found.append(f"{name}: not a crate of the design (add it to ALLOWED with its arrows)")
            continue
        dependencies = package["dependencies"]
        assert isinstance(dependencies, list)
        for dependency in dependencies:
            to = str(dependency["name"])
            if to in ALLOWED and dependency["kind"] is None and to not in ALLOWED[name]:
                found.append(f"{name} -> {to}: not an allowed arrow")
            if to in CONFINED and name not in CONFINED[to]:
                found.append(f"{name} -> {to}: only {', '.join(sorted(CONFINED[to]))} may know it")
    return found


def main() -> int:
    """Check the workspace in the current folder."""
    metadata = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version", "1"], check=True, capture_output=True, text=True
    )
    found = violations(json.loads(metadata.stdout)["packages"])
    for line in found:
        print(f"check_arrows: {line}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
