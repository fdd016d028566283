"""NumPy arrays out of ``.npy`` and ``.npz`` files that may say anything: no room is made for what is not there.

`numpy.load` makes room for what a header claims, unpacks what a zip holds however large it becomes, and raises whatever
its parts raise. Here every defect is a `ValueError` in words.
"""

from __future__ import annotations

import ast
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Archive", "load"]

# Bytes of an array at most: 10⁸ points, as of an animated mesh.
_MOST_BYTES = 2_400_000_000
# Bytes of a header at most; those that NumPy writes for plain arrays have 128.
_MOST_HEADER = 10_000
_TYPE = re.compile(r"[<>|=]?(?:[fiu][1248]|b1|U\d{1,8})")


def load(path: Path) -> NDArray[Any]:
    """The array of a ``.npy`` file: numbers, truth values or text.

    Raises
    ------
    ValueError
        The file is no such file, is cut off, or claims more than it has.
    OSError
        It cannot be read.
    """
    with path.open("rb") as file, _in_words():
        return _array(file, path.stat().st_size)


class Archive:
    """The arrays of a ``.npz`` file, read one by one; a context.

    Raises
    ------
    ValueError
        The file is no archive, or a member is damaged, packed as NumPy does not pack, or claims more than it has.
    OSError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")
        try:
            with _in_words():
                self._zip = zipfile.ZipFile(self._file)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._zip.close()
        self._file.close()

    @property
    def names(self) -> list[str]:
        """Names of the arrays, sorted."""
        return sorted(name.removesuffix(".npy") for name in self._zip.namelist())

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._zip.NameToInfo

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The array of that name; `ValueError` where there is none."""
        info = self._zip.NameToInfo.get(f"{name}.npy")
        if info is None:
            raise ValueError(f"{name} is missing")
        if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name}: expected a member that is stored or deflated, got another method or a password")
        try:
            with _in_words(), self._zip.open(info) as member:
                found = _array(member, info.file_size)
                # At the end the checksum is compared.
                if member.read(1):
                    raise ValueError("there is more than the array")
                return found
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error


@contextmanager
def _in_words() -> Iterator[None]:
    """Turn what readers of zips and headers stumble over into a `ValueError`."""
    try:
        yield
    except (zipfile.BadZipFile, zlib.error, EOFError, struct.error, NotImplementedError, RuntimeError) as error:
        raise ValueError(str(error) or "the file is cut off") from error
    except (OverflowError, IndexError, KeyError, AttributeError, TypeError) as error:
        raise ValueError(f"damaged ({error})") from error
    except MemoryError as error:
        raise ValueError(f"not enough memory ({error})") from error


def _array(file: IO[bytes], size: int) -> NDArray[Any]:
    """The array of a stream that is to hold ``size`` bytes."""
    kind, in_columns, shape, header = _header(file)
    count = math.prod(shape)
    needed = count * kind.itemsize
    if needed > _MOST_BYTES:
        raise ValueError(f"expected at most {_MOST_BYTES} bytes, got shape {shape}")
    if header + needed != size:
        raise ValueError(f"expected {header + needed} bytes for shape {shape} of {kind}, got {size}")
    flat = np.empty(count, kind)
    if needed and _fill(file, flat.view(np.uint8).data) < needed:
        raise ValueError("the file is cut off")
    return flat.reshape(shape[::-1]).transpose() if in_columns else flat.reshape(shape)


def _fill(file: IO[bytes], room: memoryview) -> int:
    """Read until the room is full or the stream ends; how many bytes came."""
    at = 0
    while at < len(room):
        piece = file.read(min(len(room) - at, 1 << 24))
        if not piece:
            break
        room[at : at + len(piece)] = piece
        at += len(piece)
    return at


def _header(file: IO[bytes]) -> tuple[np.dtype[Any], bool, tuple[int, ...], int]:
    """Type, order, shape, and the bytes that said so."""
    start = file.read(8)
    if len(start) < 8 or start[:6] != b"\x93NUMPY" or start[6] not in (1, 2, 3):
        raise ValueError("expected an array as NumPy writes it (.npy)")
    width = 2 if start[6] == 1 else 4
    length = int.from_bytes(file.read(width), "little")
    if length > _MOST_HEADER:
        raise ValueError(f"expected a header of at most {_MOST_HEADER} bytes, got {length}")
    text = file.read(length)
    try:
        table = ast.literal_eval(text.decode("latin-1").strip())
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError("expected a header with descr, fortran_order and shape, got other text") from error
    match table:
        case {"descr": str(descr), "fortran_order": bool(in_columns), "shape": tuple(shape)} if (
            _TYPE.fullmatch(descr)
            and len(shape) <= 8
            and all(isinstance(n, int) and not isinstance(n, bool) and n >= 0 for n in shape)
        ):
            return np.dtype(descr), in_columns, shape, 8 + width + length
    raise ValueError(f"expected numbers or text of a plain type and shape, got {str(table)[:200]}")
