"""What a run writes, each whole or not at all."""

from __future__ import annotations

import functools
import importlib.util
import json
import platform
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from clothsim import _core
from clothsim._export.writers import FORMATS
from clothsim._files import output_error, write_whole
from clothsim._run.folder import OUTPUTS
from clothsim._run.states import FOLDER, StateWriter
from clothsim.errors import ClothSimError, MissingDependency, OutputError
from clothsim.recording import Recording, body_facts
from clothsim.simulation import Simulation

__all__ = ["Outputs", "check_packages"]

# Key of [output], module it needs, how to get it.
_NEEDS = (
    ("usd", "pxr", "usd"),
    ("film_strip", "pyvista", "view"),
    ("plots", "matplotlib", "plot"),
    ("vtk", "pyvista", "view"),
)


def check_packages(settings: dict[str, Any]) -> None:
    """Refuse, before anything is simulated, outputs whose packages are not installed."""
    for key, module, extra in _NEEDS:
        if settings[key] and importlib.util.find_spec(module) is None:
            raise MissingDependency(
                f"output.{key} needs the package {module}: pip install 'clothsim[{extra}]', or set output.{key} = false"
            )


class Outputs:
    """Writes a recording as ``[output]`` asks."""

    def __init__(
        self,
        out: Path,
        settings: dict[str, Any],
        recording: Recording,
        frames: list[dict[str, Any]],
        simulation: Simulation,
        wall_seconds: float,
        error: ClothSimError | None,
        scene_digest: str,
        states: StateWriter,
    ) -> None:
        self._out = out
        self._settings = settings
        self._recording = recording
        self._frames = frames
        self._simulation = simulation
        self._wall_seconds = wall_seconds
        self._error = error
        self._scene_digest = scene_digest
        self._states = states

    def write(self, *, progress: bool) -> dict[str, Any]:
        """Write everything, the report last; return it without its frames.

        Raises
        ------
        OutputError
            One of them could not be written; the others are there.
        """
        jobs: dict[str, tuple[str, Callable[[Path], None]]] = {
            "npz": ("frames.npz", self._recording.save),
            **{key: (form.file, functools.partial(form.write, self._recording)) for key, form in FORMATS.items()},
            "film_strip": ("film_strip.png", self._film_strip),
            "plots": ("plots.png", self._plots),
        }
        failures: list[str] = []
        written: list[str] = []
        for key, (name, job) in jobs.items():
            if not self._settings[key]:
                continue
            if progress:
                print(f"writing {name}", file=sys.stderr)
            try:
                job(self._out / name)
                written.append(name)
            except (ClothSimError, OSError, RuntimeError) as error:
                text = getattr(error, "strerror", None) or str(error)
                failures.append(f"{name}: {text}")
        if self._error is not None:
            write_whole(self._out / "last_good.checkpoint", self._simulation._core.checkpoint(0))
            written.append("last_good.checkpoint")
        if failures:
            raise self._missing("; ".join(failures))
        states = self._states.finish(len(self._frames))
        if states:
            written.append(FOLDER)
        report = self._report(written, states)
        try:
            write_whole(self._out / "report.json", json.dumps(report, indent=1).encode())
        except OutputError as error:
            raise self._missing(f"report.json: {error.strerror}") from error
        self._remove_stale([*written, "report.json"])
        return {key: value for key, value in report.items() if key != "frames"}

    def _missing(self, what: str) -> OutputError:
        return OutputError(0, f"{self._out}: {what}. The simulation itself is kept: --resume writes what is missing")

    def _film_strip(self, path: Path) -> None:
        self._recording.film_strip(path)

    def _plots(self, path: Path) -> None:
        from clothsim._export import plots

        plots.write(self._frames, path, self._recording.name)

    def _remove_stale(self, written: list[str]) -> None:
        """Outputs of an earlier run here that this one does not have."""
        for name in OUTPUTS:
            path = self._out / name
            if name in written or not path.exists():
                continue
            try:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            except OSError as error:
                raise output_error(path, error) from error

    def _report(self, written: list[str], states: list[int]) -> dict[str, Any]:
        summary = json.loads(self._simulation._core.summary())
        intersections = [f["intersections"] for f in self._frames if f["intersections"] is not None]
        return {
            "scene": self._recording.name,
            "clothsim": _core.__version__,
            "build": _core.BUILD_PROFILE,
            "python": platform.python_version(),
            "machine": platform.machine(),
            "threads": summary["threads"],
            "detection": summary["detection"],
            "fallbacks": summary["fallbacks"],
            "choices": summary["choices"],
            "refused": summary["refused"],
            "untangled": summary["untangled"],
            "scene_digest": self._scene_digest,
            "error": None if self._error is None else f"{type(self._error).__name__}: {self._error}",
            "simulated_seconds": self._simulation.time,
            "wall_seconds": self._wall_seconds,
            "frame_count": len(self._frames),
            "fps": self._recording.fps,
            "bodies": [body_facts(body) for body in self._recording.bodies],
            "plan": dict(self._simulation.plan),
            "totals": summary["totals"],
            "effects": summary["effects"],
            "max_intersections": max(intersections, default=None),
            "outputs": [*written, "report.json"],
            "states": states,
            "continued": summary.get("continued"),
            "frames": self._frames,
        }
