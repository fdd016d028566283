"""One run from scene to outputs."""

from __future__ import annotations

import json
import logging
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._device import check_device
from clothsim._frames import frame_lengths, moving_positions, standing_positions
from clothsim._progress import progress_bar
from clothsim._run.digests import digest
from clothsim._run.facts import FrameFacts
from clothsim._run.folder import RunFolder
from clothsim._run.frames import FrameWriter
from clothsim._run.outputs import Outputs, check_packages
from clothsim._run.sealed import read_sealed
from clothsim._run.signals import Signals
from clothsim._run.start import Start
from clothsim._run.states import StateWriter
from clothsim._scene_facts import contact_thickness
from clothsim.errors import (
    CheckpointError,
    ClothSimError,
    DeviceError,
    InvalidInput,
    OutputExists,
    SimulationDiverged,
    SimulationStuck,
    SolverFailed,
)
from clothsim.recording import Recording
from clothsim.scene import Scene
from clothsim.simulation import Simulation

__all__ = ["Finished", "Job", "Stopped"]

_logger = logging.getLogger(__name__)

# A time is that of a frame of a scene but for rounding if it is so near to it [frames].
_ON_A_FRAME = 1e-6


class Stopped(Exception):
    """The run was stopped by a signal, or for a reason of its caller's, after a checkpoint."""

    def __init__(self, signum: int, frames: int, total: int, seconds: float, reason: str = "") -> None:
        super().__init__(reason or f"stopped by {signal.Signals(signum).name}")
        self.signum = signum
        self.frames = frames
        self.total = total
        self.seconds = seconds


