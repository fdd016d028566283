"""Random damage to bytes and to trees of JSON, as lists of small edits that shrink one by one."""

from __future__ import annotations

import copy
import re
import struct
from collections.abc import Sequence
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

__all__ = ["JUNK", "damaged", "damaged_tree", "edits", "tree_edits"]

# Numbers at which formats and integers end.
_INTEGERS = [0, 1, 2, 3, 7, 127, 128, 255, 256, 32767, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**53,
             2**62, 2**63 - 1, 2**63, 2**64 - 1, -1, -2, -(2**31), -(2**63)]  # fmt: skip
_WORDS = [b"nan", b"inf", b"-inf", b"1e400", b"-1e308", b"1e-320", b"0x10", b"1_000", b"--1", b"\xd9\xa3", b"9" * 400,
          b"99999999999999999999", *(str(i).encode() for i in _INTEGERS)]  # fmt: skip
_PIECES = [b"\0", b"\n", b"\r\n", b" ", b"#", b"/", b"//", b'"', b"'", b"\\\n", b"[", b"]", b"{", b"}", b"=", b".",
           b"\xff\xfe", b"\xef\xbb\xbf", b"[" * 300, b"{" * 300, b"a." * 300, b"\xf0\x9f\x98\x80"]  # fmt: skip
_DOUBLES = [0.0, -0.0, float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 1e-300, 1e18, 1.0]
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

_AT = st.integers(0, 2**20)
_EDIT: SearchStrategy[tuple[Any, ...]] = st.one_of(
    st.tuples(st.just("bit"), _AT, st.integers(0, 7)),
    st.tuples(st.just("byte"), _AT, st.integers(0, 255)),
    st.tuples(st.just("integer"), _AT, st.sampled_from("BHIQ"), st.booleans(), st.sampled_from(_INTEGERS)),
    st.tuples(st.just("double"), _AT, st.sampled_from("fd"), st.sampled_from(_DOUBLES)),
    st.tuples(st.just("cut"), _AT),
    st.tuples(st.just("drop"), _AT, st.integers(1, 64)),
    st.tuples(st.just("repeat"), _AT, st.integers(1, 64), st.sampled_from([1, 2, 50])),
    st.tuples(st.just("insert"), _AT, st.one_of(st.sampled_from(_PIECES + _WORDS), st.binary(max_size=12))),
    st.tuples(st.just("number"), _AT, st.sampled_from(_WORDS)),
    st.tuples(st.just("line"), _AT, _AT),
)


def edits(most: int = 5) -> SearchStrategy[list[tuple[Any, ...]]]:
    """Lists of edits for `damaged`."""
    return st.lists(_EDIT, max_size=most)


def damaged(content: bytes, todo: Sequence[tuple[Any, ...]]) -> bytes:
    """Apply edits in order; places are taken modulo what is there."""
    for kind, place, *rest in todo:
        at = place % (len(content) + 1)
        match kind:
            case "bit" if at < len(content):
                content = content[:at] + bytes([content[at] ^ 1 << rest[0]]) + content[at + 1 :]
            case "byte" if at < len(content):
                content = content[:at] + bytes(rest[:1]) + content[at + 1 :]
            case "integer":
                size = struct.calcsize(rest[0])
                order = "little" if rest[1] else "big"
                number = (rest[2] % 256**size).to_bytes(size, order)
                content = content[:at] + number + content[at + size :]
            case "double":
                with_inf = rest[1] if rest[0] == "d" or abs(rest[1]) < 1e38 else float("inf")
                number = struct.pack("<" + rest[0], with_inf)
                content = content[:at] + number + content[at + len(number) :]
            case "cut":
                content = content[:at]
            case "drop":
                content = content[:at] + content[at + rest[0] :]
            case "repeat":
                content = content[:at] + content[at : at + rest[0]] * rest[1] + content[at:]
            case "insert":
                content = content[:at] + rest[0] + content[at:]
            case "number":
                found = list(_NUMBER.finditer(content, 0, 4000))
                if found:
                    one = found[at % len(found)]
                    content = content[: one.start()] + rest[0] + content[one.end() :]
            case "line":
                lines = content.split(b"\n")
                lines.insert(rest[0] % (len(lines) + 1), lines[at % len(lines)])
                content = b"\n".join(lines)
    return content


# What a value of JSON may become.
JUNK: SearchStrategy[Any] = st.one_of(
    st.sampled_from(_INTEGERS),
    st.sampled_from([0.5, -0.5, 1e-3, 1e-12, 1e9, 1e39, 1e300, -1e300, float("nan"), float("inf"), 5e-324]),
    st.sampled_from([None, True, False, "", "x", "nan", "a" * 3000, "\0", "../x", "\ud83d", "é", [], {}, [[]], [{}]]),
    st.lists(st.integers(-2, 5), max_size=5),
    st.recursive(st.integers(-2, 9), lambda inner: st.lists(inner, max_size=3), max_leaves=6),
)


def tree_edits(most: int = 4) -> SearchStrategy[list[tuple[Any, ...]]]:
    """Lists of edits for `damaged_tree`."""
    kinds = st.sampled_from(["replace", "replace", "replace", "remove", "copy", "rename"])
    return st.lists(st.tuples(kinds, _AT, _AT, JUNK), max_size=most)


def damaged_tree(tree: Any, todo: Sequence[tuple[Any, ...]]) -> Any:
    """Apply edits to a copy of a tree of dicts and lists; places are those of a walk, taken modulo their number."""
    tree = copy.deepcopy(tree)
    for kind, at, other, value in todo:
        places = _places(tree)
        if not places:
            return tree
        parent, key = places[at % len(places)]
        match kind:
            case "replace":
                parent[key] = copy.deepcopy(value)
            case "remove":
                del parent[key]
            case "copy":
                source, source_key = places[other % len(places)]
                parent[key] = copy.deepcopy(source[source_key])
            case "rename" if isinstance(parent, dict):
                parent[f"{key}_"] = parent.pop(key)
    return tree


def _places(tree: Any) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    todo = [tree]
    while todo:
        node = todo.pop()
        keys: list[Any] = list(node) if isinstance(node, dict) else list(range(len(node)))
        for key in keys:
            found.append((node, key))
            if isinstance(node[key], (dict, list)):
                todo.append(node[key])
    return found
