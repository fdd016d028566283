"""Where a run begins that goes on from a frame of another one."""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim import _core
from clothsim._arrays import Floats
from clothsim._device import check_device, check_threads
from clothsim._run.states import FOLDER, frame_count, promised, read_state, states_of
from clothsim.errors import InvalidInput
from clothsim.recording import Body, Recording, flattened
from clothsim.scene import Scene

if TYPE_CHECKING:
    from clothsim.simulation import Simulation

__all__ = ["Start", "load_run"]

_logger = logging.getLogger(__name__)
_WITHOUT = "without its state (--no-state, state=False) it goes on with positions and velocities alone"


@dataclass(frozen=True, eq=False)
class Start:
    """The cloth in a frame, or its full state.

    Attributes
    ----------
    time : float
        Time of the frame [s].
    positions, velocities : (n, 3) float64
        Of all cloth vertices of the scene, in its order [m], [m/s].
    estimated : bool
        The recording has no velocities: these are differences of positions.
    state : bytes or None
        The full state, which then has positions and velocities too: those above are empty.
    cloths : sequence of Body
        The cloths of the recording that positions and velocities were taken from.
    """

    time: float
    positions: Floats
    velocities: Floats
    estimated: bool
    state: bytes | None = None
    cloths: tuple[Body, ...] = ()

    @classmethod
    def of(cls, recording: Recording, scene: Scene, frame: int = -1, *, asked: bool = False) -> Start:
        """Take frame number ``frame`` (negative: from the end) of a recording with the cloths of ``scene``.

        Velocities that were not recorded are the difference of the frames after and before over their time: exact for
        steady motion, smoothed where something hit in between. What else a frame lacks is said in a warning, unless
        it was ``asked`` for without.

        Raises
        ------
        InvalidInput
            There is no such frame, or the recording has not the scene's cloths.
        """
        count = len(recording)
        if not -count <= frame < count:
            expected = f"a frame of the recording, 0 to {count - 1}" if count else "a recording with frames"
            raise InvalidInput(
                f"frame: expected {expected}, got {frame}", name="frame", expected=expected, got=str(frame)
            )
        at = frame % count
        names = [table["name"] for table in scene.to_dict()["cloth"]]
        known = {body.name: body for body in recording.cloth}
        for name in names:
            if name not in known:
                raise InvalidInput(
                    f"recording: expected the scene's cloth {name!r}, got {', '.join(map(repr, known)) or 'no cloth'}",
                    name="recording",
                )
        before, after = max(at - 1, 0), min(at + 1, count - 1)
        span = float(recording.times[after] - recording.times[before])
        positions, velocities = [], []
        for name in names:
            positions.append(recording.positions(name, at))
            kept = recording.velocities(name, at)
            if kept is None and span > 0.0:
                kept = (recording.positions(name, after) - recording.positions(name, before)) / span
            velocities.append(np.zeros_like(positions[-1]) if kept is None else kept)
        lost = _lost(scene.to_dict())
        if lost and not asked:
            _logger.warning(
                "a frame without a state: %s begin anew, and the run is near the old one (output.states = N keeps "
                "states of every N frames)", " and ".join(lost),
            )  # fmt: skip
        if not recording.has_velocities:
            _logger.warning(
                "the recording has no velocities: they are taken from the differences of its frames "
                "(output.velocities = true keeps them)"
            )
        return cls(
            float(recording.times[at]), np.concatenate(positions), np.concatenate(velocities),
            not recording.has_velocities, cloths=tuple(known[name] for name in names),
        )  # fmt: skip

    @classmethod
    def of_state(cls, path: Path) -> Start:
        """Take the full state in a file: one of ``OUT/states``, or what `Simulation.save_checkpoint` wrote.

        Raises
        ------
        CheckpointError
            The file cannot be read, is something else, was cut off or damaged.
        """
        header, state = read_state(path)
        none = np.zeros((0, 3))
        return cls(float(header["time"]), none, none, estimated=False, state=state)

    @classmethod
    def of_run(cls, run: Path, scene: Scene, frame: int | None = None, *, state: bool = True) -> Start:
        """Take a frame of a run, by its folder, or a state, by its file.

        Where the run has kept states the frame must have one, unless ``state`` is false: then positions and velocities
        go on, and what else is lost is said. By default the last frame (that has a state).

        Raises
        ------
        InvalidInput
            There is no run, no such frame, no state of it, or the run has not the scene's cloths.
        CheckpointError
            The state cannot be read, was cut off or damaged.
        """
        if run.suffix in (".state", ".checkpoint") and run.is_file():
            if frame is not None or not state:
                name = "frame" if state else "state"
                raise InvalidInput(f"{name}: expected nothing with the file of a state, {run}", name=name)
            return cls.of_state(run)
        states = states_of(run) if state else {}
        if states:
            return cls.of_state(states[_frame_with_state(run, states, frame)])
        if state and promised(run):
            expected = "the states that the run's report speaks of"
            raise InvalidInput(f"{run / FOLDER}: expected {expected}, got nothing; {_WITHOUT}", name="state")
        return cls.of(load_run(run), scene, -1 if frame is None else frame, asked=not state)

    def begin(self, scene: Scene, threads: int | None, device: str, allow: bool) -> _core.Simulation:
        """Build the engine of ``scene`` from here on.

        Raises
        ------
        InvalidInput
            A cloth of the scene has another mesh than in the recording.
        """
        scene_core, assets = scene.check(), scene.assets()
        options = (check_threads(threads), check_device(device), allow)
        if self.state is None:
            begin = (self.time, np.ascontiguousarray(self.positions), np.ascontiguousarray(self.velocities))
            try:
                core = _core.Simulation(scene_core, *assets, *options, begin)
            except InvalidInput as error:
                if error.name == "positions":  # other numbers of vertices: whose?
                    self._check_cloths(_core.Simulation(scene_core, *assets, *options[:2], True, None))
                raise
            self._check_cloths(core)
            return core
        core = _core.Simulation.continue_from(self.state, scene_core, *assets, *options)
        continued = json.loads(core.summary())["continued"]
        text = f"; edited since: {', '.join(continued['edited'])}" if continued["edited"] else ", to the same bits"
        _logger.info("going on from the full state at %g s%s", self.time, text)
        if continued["anew"]:
            _logger.warning("at %g s begin anew: %s", self.time, "; ".join(continued["anew"]))
        return core

    def _check_cloths(self, core: _core.Simulation) -> None:
        """Refuse an engine whose cloths have other meshes than those of the recording."""
        for was, (name, _, (first, last), (_, triangles, _)) in zip(self.cloths, core.bodies(), strict=False):
            expected = got = ""
            if last - first != was.vertex_count:
                expected, got = f"the {was.vertex_count} vertices that it has in the recording", f"{last - first}"
            elif not np.array_equal(triangles, was.triangles):
                expected, got = "the triangles that it has in the recording", "other triangles"
            if expected:
                raise InvalidInput(
                    f"cloth {name!r}: expected {expected}, got {got}", name="recording", expected=expected, got=got
                )

    def undeformed(self, simulation: Simulation) -> list[Body]:
        """Bodies of a simulation that began here: cloth whose undeformed shape no frame shows knows it itself."""
        bodies, first, start = simulation.bodies, 0, simulation._core.start_positions()
        for i, body in enumerate(bodies):
            if body.rest == "start":
                own = start[first : first + body.vertex_count]
                bodies[i] = replace(body, rest=flattened(own, body.triangles))
            first += body.vertex_count
        return bodies

    def digest(self) -> str:
        """Fingerprint of the state."""
        sha = hashlib.sha256(repr(self.time).encode())
        for array in (self.positions, self.velocities):
            sha.update(array.tobytes())
        sha.update(self.state or b"")
        return sha.hexdigest()