@dataclass(frozen=True, eq=False)
class Finished:
    """A run whose outputs are written, while everything is still at hand.

    Attributes
    ----------
    recording : Recording
        Its frames.
    facts : list of dict
        What is known about each frame: energy, counts, seconds.
    simulation : Simulation
        The state at the end.
    error : ClothSimError or None
        What stopped it before its end.
    resumed_at : int
        Frames that were there when this session began.
    wall_seconds : float
        Of all sessions [s].
    """

    recording: Recording
    facts: list[dict[str, Any]]
    simulation: Simulation
    error: ClothSimError | None
    resumed_at: int
    wall_seconds: float


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
    should_stop : callable, optional
        Asked after every frame; a reason in words stops the run after a checkpoint.
    finished : callable, optional
        Told of the run when its outputs are written, before the work folder goes.
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
    should_stop: Callable[[], str | None] | None = None
    finished: Callable[[Finished], None] | None = None

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
        whole, fps = self.scene.duration, float(self.scene.output["fps"])
        begin = 0.0 if self.start is None else self.start.time
        done = round(begin * fps)
        if abs(begin * fps - done) < _ON_A_FRAME:  # the lengths of the whole run, to the bit
            return frame_lengths(whole, fps)[done:][: self.frames]
        return frame_lengths(max(0.0, whole - begin), fps)[: self.frames]

    def _new_simulation(self) -> Simulation:
        if self.start is not None:
            if not self._lengths():
                expected = f"a time before the scene's end, duration = {self.scene.duration:g} s"
                got = f"{self.start.time:g} s"
                raise InvalidInput(f"frame: expected {expected}, got {got}", name="frame", expected=expected, got=got)
            return Simulation._from_start(
                self.scene, self.start, self.threads, self.device, allow_intersections=self.allow_intersections
            )
        return Simulation(self.scene, self.threads, self.device, allow_intersections=self.allow_intersections)

    def _run(self, folder: RunFolder, settings: dict[str, Any], simulation: Simulation | None) -> dict[str, Any]:
        fingerprint = self._digest()
        if not self.resume:
            folder.clear_work()
        header, simulation, writer = self._start(folder, fingerprint, simulation)
        if header["frames"] == 0:
            for warning in simulation.plan["warnings"]:
                _logger.warning("%s", warning)
        fps = float(settings["fps"])
        lengths = self._lengths()
        bodies = simulation.bodies if self.start is None else self.start.undeformed(simulation)
        standing = standing_positions(bodies, simulation.collider_positions)
        every = round(float(settings["checkpoint_interval"]) * fps)
        moving = sum(b.vertex_count for b in bodies if not b.static)
        with_velocities = bool(settings["velocities"])
        facts = FrameFacts(simulation, header)
        states = self._states(folder, fingerprint, len(lengths))
        states.take_back(writer.frames)

        def checkpoint() -> None:
            writer.sync()
            folder.save_checkpoint(facts.header(writer.frames, fingerprint), simulation._core.checkpoint(facts.steps))

        try:
            error = self._simulate(simulation, lengths, writer, facts, states, checkpoint, every)
            lines = writer.facts()
            times = np.array([line["time"] for line in lines])
            scene = self.scene.to_dict()
            rows = writer.rows()
            recording = Recording(
                bodies, times, rows[:, :moving], standing,
                velocities=rows[:, moving:] if with_velocities else None, fps=fps, up=scene["up"], name=scene["name"],
                thickness=contact_thickness(scene),
            )  # fmt: skip
            outputs = Outputs(
                self.out, settings, recording, lines, simulation, facts.wall_seconds(), error, fingerprint, states
            )
            report = outputs.write(progress=self.progress)
            if self.finished is not None:
                wall = facts.wall_seconds()
                self.finished(Finished(recording, lines, simulation, error, header["frames"], wall))
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
        states: StateWriter,
        checkpoint: Callable[[], None],
        every: int,
    ) -> SimulationDiverged | SimulationStuck | SolverFailed | None:
        """Go on to the last frame; return the error that stopped it before, if one did."""
        core, bodies, already = simulation._core, simulation.bodies, writer.frames
        bar = progress_bar(len(lengths) + 1, initial=writer.frames, enabled=self.progress, name=self.scene.name)
        error: SimulationDiverged | SimulationStuck | SolverFailed | None = None
        try:
            with Signals() as signals:
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
                        if states.wants(writer.frames - 1):
                            states.keep(writer.frames - 1, core)
                        bar.update()
                    if stopped:
                        checkpoint()
                        raise Stopped(signals.signum, writer.frames, len(lengths) + 1, simulation.time)
                    if self.should_stop is not None and (reason := self.should_stop()) is not None:
                        checkpoint()
                        raise Stopped(0, writer.frames, len(lengths) + 1, simulation.time, reason)
                    if every > 0 and writer.frames % every == 0:
                        checkpoint()
            if writer.frames > already or error is not None:
                checkpoint()
        finally:
            bar.close()
        return error

    def _start(
        self, folder: RunFolder, fingerprint: str, simulation: Simulation | None
    ) -> tuple[dict[str, Any], Simulation, FrameWriter]:
        """Header of the checkpoint to go on from (or an empty one), the simulation at its state, the frames until then.

        Where the last checkpoint or frames that it counts are damaged, the one before serves.
        """
        damage: list[str] = []
        for path in folder.checkpoints() if self.resume else []:
            try:
                header, engine = read_sealed(path)
                if header.get("digest") != fingerprint:
                    raise CheckpointError(
                        f"{self.out}: the unfinished run is of another scene, or the scene or one of its meshes has "
                        "changed; --overwrite starts anew"
                    ) from _Other()
                resumed = Simulation._from_bytes(engine, self.threads, self.device)
                writer = self._writer(folder, resumed, header["frames"])
            except CheckpointError as error:
                if isinstance(error.__cause__, _Other):
                    raise
                damage.append(str(error))
                continue
            if damage:
                text = f"{'; '.join(damage)}. Going on from the checkpoint before, at {resumed.time:g} s"
                _logger.warning("%s", text)
            return header, resumed, writer
        if damage:
            raise CheckpointError(f"{'; '.join(damage)}. There is no other checkpoint; --overwrite starts anew")
        simulation = simulation or self._new_simulation()
        return {"frames": 0, "steps": 0, "wall_seconds": 0.0}, simulation, self._writer(folder, simulation, 0)

    def _states(self, folder: RunFolder, fingerprint: str, last: int) -> StateWriter:
        every = int(self.scene.output["states"])
        return StateWriter(folder.out, folder.work, every, last, {"scene": self.scene.name, "digest": fingerprint})

    def _writer(self, folder: RunFolder, simulation: Simulation, keep: int) -> FrameWriter:
        """The frames in the work folder: rows of what moves, then velocities if they are kept."""
        bodies = simulation.bodies
        rows = sum(b.vertex_count for b in bodies if not b.static)
        if self.scene.output["velocities"]:
            rows += sum(b.vertex_count for b in bodies if b.kind == "cloth")
        return FrameWriter(folder.work, rows, keep=keep)


class _Other(Exception):
    """A checkpoint is whole and belongs to another scene: the one before does so too."""
