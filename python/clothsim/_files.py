"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from clothsim.errors import InvalidInput, OutputError, OutputExists

__all__ = ["output_error", "path_from", "remove_parts", "replacing", "whole", "whole_folder", "write_whole"]


def path_from(path: str | os.PathLike[str], parameter: str = "path") -> Path:
    """Give the path that the argument ``parameter`` names.

    Raises
    ------
    InvalidInput
        No file can have that name: it has a NUL character, or one that is none by itself (half of a surrogate pair).
    TypeError
        It is no path.
    """
    try:
        given = Path(path)
        possible = b"\0" not in os.fsencode(given)
    except UnicodeEncodeError:
        possible = False
    except TypeError as error:
        raise TypeError(f"{parameter}: expected a path, got {type(path).__name__}") from error
    if not possible:
        expected = "a path that the file system can have"
        raise InvalidInput(
            f"{parameter}: expected {expected}, got {str(given)!a}",
            name=parameter, expected=expected, got=ascii(str(given)),
        )  # fmt: skip
    return given


@contextlib.contextmanager
def whole(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary neighbour of ``path`` for writing; on success it becomes ``path``, else it is removed.

    Raises
    ------
    OutputError
        The folder cannot be written, or the disk is full.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the name of a temporary neighbour of ``path``, with its suffix, for a library that writes by name.

    On success the file, safe on the disk, becomes ``path``, else it is removed.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield temporary
        _settle(temporary)
        os.replace(temporary, path)
        _settle(path.parent)
    except OSError as error:
        raise output_error(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def whole_folder(folder: Path, *, overwrite: bool) -> Iterator[Path]:
    """Give a temporary neighbour of ``folder``; on success it becomes ``folder``, else it is removed.

    Raises
    ------
    OutputExists
        There is something of that name, and ``overwrite`` is not set.
    OutputError
        The folder cannot be written, or the disk is full.
    """
    if folder.exists() and not overwrite:
        raise OutputExists(f"{folder}: there is something of that name already")
    part = folder.with_name(f".{folder.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        yield part
        for path in part.rglob("*"):
            _settle(path)
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)
        _settle(folder.parent)
    except OSError as error:
        raise output_error(folder, error) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _settle(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk and not only on their way."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:  # a folder on a system that opens none: its names come to the disk by and by
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF):  # some file systems sync no folders
            raise
    finally:
        os.close(handle)


def remove_parts(folder: Path) -> None:
    """Remove what a killed process has left of files and folders that it was writing here."""
    for path in folder.glob(".*.part*"):
        if re.fullmatch(r"\..+\.part(\.[^.]+)?", path.name):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):
                    path.unlink()


def write_whole(path: Path, content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with whole(path) as file:
        file.write(content)


def output_error(path: Path, error: OSError) -> OutputError:
    """Say what could not be written and why, in words for the two usual reasons."""
    if isinstance(error, OutputError):
        return error
    reason = error.strerror or str(error)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        reason = f"no space left ({reason.lower()}); what was written before is intact"
    return OutputError(error.errno or errno.EIO, f"cannot write {path}: {reason}")
