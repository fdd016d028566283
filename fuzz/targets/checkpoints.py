"""Checkpoints and states: damaged, and damaged with length and checksum put right, so that every field is reached.

A state goes on with the scene whose number its suffix has, not always its own. A file is either a simulation, which
takes a step or refuses to by an error of its own, or refused by name.
"""

from __future__ import annotations

import contextlib
import functools
import json
import struct
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import _core
from clothsim.errors import ClothSimError
from fuzz.mutations import damaged, damaged_tree, edits, tree_edits
from fuzz.target import File, Target, refused

__all__ = ["sealed", "target"]

_HEADER = 20


def target() -> Target:
    """Checkpoints."""
    numbers = st.integers(0, len(_sound()) - 1)
    sound = numbers.map(lambda number: _sound()[number])
    state = numbers.map(lambda number: _states()[number])
    return Target(
        "checkpoints", "checkpoints",
        st.one_of(
            st.builds(lambda content, todo: _file(damaged(content, todo)), sound, edits()),
            st.builds(lambda content, todo: _file(sealed(damaged(content[_HEADER:-8], todo))), sound, edits(3)),
            st.builds(_with_scene, sound, tree_edits(2), st.booleans()),
            st.builds(_with_number, sound, st.integers(0, 2**20), _NUMBERS),
            st.builds(lambda n, content, todo: _state(n, damaged(content, todo)), numbers, state, edits(1)),
            st.builds(lambda n, content, todo: _state(n, resealed(content, todo)), numbers, state, edits(3)),
            st.builds(_state_with_number, numbers, state, st.integers(0, 2**20), _NUMBERS),
        ),
        check, lambda case: (case.suffix, case.content), File, plant, quick=250,
    )  # fmt: skip


def _file(content: bytes) -> File:
    return File(".checkpoint", content)


def _state(number: int, content: bytes) -> File:
    return File(f".state{number}", content)


def resealed(content: bytes, todo: list[tuple[Any, ...]]) -> bytes:
    """A state with a damaged payload, and the length and checksum of that."""
    return sealed(damaged(content[_HEADER:-8], todo), content[:12])


def _state_with_number(number: int, content: bytes, at: int, word: bytes) -> File:
    """Eight bytes replaced anywhere behind the scene's text, whose fields are no whole words."""
    payload = content[_HEADER:-8]
    end, _ = _texts(payload)
    place = end + at % (len(payload) - end - 7)
    return _state(number, sealed(payload[:place] + word + payload[place + 8 :], content[:12]))


@functools.cache
def _states() -> list[bytes]:
    """States of the same scenes."""
    return [cs.Simulation._from_bytes(content, 1, "cpu")._core.frame_state() for content in _sound()]


@functools.cache
def _sound() -> list[bytes]:
    """Checkpoints of the scenes at the same moment."""
    out = []
    for scene in _scenes():
        simulation = cs.Simulation(scene, threads=1, device="cpu")
        simulation.advance(0.01)
        out.append(simulation._core.checkpoint(1))
    return out


@functools.cache
def _scenes() -> list[cs.Scene]:
    """Small scenes that between them use every field."""
    grid = {"generator": "grid", "width": 0.2, "height": 0.2, "nx": 3, "ny": 3}
    ball: dict[str, Any] = {"name": "ball", "shape": {"type": "sphere", "radius": 0.1, "tolerance": 0.03}}
    law = {"fabric": "cotton", "bending": "hysteresis", "plasticity": 0.1}
    out = []
    for keys in (
        {"contact": {"thickness": 0.004}, "effects": {"sleep": {"speed": 1.0, "time": 0.005}}},
        {"contact": {"thickness": 0.004, "method": "constraints"}},
        {"time": {"dt": "auto"}},
        {},
    ):
        scene = cs.Scene(duration=0.1, **keys)
        scene.add_cloth(grid, law, position=(0.0, 0.104, 0.0), pins=[{"vertices": [0]}])
        scene.add_cloth(
            cs.Mesh.grid(0.1, 0.1, 2, 2), name="asset", position=(1.0, 0.0, 0.0), velocities=np.zeros((4, 3))
        )
        scene.add_collider(**ball)
        frames = np.repeat(cs.Mesh.grid(0.1, 0.1, 2, 2).vertices[None] + [0.0, -1.0, 0.0], 2, axis=0)
        scene.add_collider("lift", sequence=cs.Animation(frames, [[0, 1, 2], [1, 3, 2]], 10.0))
        out.append(scene)
    return out