def load_run(run: Path) -> Recording:
    """Frames of a finished run, by its folder or by its frames.npz.

    Raises
    ------
    InvalidInput
        There are no frames, or they cannot be read.
    """
    path = run / "frames.npz" if run.is_dir() else run
    if not path.exists():
        reason = "the run is not finished, or output.npz = false" if run.is_dir() else "no such file"
        raise InvalidInput(f"{path}: expected the frames of a run, got nothing ({reason})", name="OUT")
    return Recording.load(path)


def _frame_with_state(run: Path, states: dict[int, Path], frame: int | None) -> int:
    if frame is None:
        return max(states)
    count = frame_count(run)
    if count is not None and not -count <= frame < count:
        expected = f"a frame of {run}, 0 to {count - 1}"
        raise InvalidInput(f"frame: expected {expected}, got {frame}", name="frame", expected=expected)
    at = frame + (count or 0) if frame < 0 else frame
    if at not in states:
        near = [max((f for f in states if f < at), default=None), min((f for f in states if f > at), default=None)]
        expected = f"a frame with a state, the nearest {' and '.join(str(f) for f in near if f is not None)}"
        raise InvalidInput(
            f"frame: expected {expected}, got {frame}; {_WITHOUT}", name="frame", expected=expected, got=str(frame)
        )
    return at


def _lost(scene: dict[str, Any]) -> list[str]:
    """What positions and velocities do not tell of a scene's state."""
    laws = json.dumps([[cloth.get("material"), cloth.get("regions")] for cloth in scene["cloth"]])
    lost = []
    if "hysteresis" in laws or "plastic" in laws:
        lost.append("what bending remembers")
    if scene.get("contact") is not None:
        lost.append("sides and forces of contact")
    if (scene.get("effects") or {}).get("sleep") is not None:
        lost.append("what sleeps")
    if (scene.get("time") or {}).get("dt") == "auto":
        lost.append('the step that dt = "auto" has found')
    return lost
