"""A scene being simulated."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from clothsim import _core
from clothsim._arrays import Floats, Ints, number
from clothsim._device import check_device, check_threads
from clothsim._files import path_from, write_whole
from clothsim._frames import frame_lengths
from clothsim._logs import EngineLog, step_reports
from clothsim._progress import progress_bar
from clothsim._record import record
from clothsim._scene_facts import bodies_of
from clothsim._state import Frame, Hinges, Plan
from clothsim._steering import steering
from clothsim.errors import CheckpointError
from clothsim.recording import Body, Recording
from clothsim.scene import Scene

if TYPE_CHECKING:
    from clothsim._run.start import Start

__all__ = ["Frame", "Hinges", "Plan", "Simulation", "record"]

_logger = logging.getLogger(__name__)


class Simulation:
    """A scene being simulated.

    Long calls release the interpreter, so that other threads go on; threads may share a simulation, each call has it
    alone. Ctrl-C stops between two steps and leaves the state of the last one.

    Parameters
    ----------
    scene : Scene
        What to simulate.
    threads : int, optional
        How many threads; all of the machine's by default. Results do not depend on it.
    device : {"auto", "cpu", "gpu"}
        Where to detect collisions during a step, with the detector that the scene's ``contact.detector`` says; results
        do not depend on it. ``"gpu"``: any Vulkan, Metal or DX12 adapter, a software adapter too. ``"auto"``: a GPU
        that is no software adapter, else the CPU; if the GPU fails, the CPU goes on in mid-run, with a warning in the
        log (logger ``clothsim.simulation``) and a note in `report`.
    allow_intersections : bool
        Run from a start with intersections, even if the scene does not say so.

    Raises
    ------
    InvalidScene
        A value or a mesh cannot be used; file, line and key are named.
    IntersectingStart
        Triangles pass through each other at the start; how many and which are named.
    GpuUnavailable
        ``device="gpu"``, and there is no adapter.
    DeviceError
        ``device="gpu"``, and it cannot be used.
    TypeError
        ``scene`` is no `Scene`.

    Examples
    --------
    >>> import clothsim as cs
    >>> scene = cs.Scene(duration=0.1)
    >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0, 5]}])
    >>> sim = cs.Simulation(scene, threads=1)
    >>> sim.advance(0.05)
    >>> round(sim.time, 6), sim.positions.shape
    (0.05, (36, 3))
    """

    def __init__(
        self,
        scene: Scene,
        threads: int | None = None,
        device: str = "auto",
        *,
        allow_intersections: bool = False,
    ) -> None:
        self._core = _core.Simulation(
            _checked(scene).check(),
            *scene.assets(),
            check_threads(threads),
            check_device(device),
            bool(allow_intersections),
            None,
        )
        self._log = EngineLog(_logger, self._core)

    @classmethod
    def from_frame(
        cls,
        scene: Scene,
        recording: Recording | str | os.PathLike[str],
        frame: int | None = None,
        threads: int | None = None,
        device: str = "auto",
        *,
        allow_intersections: bool = False,
        state: bool = True,
    ) -> Simulation:
        """Begin in mid-scene, at a frame of a run or as a recording shows it.

        The scene may be another one than that of the run, as long as it has cloths of the same names and meshes:
        colliders, pins, materials and times are the scene's. From a run that has kept states (``output.states``) the
        full state goes on, to the same bits if the scene is the same. A recording has no memory of what bending and
        contact did before its frame: the run is then the same only if neither matters, and near it else.

        Parameters
        ----------
        scene : Scene
            What to simulate.
        recording : Recording or path
            Folder of a run, or frames with the scene's cloths, by name. With velocities (``output.velocities = true``)
            they are exact; without, they are the differences of the frames beside it.
        frame : int, optional
            Number of the frame; negative: from the end. By default the last one; of a run with states, the last that
            has one.
        threads, device, allow_intersections
            As for `Simulation`.
        state : bool
            False: positions and velocities alone, though the run has kept states.

        Raises
        ------
        InvalidInput
            There is no such frame, it has no state while others have, or its cloths are not the scene's.
        InvalidScene
            A cloth has other vertices or triangles than in the state.
        CheckpointError
            The state cannot be read, was cut off or damaged, or is of another version.
        IntersectingStart
            Triangles pass through each other there: an edited collider may be inside the cloth.

        Examples
        --------
        >>> import clothsim as cs
        >>> scene = cs.Scene(duration=0.2)
        >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0, 5]}])
        >>> frames = cs.record(cs.Simulation(scene), 0.1, fps=20, progress=False)
        >>> round(cs.Simulation.from_frame(scene, frames, 1).time, 3)
        0.05
        """
        from clothsim._run.start import Start

        if isinstance(recording, Recording):
            start = Start.of(recording, scene, -1 if frame is None else frame)
        else:
            start = Start.of_run(path_from(recording, "recording"), scene, frame, state=state)
        return cls._from_start(scene, start, threads, device, allow_intersections=allow_intersections)

    @classmethod
    def _from_start(
        cls, scene: Scene, start: Start, threads: int | None, device: str, *, allow_intersections: bool
    ) -> Simulation:
        return cls._over(start.begin(_checked(scene), threads, device, bool(allow_intersections)))

    @classmethod
    def _over(cls, core: _core.Simulation) -> Simulation:
        simulation = cls.__new__(cls)
        simulation._core = core
        simulation._log = EngineLog(_logger, core, resumed=True)
        return simulation

    # Stepping --------------------------------------------------------------------------------------------------

    def step(self) -> dict[str, Any]:
        """Take one step of the scene's ``time.dt`` and return its report: counts, residuals, seconds per stage.

        Raises
        ------
        SimulationDiverged, SimulationStuck
            The step failed at every size tried; the state is the last good one.
        DeviceError
            ``device="gpu"``, and it gave no answer; the state is the last good one, and the next step asks it again.
        """
        with self._log.stepping():
            self._core.step()
        last: dict[str, Any] = json.loads(self._core.steps(step_reports(self._core) - 1))[0]
        return last

    def advance(self, seconds: float) -> None:
        """Advance by ``seconds`` [s] in equal steps of at most the scene's ``time.dt``.

        Parameters
        ----------
        seconds : float
            How far [s], ≥ 0.

        Raises
        ------
        SimulationDiverged, SimulationStuck
            A step failed at every size tried; the state is the last good one.
        DeviceError
            ``device="gpu"``, and it gave no answer; the state is the last good one. `finish_advance` does the rest.
        KeyboardInterrupt
            Between two steps; `finish_advance` (also after a checkpoint) does the rest with the same steps.
        """
        with self._log.stepping():
            self._core.advance(number(seconds, "seconds", "a finite number ≥ 0 [s]"))

    def finish_advance(self) -> None:
        """Do what an interrupted `advance` has left, to the same bits as without the interruption."""
        with self._log.stepping():
            self._core.finish_advance()

    def steer(
        self,
        cloth: str,
        pin: int = 0,
        *,
        position: ArrayLike,
        rotation: Mapping[str, Any] | None = None,
        seconds: float,
    ) -> None:
        """Have a pin go from where it is to a pose, as a gripper does, and stay there; what it was to do is dropped.

        Parameters
        ----------
        cloth, pin
            Name of the cloth, and the number of its pin in the scene.
        position : (3,) array
            Displacement of the pinned vertices from the scene's start [m], as in a keyframe.
        rotation : mapping, optional
            ``axis`` and ``angle`` [rad] about the pin's pivot, as in a keyframe; by default none.
        seconds : float
            When it is there, from now [s], > 0. It moves as between two keyframes: at a steady pace, along a line.

        Raises
        ------
        InvalidInput
            There is no such cloth or pin, a collider carries it, or an interrupted `advance` has something left.
        InvalidScene
            A number that a keyframe may not have.

        Examples
        --------
        >>> import clothsim as cs
        >>> scene = cs.Scene(duration=0.1)
        >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0]}])
        >>> sim = cs.Simulation(scene)
        >>> start = sim.positions[0]
        >>> sim.steer("cloth", 0, position=(0.0, 0.1, 0.0), seconds=0.05)
        >>> sim.advance(0.05)
        >>> (sim.positions[0] - start).round(6).tolist()
        [0.0, 0.1, 0.0]
        """
        names = [table["name"] for table in json.loads(self._core.scene())["cloth"]]
        self._core.steer(*steering(names, cloth, pin, position, rotation, seconds))

    def run(self, seconds: float | None = None, fps: float = 60.0, progress: bool = True) -> Iterator[Frame]:
        """Yield the state now and then ``fps`` times per simulated second.

        Parameters
        ----------
        seconds : float, optional
            How long [s]; what is left of the scene's duration by default. Where it is no whole number of frames, the
            last frame comes sooner.
        fps : float
            Frames per simulated second.
        progress : bool
            Show a bar with an estimate on stderr.

        Yields
        ------
        Frame
            Its arrays are copies.

        Examples
        --------
        >>> import clothsim as cs
        >>> scene = cs.Scene(duration=0.1)
        >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 6, 6), "cotton", pins=[{"vertices": [0, 5]}])
        >>> [round(frame.time, 3) for frame in cs.Simulation(scene).run(fps=20, progress=False)]
        [0.0, 0.05, 0.1]
        """
        if seconds is None:
            seconds = max(0.0, float(json.loads(self._core.scene())["duration"]) - self.time)
        lengths = frame_lengths(seconds, fps)
        bar = progress_bar(len(lengths), enabled=progress)
        try:
            yield self.frame(0)
            for index, length in enumerate(lengths, start=1):
                self.advance(length)
                bar.update()
                yield self.frame(index)
        finally:
            bar.close()

    def frame(self, index: int = 0) -> Frame:
        """Return the state now, as a frame of that number.

        Parameters
        ----------
        index : int
            The number that the frame gets.
        """
        return Frame(index, self.time, self.positions, self.velocities, self.collider_positions)

    # State -----------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._core.time

    @property
    def positions(self) -> Floats:
        """Positions of all cloth vertices [m], shape (n, 3), cloth after cloth in scene order; a copy."""
        return self._core.positions()

    @property
    def velocities(self) -> Floats:
        """Velocities of all cloth vertices [m/s], shape (n, 3); a copy."""
        return self._core.velocities()

    @property
    def collider_positions(self) -> Floats:
        """Positions of all collider vertices [m], shape (k, 3); a copy."""
        return self._core.collider_positions()

    @property
    def masses(self) -> Floats:
        """Lumped mass of each cloth vertex [kg], shape (n,); a copy."""
        return self._core.masses()

    @property
    def contact_forces(self) -> Floats:
        """Force of contact on each cloth vertex in the last step [N], shape (n, 3), strain limits included; a copy.

        The impulses of response and the forces of constraints over the step; zero before the first step and where
        nothing touches. Per vertex they depend on how contact shares what presses; their sums over a piece of cloth do
        not.
        """
        return self._core.contact_forces()

    @property
    def energy(self) -> dict[str, float]:
        """Mechanical energy of the cloth [J]: kinetic, stretch, shear, bending, gravity, and their total."""
        energy: dict[str, float] = json.loads(self._core.energy())
        return {**energy, "total": sum(energy.values())}

    @property
    def bodies(self) -> list[Body]:
        """Names and meshes of all bodies, cloth first, in scene order."""
        return bodies_of(self._core)

    @property
    def hinges(self) -> Hinges:
        """What bending has left behind, hinge by hinge; empty where no material has a law that remembers."""
        return Hinges(*self._core.hinges())

    def intersections(self) -> Ints:
        """Pairs of triangles that pass through each other now, shape (k, 2), under the scene's rules of contact.

        Triangles are counted through all bodies. Without contact in the scene there are none.
        """
        return self._core.intersections()

    # What runs and what it cost --------------------------------------------------------------------------------

    @property
    def plan(self) -> Plan:
        """Which effects run and why; ``print(sim.plan)`` for a table."""
        tables, text = self._core.plan()
        return Plan(json.loads(tables), text)

    @property
    def report(self) -> dict[str, Any]:
        """What happened so far: ``steps`` (one table each), ``totals``, ``effects`` with their cost, ``threads``.

        ``detection`` says which detector runs where and why, ``fallbacks`` which GPUs were done without since when,
        ``choices`` what ``contact.detector = "auto"`` chose by measuring.
        ``left_out`` counts the first steps that a checkpoint had no tables of; ``totals`` and ``effects`` have them.
        """
        report: dict[str, Any] = json.loads(self._core.summary())
        report["steps"] = json.loads(self._core.steps(0))
        return report

    # Checkpoints -----------------------------------------------------------------------------------------------

    def save_checkpoint(self, path: str | os.PathLike[str], *, steps: bool = True) -> None:
        """Write scene, meshes, the full state and the report to a file, whole or not at all.

        Parameters
        ----------
        path : path
            The file.
        steps : bool
            Write the table of each step too. They grow with the run; without them, a simulation that goes on from here
            has the totals of all steps and the tables of the later ones.
        """
        write_whole(path_from(path), self._core.checkpoint(0 if steps else step_reports(self._core)))

    @classmethod
    def resume(
        cls,
        path: str | os.PathLike[str],
        threads: int | None = None,
        device: str = "auto",
        *,
        scene: Scene | None = None,
    ) -> Simulation:
        """Go on from a checkpoint, to the same bits as if the run had not been interrupted.

        ``threads`` and ``device`` may be others than before, as for `Simulation`. With another ``scene``, which has the
        same cloths, the full state goes on with that: what its edits touch begins anew, and ``report["continued"]``
        and a warning say so.

        Parameters
        ----------
        path : str or path
            What `save_checkpoint` wrote, or with ``scene`` the state of a frame (``OUT/states/000012.state``).
        threads : int, optional
            How many threads; all by default.
        device : {"auto", "cpu", "gpu"}
            Where to detect collisions.
        scene : Scene, optional
            The scene to go on with; by default that in the checkpoint.

        Raises
        ------
        CheckpointError
            The file cannot be read, is no checkpoint, of another version, cut off or damaged.
        InvalidScene
            A cloth of ``scene`` has another name, or other vertices or triangles, than in the checkpoint.
        DeviceError
            As for `Simulation`.
        """
        if scene is not None:
            from clothsim._run.start import Start

            start = Start.of_state(path_from(path))
            return cls._from_start(scene, start, threads, device, allow_intersections=False)
        try:
            content = path_from(path).read_bytes()
        except OSError as error:
            raise CheckpointError(f"{path}: cannot read the checkpoint: {error.strerror or error}") from error
        return cls._from_bytes(content, threads, device)

    @classmethod
    def _from_bytes(cls, content: bytes, threads: int | None, device: str) -> Simulation:
        return cls._over(_core.Simulation.resume(content, check_threads(threads), check_device(device)))

    def __repr__(self) -> str:
        cloth = sum(b.vertex_count for b in self.bodies if b.kind == "cloth")
        return f"Simulation({cloth} cloth vertices, t = {self.time:g} s)"


def _checked(scene: Scene) -> Scene:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: expected a clothsim.Scene, got {type(scene).__name__}")
    return scene
