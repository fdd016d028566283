"""Animated characters: glTF skins and morphs, USD, archives of arrays, folders of frames."""

from __future__ import annotations

import contextlib
import zipfile
from collections.abc import Iterator
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import clothsim as cs
from clothsim._formats import gltf_document
from clothsim.errors import InvalidInput, MeshError
from fuzz import seeds
from fuzz.mutations import damaged, edits
from fuzz.target import File, Target
from fuzz.targets.files import read
from fuzz.targets.meshes import gltf_files, usd_files

__all__ = ["npy_files", "target"]


def target() -> Target:
    """Animated meshes."""
    archives = st.builds(
        lambda positions, triangles, method, todo: File(
            ".npz", damaged(seeds.archive({"positions.npy": positions, "triangles.npy": triangles}, method), todo)
        ),
        npy_files(np.zeros((2, 4, 3))), npy_files(np.array([[0, 1, 2], [0, 2, 3]])),
        st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]), edits(2),
    )  # fmt: skip
    return Target(
        "animations", "animated meshes: glTF, USD, NPZ", st.one_of(gltf_files(), gltf_files(), archives, usd_files()),
        check, lambda case: (case.suffix, case.content), File, plant, quick=200,
    )  # fmt: skip


def npy_files(array: np.ndarray) -> st.SearchStrategy[bytes]:
    """NumPy files: damaged, with headers that lie about shape and type, and of zeros that compress well."""
    sound = seeds.npy(array)
    header = st.builds(
        _with_header,
        st.sampled_from(["<f8", ">f8", "<f4", "<i8", "<i4", "<U8", "|O", "|V8", "<c16", "|b1", "<f2", "M8[s]", "S0"]),
        st.booleans(),
        st.sampled_from(["(2, 4, 3)", "(2, 3)", "()", "(0, 4, 3)", "(-1, 4, 3)", "(1000000000000, 4, 3)", "(2.0, 3)",
                         "(9223372036854775807, 3)", "(4294967296, 4294967296, 3)", "(100000, 3000, 3)", "((2,),)",
                         "(True, 3)", "5", "'x'", "(" + "1, " * 70 + ")"]),
        st.just(sound[-array.nbytes :]),
        st.sampled_from([0, 0, 0, 10**6, 3 * 10**7]),
    )  # fmt: skip
    return st.one_of(st.just(sound), st.builds(damaged, st.just(sound), edits(2)), header)


def _with_header(descr: str, fortran: bool, shape: str, body: bytes, zeros: int) -> bytes:
    text = f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body + bytes(zeros)


def check(case: File) -> None:
    """Read it as a character at 24 frames per second."""
    found = read(case, lambda path: cs.Animation.load(path, fps=24.0), MeshError, InvalidInput)
    if found is None:
        return
    assert found.positions.ndim == 3 and found.positions.shape[2] == 3 and len(found.positions)
    assert np.isfinite(found.positions).all()
    assert found.triangles.ndim == 2 and found.triangles.shape[1] == 3


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A reader of glTF that trusts the offsets of a view."""

    def careless(self, place, view_index, count, item, width, where):  # type: ignore[no-untyped-def]
        view = self.item("bufferViews", view_index)
        content = self._buffer(view.get("buffer"))
        first = self.get(view, "byteOffset", int, 0) + self.get(place, "byteOffset", int, 0)
        return np.frombuffer(content, item, count * width, first).reshape(count, width)

    with mock.patch.object(gltf_document.Document, "_rows", careless):
        yield