def sealed(payload: bytes, head: bytes | None = None) -> bytes:
    """A checkpoint of this payload: ``head`` (magic and version), length, payload, FNV-1a over words."""
    head = _sound()[0][:12] if head is None else head
    mask, prime, value = 2**64 - 1, 0x0100_0000_01B3, 0xCBF2_9CE4_8422_2325
    whole = len(payload) // 8 * 8
    words = struct.unpack(f"<{whole // 8}Q", payload[:whole])
    last = int.from_bytes(payload[whole:].ljust(8, b"\0"), "little")
    for word in (*words, last, len(payload)):
        value = (value ^ word) * prime & mask
    return head + struct.pack("<Q", len(payload)) + payload + struct.pack("<Q", value)


def _texts(payload: bytes) -> tuple[int, bytes]:
    length = struct.unpack_from("<Q", payload)[0]
    return 8 + length, payload[8 : 8 + length]


def _with_scene(content: bytes, todo: list[tuple[Any, ...]], report: bool) -> File:
    """The JSON of the scene, or of the report at the end, damaged as a tree."""
    payload = content[_HEADER:-8]
    if report:
        at = _report_start(payload)
        text = json.dumps(damaged_tree(json.loads(payload[at + 8 :]), todo)).encode()
        return _file(sealed(payload[:at] + struct.pack("<Q", len(text)) + text))
    end, scene = _texts(payload)
    text = json.dumps(damaged_tree(json.loads(scene), todo)).encode()
    return _file(sealed(struct.pack("<Q", len(text)) + text + payload[end:]))


@functools.cache
def _report_start(payload: bytes) -> int:
    """Where the length of the last text stands: the report ends the payload."""
    for at in range(len(payload) - 8, -1, -1):
        if struct.unpack_from("<Q", payload, at)[0] == len(payload) - at - 8 and payload[at + 8 : at + 9] == b"{":
            return at
    raise AssertionError("a checkpoint ends with its report")


_NUMBERS = st.one_of(
    st.sampled_from([0, 1, 2, 3, 2**31, 2**32, 2**53, 2**61, 2**63, 2**64 - 1]).map(lambda n: struct.pack("<Q", n)),
    st.sampled_from([0.0, -1.0, 1e-300, 1e9, 1e300, float("nan"), float("inf"), -float("inf")]).map(
        lambda x: struct.pack("<d", x)
    ),
)


def _with_number(content: bytes, at: int, number: bytes) -> File:
    """One word of the state replaced; words begin after the scene's text."""
    payload = content[_HEADER:-8]
    end, _ = _texts(payload)
    words = (_report_start(payload) - end) // 8
    place = end + 8 * (at % words)
    return _file(sealed(payload[:place] + number + payload[place + 8 :]))


def check(case: File) -> None:
    """Resume; take a step; write a checkpoint and read it."""
    try:
        if case.suffix.startswith(".state"):
            simulation = _continued(case)
        else:
            simulation = cs.Simulation._from_bytes(case.content, 1, "cpu")
    except ClothSimError as error:
        refused(error)
        return
    with contextlib.suppress(ClothSimError):
        simulation.step()
        assert np.isfinite(simulation.positions).all() and np.isfinite(simulation.velocities).all(), "not finite"
    assert isinstance(simulation.energy["total"], float)
    simulation.report, simulation.plan, simulation.bodies  # noqa: B018
    again = cs.Simulation._from_bytes(simulation._core.checkpoint(0), 1, "cpu")
    assert np.array_equal(again.positions, simulation.positions, equal_nan=True), "another state after a round trip"


def _continued(case: File) -> cs.Simulation:
    scene = _scenes()[int(case.suffix.removeprefix(".state")) % len(_scenes())]
    core = _core.Simulation.continue_from(case.content, scene.check(), *scene.assets(), 1, "cpu", False)
    return cs.Simulation._over(core)


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A reader that stops for any checkpoint of another version with an error that nobody expects."""
    honest = _core.Simulation.resume

    class Careless:
        continue_from = _core.Simulation.continue_from

        @staticmethod
        def resume(content: bytes, threads: int | None, device: str) -> _core.Simulation:
            if struct.unpack_from("<I", content.ljust(_HEADER, b"\0"), 8)[0] > 2**16:
                raise MemoryError("capacity overflow")
            return honest(content, threads, device)

    with mock.patch.object(_core, "Simulation", Careless):
        yield
