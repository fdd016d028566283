"""``clothsim doctor``."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim._cli.adapters import adapters
from clothsim._data import VARIABLE, data_folder

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "doctor"
HELP = "Say what this machine offers: threads, processor, GPU adapters, packages, data."
EXAMPLE = "clothsim doctor"

_FEATURES = ("sse4_2", "avx", "avx2", "fma", "avx512f", "asimd")
# Optional packages and what they are for.
_OPTIONAL = {
    "usd-core": "writing USD",
    "pyvista": "film strips",
    "matplotlib": "plots",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def execute(options: argparse.Namespace) -> int:
    """Print the findings."""
    facts = findings()
    print(json.dumps(facts) if options.json else _text(facts))
    return 0


def findings() -> dict[str, Any]:
    """Everything that ``clothsim doctor`` says."""
    data = data_folder()
    return {
        "clothsim": _core.__version__,
        "build": _core.BUILD_PROFILE,
        "python": platform.python_version(),
        "numpy": _version("numpy"),
        "system": f"{platform.system()} {platform.release()} ({platform.machine()})",
        "processor": _processor(),
        "threads": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gib": _memory(),
        "gpu": gpu_adapters(),
        "packages": {name: _version(name) for name in _OPTIONAL},
        "data": None if data is None else str(data),
    }


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _processor() -> dict[str, Any]:
    model, flags = platform.processor(), set()
    for line in _lines(Path("/proc/cpuinfo")):
        key, _, value = line.partition(":")
        if key.strip() == "model name":
            model = value.strip()
        elif key.strip() in ("flags", "Features"):
            flags = set(value.split())
            break
    return {"model": model, "features": [name for name in _FEATURES if name in flags]}


def _memory() -> float | None:
    for line in _lines(Path("/proc/meminfo")):
        if line.startswith("MemTotal:"):
            return round(int(line.split()[1]) / 2**20, 1)
    return None


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []


def gpu_adapters() -> dict[str, Any]:
    """Adapters with their limits, which of them each device takes, and what is wrong if there are none."""
    found, problem = adapters()
    taken = {device: next((a["name"] for a in found if device in a["devices"]), "cpu") for device in ("gpu", "auto")}
    if taken["gpu"] == "cpu":
        taken["gpu"] = "none"
    return {"adapters": found, "problem": problem, "taken": taken}


def _gpu_rows(gpu: dict[str, Any]) -> list[tuple[str, str]]:
    """Two lines for each adapter, and one for what is taken."""
    rows = []
    for a in gpu["adapters"]:
        extras = [name for name in ("subgroups", "timestamps") if a[name]]
        rows.append(("GPU", f"{a['name']}, {a['kind']}"))
        limits = [
            f"arrays to {a['max_binding_bytes'] / 2**20:.0f} MiB",
            f"workgroup memory {a['workgroup_bytes'] / 1024:.0f} KiB",
            f"{a['max_workgroups']} workgroups per dimension",
        ]
        rows.append(("", ", ".join(limits + extras)))
        if a["problem"]:
            rows.append(("", f"cannot be used: {a['problem']}"))
    if gpu["problem"]:
        rows.append(("GPU", gpu["problem"]))
    auto = "the CPU" if gpu["taken"]["auto"] == "cpu" else gpu["taken"]["auto"]
    rows.append(("", f'device "gpu" takes {gpu["taken"]["gpu"]}; device "auto" takes {auto}'))
    return rows


def _text(facts: dict[str, Any]) -> str:
    processor = facts["processor"]
    rows = [
        ("clothsim", f"{facts['clothsim']} ({facts['build']} build)"),
        ("Python", f"{facts['python']}, NumPy {facts['numpy']}"),
        ("system", facts["system"]),
        ("processor", f"{processor['model']}; {' '.join(processor['features']) or 'no features listed'}"),
        ("threads", f"{facts['threads']}; memory {facts['memory_gib']} GiB"),
    ]
    rows += _gpu_rows(facts["gpu"])
    for name, purpose in _OPTIONAL.items():
        version = facts["packages"][name]
        rows.append((name, f"{version or 'not installed'}  ({purpose})"))
    rows.append(("test data", facts["data"] or f"not found: set ${VARIABLE}"))
    return "\n".join(f"{key:<12}{value}" for key, value in rows)
