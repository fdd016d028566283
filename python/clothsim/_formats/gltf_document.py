"""The container of glTF 2.0: JSON, buffers, accessors. Every index, offset and length is checked before it is used."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats, Ints
from clothsim.errors import MeshError

__all__ = ["MOST_POINTS", "Document"]

# Positions, of all frames or of all that is read, which a file may hold at most: 2.4 GB of float64.
MOST_POINTS = 100_000_000

# glTF's names of component types and of element types.
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_KINDS = {dict: "a table", list: "a list", int: "a whole number", str: "a text"}


class Document:
    """A glTF or GLB file.

    Attributes
    ----------
    path : Path
        The file, for messages.
    json : dict
        Its JSON.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            content = path.read_bytes()
        except OSError as error:
            raise MeshError(f"{path}: cannot read the mesh: {error.strerror or error}", kind="file") from error
        self._binary = b""
        text = self._chunks(content) if content[:4] == b"glTF" else content
        try:
            parsed = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise self.error(f"expected JSON ({error})") from error
        if not isinstance(parsed, dict):
            raise self.error("expected a table as JSON")
        self.json: dict[str, Any] = parsed
        if str(self.get(parsed, "asset", dict, {}).get("version", "")).split(".")[0] != "2":
            raise self.error("expected asset.version 2.x")
        if required := self.get(parsed, "extensionsRequired", list, []):
            raise self.error(f"expected no required extensions, got {required}: export without compression")
        self._buffers: dict[int, bytes] = {}
        self._given = 0

    def error(self, reason: str) -> MeshError:
        """Say what is wrong with the file."""
        return MeshError(f"{self.path}: not a mesh file that can be read: {reason}", kind="file")

    def get(self, table: Any, key: str, kind: type, default: Any = None) -> Any:
        """Return the value at ``key``, of that type; ``default`` where there is none."""
        value = table.get(key) if isinstance(table, dict) else None
        if value is None:
            return default
        if not isinstance(value, kind) or isinstance(value, bool):
            raise self.error(f"{key}: expected {_KINDS[kind]}, got {value!r:.60}")
        return value

    def item(self, group: str, index: Any) -> dict[str, Any]:
        """Entry ``index`` of the list ``group`` of the file."""
        items = self.get(self.json, group, list, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise self.error(f"{group}[{index}] does not exist: there are {len(items)}")
        if not isinstance(items[index], dict):
            raise self.error(f"{group}[{index}]: expected a table, got {items[index]!r:.60}")
        entry: dict[str, Any] = items[index]
        return entry

    def numbers(self, index: Any, kind: str, what: str) -> Floats:
        """Accessor ``index`` as float64, shape (count, width); integers that are normalized become fractions."""
        entry, values = self._accessor(index, kind, what)
        numbers = values.astype(np.float64)
        if entry.get("normalized") and values.dtype.kind in "iu":
            numbers = np.maximum(numbers / np.iinfo(values.dtype).max, -1.0)
        if not np.isfinite(numbers).all():
            at = int(np.argmin(np.isfinite(numbers).all(axis=1)))
            raise MeshError(
                f"{self.path}: {what}: expected finite numbers, got {numbers[at].tolist()} at {at}", kind="not-finite"
            )
        return numbers

    def integers(self, index: Any, kind: str, what: str) -> Ints:
        """Accessor ``index`` as int64, shape (count, width)."""
        _, values = self._accessor(index, kind, what)
        if values.dtype.kind not in "iu":
            raise self.error(f"{what}: expected whole numbers, got float32")
        return values.astype(np.int64)

    # Bytes -----------------------------------------------------------------------------------------------------

    def _chunks(self, content: bytes) -> bytes:
        """JSON of a GLB; its binary chunk is kept."""
        if len(content) < 20 or struct.unpack_from("<I", content, 8)[0] > len(content):
            raise self.error("the file is cut off")
        at = 12
        chunks: dict[bytes, bytes] = {}
        while at + 8 <= len(content):
            length, kind = struct.unpack_from("<I4s", content, at)
            if at + 8 + length > len(content):
                raise self.error("the file is cut off within a chunk")
            chunks.setdefault(kind, content[at + 8 : at + 8 + length])
            at += 8 + length
        self._binary = chunks.get(b"BIN\0", b"")
        if b"JSON" not in chunks:
            raise self.error("expected a JSON chunk, got none")
        return chunks[b"JSON"]

    def _buffer(self, index: Any) -> bytes:
        entry = self.item("buffers", index)
        if index not in self._buffers:
            uri = self.get(entry, "uri", str)
            if uri is None:
                content = self._binary
            elif uri.startswith("data:"):
                try:
                    content = base64.b64decode(uri.partition(",")[2], validate=True)
                except ValueError as error:
                    raise self.error(f"buffers[{index}]: expected base64 ({error})") from error
            else:
                try:
                    content = self._beside(unquote(uri))
                except (OSError, ValueError) as error:
                    reason = getattr(error, "strerror", None) or str(error)
                    raise self.error(f"buffers[{index}]: cannot read {uri!r}: {reason}") from error
            length = self.get(entry, "byteLength", int, 0)
            if len(content) < length:
                raise self.error(f"buffers[{index}]: expected {length} bytes, got {len(content)}")
            self._buffers[index] = content
        return self._buffers[index]

    def _beside(self, name: str) -> bytes:
        """The bytes of a file that this one names; devices and pipes, which need not end, are none."""
        path = self.path.parent / name
        if path.exists() and not path.is_file():
            raise ValueError("it is no file")
        return path.read_bytes()

    def _accessor(self, index: Any, kind: str, what: str) -> tuple[dict[str, Any], NDArray[Any]]:
        entry = self.item("accessors", index)
        component = self.get(entry, "componentType", int, 0)
        if entry.get("type") != kind or component not in _COMPONENTS:
            got = f"{entry.get('type')!r:.60} of component type {component}"
            raise self.error(f"{what}: expected {kind}, got {got}")
        count = self.get(entry, "count", int, -1)
        item = np.dtype(_COMPONENTS[component])
        where = f"accessors[{index}]"
        if self.get(entry, "bufferView", int) is None:
            # Zeros; what they belong to has bytes in the file.
            most = sum(len(self._buffer(i)) for i in range(len(self.get(self.json, "buffers", list, []))))
            if not 0 <= count <= most:
                raise self.error(f"{where}: expected a count ≥ 0 of no more rows than the file has bytes, got {count}")
            values = np.broadcast_to(np.zeros(1, item), (count, _WIDTHS[kind]))
        else:
            values = self._rows(entry, entry["bufferView"], count, item, _WIDTHS[kind], where)
        # So far nothing was copied, and many accessors can be over the same bytes.
        self._given += values.size
        if self._given > 3 * MOST_POINTS:
            raise self.error(f"{where}: expected at most {3 * MOST_POINTS} numbers in all accessors that are used")
        sparse = self.get(entry, "sparse", dict)
        return entry, values if sparse is None else self._sparse(sparse, values, kind, where)

    def _rows(
        self, place: dict[str, Any], view_index: Any, count: int, item: np.dtype[Any], width: int, where: str
    ) -> NDArray[Any]:
        """``count`` rows of ``width`` items at a byte offset within a view."""
        view = self.item("bufferViews", view_index)
        content = self._buffer(view.get("buffer"))
        first, size = self.get(view, "byteOffset", int, 0), self.get(view, "byteLength", int, 0)
        offset = self.get(place, "byteOffset", int, 0)
        row = item.itemsize * width
        stride = self.get(view, "byteStride", int, 0) or row
        needed = offset + (count - 1) * stride + row if count > 0 else 0
        if min(count, first, size, offset) < 0 or stride < row or needed > size or first + size > len(content):
            raise self.error(
                f"{where}: expected {count} rows of {row} bytes, {stride} apart from byte {offset} of bufferViews"
                f"[{view_index}], got {max(0, min(size, len(content) - first))} bytes"
            )
        if count == 0:
            return np.zeros((0, width), item)
        return np.ndarray((count, width), item, content, first + offset, (stride, item.itemsize))

    def _sparse(self, sparse: dict[str, Any], values: NDArray[Any], kind: str, where: str) -> NDArray[Any]:
        """Rows of ``values`` replaced by those that a sparse accessor lists."""
        where = f"{where}.sparse"
        count = self.get(sparse, "count", int, -1)
        index_place, value_place = (self.get(sparse, key, dict, {}) for key in ("indices", "values"))
        if index_place.get("componentType") not in (5121, 5123, 5125):
            raise self.error(f"{where}: expected indices of an unsigned type, got {index_place.get('componentType')!r}")
        item = np.dtype(_COMPONENTS[index_place["componentType"]])
        index = self._rows(index_place, index_place.get("bufferView"), count, item, 1, where)[:, 0].astype(np.int64)
        rows = self._rows(value_place, value_place.get("bufferView"), count, values.dtype, _WIDTHS[kind], where)
        if (index >= len(values)).any():
            raise self.error(f"{where}: expected indices in 0..{len(values)}, got {int(index.max())}")
        out = np.array(values)
        out[index] = rows
        return out
