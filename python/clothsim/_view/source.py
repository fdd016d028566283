"""What there is to look at in the folder of a run, finished or not."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._frames import standing_positions
from clothsim._run.folder import RunFolder
from clothsim._run.frames import frames_so_far
from clothsim._run.sealed import read_sealed as read_checkpoint
from clothsim._scene_facts import contact_thickness
from clothsim._view import report
from clothsim.errors import CheckpointError, InvalidInput
from clothsim.recording import Recording
from clothsim.simulation import Simulation

__all__ = ["Source"]

# Largest coordinate that is drawn [m]: products of such lengths are float32 numbers.
_FARTHEST = 1e12


@dataclass
class Source:
    """A run as it lies in its folder.

    Attributes
    ----------
    path : Path
        The folder, or a ``frames.npz`` alone.
    recording : Recording or None
        The frames; None where the run kept none.
    facts : list of dict
        What the report has about each frame; empty without a report.
    effects : list of dict
        What each effect cost, of a finished run.
    notices : list of str
        What a person should know about the run before looking at it.
    """

    path: Path
    recording: Recording | None
    facts: list[dict[str, Any]] = field(default_factory=list)
    effects: list[dict[str, Any]] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)
    _missing: str = ""

    @property
    def title(self) -> str:
        """The scene's name, else the folder's."""
        name = self.recording.name if self.recording is not None else ""
        return name or self.path.resolve().stem

    def frames(self) -> Recording:
        """Return the recording.

        Raises
        ------
        InvalidInput
            The run kept no frames, or what is in them cannot be drawn.
        """
        if self.recording is None:
            raise _wrong(self.path, "a run with frames", self._missing)
        if len(self.recording) == 0:
            raise _wrong(self.path, "a run with frames", "a recording of none")
        if not any(body.vertex_count for body in self.recording.bodies):
            raise _wrong(self.path, "a run with bodies", "a recording of none")
        if (reach := self.recording.reach()) > _FARTHEST:
            raise _wrong(self.path, f"coordinates up to {_FARTHEST:g} m", f"{reach:g} m")
        return self.recording

    def frame_number(self, asked: int | None) -> int | None:
        """Return the frame that was asked for, counted from the start (negative: from the end); None if none was.

        Raises
        ------
        InvalidInput
            There is no such frame.
        """
        total = len(self.frames())
        if asked is not None and not -total <= asked < total:
            expected = f"a frame from 0 to {total - 1} (or -1, the last)"
            raise InvalidInput(f"--frame: expected {expected}, got {asked}", name="--frame")
        return None if asked is None else asked % total

    @classmethod
    def of(cls, path: Path) -> Source:
        """Read a run's folder or a ``frames.npz``.

        Raises
        ------
        InvalidInput
            There is no run, or it cannot be read.
        CheckpointError
            The run is not finished and its checkpoint cannot be read.
        """
        if not path.exists():
            raise _wrong(path, "the folder of a run (clothsim run SCENE -o OUT makes one)", "nothing of that name")
        if not path.is_dir():
            return cls(path, Recording.load(path), notices=["only frames: no report, so no plots"])
        folder = RunFolder(path)
        if (path / "frames.npz").exists() or (path / "report.json").exists():
            source = cls._finished(path)
            if folder.started and folder.holds_work:
                source.notices.append("a newer run in the same folder is not finished; this is the one before")
            return source
        if folder.started and folder.holds_work:
            return cls._unfinished(folder)
        inside = ", ".join(sorted(p.name for p in path.iterdir())[:4])
        raise _wrong(path, "the folder of a run (frames.npz, report.json)", f"a folder with {inside or 'nothing'}")

    @classmethod
    def _finished(cls, path: Path) -> Source:
        frames = path / "frames.npz"
        recording = Recording.load(frames) if frames.exists() else None
        source = cls(path, recording, _missing="one with output.npz = false")
        try:
            source.facts, source.effects, error = report.read(path / "report.json")
        except FileNotFoundError:
            source.notices.append("report.json is missing: no plots")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OSError) as problem:
            source.notices.append(f"report.json cannot be read ({type(problem).__name__}): no plots")
        else:
            if error:
                source.notices.append(f"the run stopped with an error: {error}")
        return source

    @classmethod
    def _unfinished(cls, folder: RunFolder) -> Source:
        """Read the frames so far; meshes and names come from the checkpoint. Nothing is written or locked."""
        if not folder.has_checkpoint:
            got = "a run that has just begun: look again after its first checkpoint (output.checkpoint_interval)"
            raise _wrong(folder.out, "a run with a checkpoint or finished", got)
        header, engine = _last_whole(folder)
        simulation = Simulation._from_bytes(engine, 1, "cpu")
        scene = json.loads(simulation._core.scene())
        # A run that goes on from another one has that frame's fingerprint behind its scene's.
        own_start = len(str(header.get("digest", ""))) <= 64
        bodies = [replace(b, rest=b.rest if own_start or b.rest != "start" else None) for b in simulation.bodies]
        moving = sum(b.vertex_count for b in bodies if not b.static)
        cloth = sum(b.vertex_count for b in bodies if b.kind == "cloth")
        has_velocities = bool(scene["output"]["velocities"])
        width = moving + cloth * has_velocities
        frames, facts = frames_so_far(folder.work, width)
        count, times = len(facts), np.array([fact["time"] for fact in facts], dtype=np.float64)
        recording = Recording(
            bodies, times, frames[:, :moving], standing_positions(bodies, simulation.collider_positions),
            velocities=frames[:, moving:] if has_velocities else None, fps=float(scene["output"]["fps"]),
            up=scene["up"], name=scene["name"], thickness=contact_thickness(scene),
        )  # fmt: skip
        end = f"{times[-1]:g} of {scene['duration']:g} s" if count else "nothing yet"
        return cls(folder.out, recording, facts, notices=[f"the run is not finished: {count} frames so far ({end})"])


def _last_whole(folder: RunFolder) -> tuple[dict[str, Any], bytes]:
    """Return the last checkpoint that can be read, or say what is wrong with the oldest."""
    *newer, oldest = folder.checkpoints()
    for path in newer:
        with contextlib.suppress(CheckpointError):
            return read_checkpoint(path)
    return read_checkpoint(oldest)


def _wrong(path: Path, expected: str, got: str) -> InvalidInput:
    return InvalidInput(f"{path}: expected {expected}, got {got}", name="OUT", expected=expected, got=got)
