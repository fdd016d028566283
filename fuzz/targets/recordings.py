"""Recordings (``frames.npz``) and start velocities (``.npy``)."""

from __future__ import annotations

import contextlib
import json
import zipfile
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim import recording
from clothsim.errors import InvalidInput
from fuzz import seeds
from fuzz.mutations import damaged, damaged_tree, edits, tree_edits
from fuzz.target import File, Target
from fuzz.targets.animations import npy_files
from fuzz.targets.files import read

__all__ = ["target"]


def target() -> Target:
    """Recordings."""
    members = seeds.recording()
    meta = json.loads(str(np.load(_buffer(members["meta.npy"]))))
    arrays = st.sampled_from(sorted(set(members) - {"meta.npy"})).flatmap(
        lambda name: st.tuples(st.just(name), npy_files(np.load(_buffer(members[name]))))
    )
    return Target(
        "recordings", "recordings: frames.npz",
        st.builds(
            _file, st.just(members), st.just(meta), tree_edits(3), st.lists(arrays, max_size=2),
            st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]), edits(2),
            st.sampled_from([None, None, None, *members]),
        ),
        check, lambda case: (case.suffix, case.content), File, plant, quick=150,
    )  # fmt: skip


def _buffer(content: bytes) -> Any:
    import io

    return io.BytesIO(content)


def _file(
    members: dict[str, bytes], meta: Any, todo_meta: Any, arrays: Any, method: int, todo: Any, without: str | None
) -> File:
    text = json.dumps(damaged_tree(meta, todo_meta), ensure_ascii=True)
    out = {**members, "meta.npy": seeds.npy(text), **dict(arrays)}
    if without:
        del out[without]
    return File(".npz", damaged(seeds.archive(out, method), todo))


def check(case: File) -> None:
    """Read it and look at every frame of every body."""
    found = read(case, cs.Recording.load, InvalidInput)
    if found is None:
        return
    assert len(found.times) == len(found)
    for body in found.bodies:
        for frame in range(min(len(found), 3)):
            assert found.positions(body, frame).shape == (body.vertex_count, 3)
            velocities = found.velocities(body, frame)
            assert velocities is None or velocities.shape == (body.vertex_count, 3)


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A recording whose slices do not follow its bodies."""
    honest = recording._slices

    def careless(bodies: Any) -> Any:
        found = honest(bodies)
        return {name: slice(where.start, where.stop + 1) for name, where in found.items()}

    with mock.patch.object(recording, "_slices", careless):
        yield
