"""One run from scene to outputs."""

from __future__ import annotations

import contextlib
import json
import logging
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from clothsim._device import check_device
from clothsim._run.facts import FrameFacts
from clothsim._run.folder import RunFolder, digest
from clothsim._run.frames import FrameWriter
from clothsim._run.outputs import Outputs, check_packages
from clothsim._run.start import Start
from clothsim.errors import (
    CheckpointError,
    DeviceError,
    OutputExists,
    SimulationDiverged,
    SimulationStuck,
    SolverFailed,
)
from clothsim.recording import Recording
from clothsim.scene import Scene
from clothsim.simulation import Simulation, frame_lengths, moving_positions, progress_bar, standing_positions

__all__ = ["Job", "Stopped"]

_logger = logging.getLogger(__name__)


class Stopped(Exception):
    """The run was stopped by a signal, after a checkpoint."""

    def __init__(self, signum: int, frames: int, total: int, seconds: float) -> None:
        super().__init__(f"stopped by {signal.Signals(signum).name}")
        self.signum = signum
        self.frames = frames
        self.total = total
        self.seconds = seconds


@dataclass
class Job:
    """What is asked for on the command line.

    Attributes
    ----------
    scene : Scene
        What to simulate.
    out : Path
        Output folder.
    threads : int or None
        How many threads.
    device : str
        Where to detect collisions.
    frames : int or None
        Stop after so many frames.
    allow_intersections : bool
        Run from a start with intersections, even if the scene does not say so.
    resume, overwrite : bool
        What to do with a run that is there already.
    start : Start or None
        The frame of another run to go on from; by default the scene's own start.
    progress : bool
        Show a bar.
    """

    scene: Scene
    out: Path
    threads: int | None = None
    device: str = "auto"
    frames: int | None = None
    allow_intersections: bool = False
    resume: bool = False
    overwrite: bool = False
    progress: bool = True
    start: Start | None = None

    def run(self) -> dict[str, Any]:
        """Simulate and write what the scene's ``[output]`` asks for; return the report without its frames.

        Raises
        ------
        Stopped
            After a signal; ``resume`` goes on.
        OutputExists
            The folder holds a run, and neither ``resume`` nor ``overwrite`` is set.
        DeviceError
            After a checkpoint; ``resume`` goes on, on any device.
        """
        check_device(self.device)
        settings = self.scene.output
        check_packages(settings)
        folder = RunFolder(self.out)
        complete = self._check_folder(folder)
        if complete is not None:
            return complete
        simulation = None if folder.started else self._new_simulation()  # bad input leaves no folder behind
        with folder.locked():
            return self._run(folder, settings, simulation)

    def _check_folder(self, folder: RunFolder) -> dict[str, Any] | None:
        """Refuse a folder that is in use; return the report of a run that is complete and to be resumed."""
        if folder.out.exists() and not folder.out.is_dir():
            raise OutputExists(f"{self.out}: expected a folder, got a file")
        if self.resume and not folder.started and (self.out / "report.json").exists():
            return {**self._finished(), "resumed": "complete already"}
        if self.resume or self.overwrite:
            return None
        if folder.started:
            raise OutputExists(
                f"{self.out}: holds an unfinished run; --resume goes on with it, --overwrite starts anew"
            )
        if present := folder.present():
            raise OutputExists(f"{self.out}: holds a run already ({', '.join(present)}); --overwrite replaces it")
        return None

    def _finished(self) -> dict[str, Any]:
        """Return the report of the run in the folder, without its frames; refuse it if it is not what is asked for."""
        anew = "--overwrite starts anew"
        try:
            report = json.loads((self.out / "report.json").read_bytes())
            known = isinstance(report, dict) and {"scene_digest", "error", "frame_count", "totals"} <= report.keys()
        except ValueError:
            known = False
        if not known:
            raise CheckpointError(f"{self.out}: report.json is damaged or of another version; {anew}")
        if report["scene_digest"] != self._digest():
            raise CheckpointError(
                f"{self.out}: the finished run is of another scene, or the scene or one of its meshes has changed; "
                f"{anew}"
            )
        if report["error"] is not None:
            raise CheckpointError(f"{self.out}: the run ended with an error ({report['error']}); {anew}")
        asked = 1 + len(self._lengths())
        if report["frame_count"] < asked:
            raise CheckpointError(
                f"{self.out}: the finished run has {report['frame_count']} of {asked} frames, "
                f"and its checkpoint is gone; {anew}"
            )
        return {key: value for key, value in report.items() if key != "frames"}

    def _digest(self) -> str:
        """Fingerprint of what is asked for: the scene, and the frame that the run begins with."""
        return digest(self.scene) + ("" if self.start is None else self.start.digest())

    def _lengths(self) -> list[float]:
        """Time from each frame to the next [s], to the end of the scene or as many frames as are asked for."""
        begin = 0.0 if self.start is None else self.start.time
        return frame_lengths(max(0.0, self.scene.duration - begin), float(self.scene.output["fps"]))[: self.frames]

    def _new_simulation(self) -> Simulation:
        if self.start is not None:
            return Simulation._from_start(
                self.scene, self.start, self.threads, self.device, allow_intersections=self.allow_intersections
            )
        return Simulation(self.scene, self.threads, self.device, allow_intersections=self.allow_intersections)

    def _run(self, folder: RunFolder, settings: dict[str, Any], simulation: Simulation | None) -> dict[str, Any]:
        fingerprint = self._digest()
        if not self.resume:
            folder.clear_work()
        header, simulation = self._start(folder, fingerprint, simulation)
        if header["frames"] == 0:
            for warning in simulation.plan["warnings"]:
                _logger.warning("%s", warning)
        fps = float(settings["fps"])
        lengths = self._lengths()
        bodies = simulation.bodies
        standing = standing_positions(bodies, simulation.collider_positions)
        every = round(float(settings["checkpoint_interval"]) * fps)
        moving = sum(b.vertex_count for b in bodies if not b.static)
        with_velocities = bool(settings["velocities"])
        cloth = sum(b.vertex_count for b in bodies if b.kind == "cloth")
        writer = FrameWriter(folder.work, moving + cloth * with_velocities, keep=header["frames"])
        facts = FrameFacts(simulation, header)

        def checkpoint() -> None:
            writer.sync()
            folder.save_checkpoint(facts.header(writer.frames, fingerprint), simulation._core.checkpoint(facts.steps))

        try:
            error = self._simulate(simulation, lengths, writer, facts, checkpoint, every)
            lines = writer.facts()
            times = np.array([line["time"] for line in lines])
            scene = self.scene.to_dict()
            rows = writer.rows()
            recording = Recording(
                bodies, times, rows[:, :moving], standing,
                velocities=rows[:, moving:] if with_velocities else None, fps=fps, up=scene["up"], name=scene["name"],
            )  # fmt: skip
            outputs = Outputs(
                self.out, settings, recording, lines, simulation, facts.wall_seconds(), error, fingerprint
            )
            report = outputs.write(progress=self.progress)
        finally:
            writer.close()
        folder.remove_work()
        if error is not None:
            raise error
        return report

    def _simulate(
        self,
        simulation: Simulation,
        lengths: list[float],
        writer: FrameWriter,
        facts: FrameFacts,
        checkpoint: Callable[[], None],
        every: int,
    ) -> SimulationDiverged | SimulationStuck | SolverFailed | None:
        """Go on to the last frame; return the error that stopped it before, if one did."""
        core, bodies = simulation._core, simulation.bodies
        bar = progress_bar(len(lengths) + 1, initial=writer.frames, enabled=self.progress, name=self.scene.name)
        error: SimulationDiverged | SimulationStuck | SolverFailed | None = None
        try:
            with _Signals() as signals:
                while writer.frames <= len(lengths):
                    before, stopped = core.step_count, False
                    try:
                        with signals.raising():
                            if core.interrupted:
                                simulation.finish_advance()
                            elif writer.frames > 0:
                                simulation.advance(lengths[writer.frames - 1])
                    except KeyboardInterrupt:
                        stopped = True
                    except (SimulationDiverged, SimulationStuck, SolverFailed) as failure:
                        error = failure
                        break
                    except DeviceError as failure:
                        checkpoint()
                        kept = f"{failure}; the frames so far are kept, and --resume goes on with them on any device"
                        raise DeviceError(kept, device=failure.device) from failure
                    # A signal during a frame's last step comes through after it: then the frame is complete.
                    if not stopped or (core.step_count > before and not core.interrupted):
                        rows = moving_positions(bodies, simulation.positions, simulation.collider_positions)
                        if self.scene.output["velocities"]:
                            rows = np.concatenate([rows, simulation.velocities])
                        writer.append(rows, facts.next(writer.frames))
                        bar.update()
                    if stopped:
                        checkpoint()
                        raise Stopped(signals.signum, writer.frames, len(lengths) + 1, simulation.time)
                    if every > 0 and writer.frames % every == 0:
                        checkpoint()
            checkpoint()
        finally:
            bar.close()
        return error

    def _start(
        self, folder: RunFolder, fingerprint: str, simulation: Simulation | None
    ) -> tuple[dict[str, Any], Simulation]:
        """Header of the checkpoint to go on from (or an empty one), and the simulation at its state."""
        found = folder.load_checkpoint() if self.resume else None
        if found is None:
            return {"frames": 0, "steps": 0, "wall_seconds": 0.0}, simulation or self._new_simulation()
        header, engine = found
        if header.get("digest") != fingerprint:
            raise CheckpointError(
                f"{self.out}: the unfinished run is of another scene, or the scene or one of its meshes has changed; "
                "--overwrite starts anew"
            )
        return header, Simulation._from_bytes(engine, self.threads, self.device)


class _Signals:
    """Ctrl-C and SIGTERM raise only where the engine can stop between two steps; elsewhere they wait."""

    def __init__(self) -> None:
        self.signum = 0
        self._inside = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> _Signals:
        for signum in (signal.SIGINT, signal.SIGTERM):
            with contextlib.suppress(ValueError):  # not the main thread: signals go elsewhere
                self._before[signum] = signal.signal(signum, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._before.items():
            signal.signal(signum, handler)

    def _handle(self, signum: int, _frame: FrameType | None) -> None:
        self.signum = signum
        if self._inside:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def raising(self) -> Iterator[None]:
        """Let signals raise here, one that came before included."""
        self._inside = True
        try:
            if self.signum:
                raise KeyboardInterrupt
            yield
        finally:
            self._inside = False
