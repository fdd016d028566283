"""Scene files: damaged examples as TOML and JSON, and tables made from the schema.

A text is either a scene, which written and read again is the same, or is refused by `InvalidScene` that names the file.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from clothsim import _core, _toml
from clothsim.errors import InvalidScene
from fuzz.mutations import JUNK, damaged, damaged_tree, edits, tree_edits
from fuzz.target import File, Target, refused

_ROOT = Path(__file__).resolve().parents[2]
_EXAMPLES = [path.read_bytes() for path in sorted((_ROOT / "examples").glob("*.toml"))]
_TREES = [_toml.loads(content.decode()) for content in _EXAMPLES]


def target() -> Target:
    """Scene files."""
    schema = json.loads(_core.scene_schema())
    texts = st.builds(lambda content, todo: File(".toml", damaged(content, todo)), st.sampled_from(_EXAMPLES), edits())
    trees = st.builds(damaged_tree, st.sampled_from(_TREES), tree_edits())
    made = st.builds(damaged_tree, from_schema(schema, schema, 0), tree_edits(1))
    tables = st.one_of(trees, made).filter(lambda tree: isinstance(tree, dict))
    return Target(
        "scenes", "scene files: TOML and JSON",
        st.one_of(
            texts,
            tables.map(lambda tree: File(".toml", toml(tree).encode("utf-8", "surrogatepass"))),
            tables.map(lambda tree: File(".json", json.dumps(tree).encode("utf-8", "surrogatepass"))),
            DEEP.map(lambda text: File(".toml", text.encode())),
            _DEEP_JSON.map(lambda text: File(".json", text.encode())),
        ),
        check, lambda case: (case.suffix, case.content), File, plant, quick=300, seconds=5.0,
    )  # fmt: skip


def check(case: File) -> None:
    """Read it, and what was read once more."""
    try:
        text = case.content.decode()
    except UnicodeDecodeError:
        return
    try:
        scene = _core.Scene.from_json(text) if case.suffix == ".json" else _core.Scene.from_toml(text, "a.toml")
    except InvalidScene as error:
        refused(error, *(() if case.suffix == ".json" else ("a.toml",)))
        return
    written = json.loads(scene.to_json())
    assert json.loads(_core.Scene.from_json(scene.to_json()).to_json()) == written, "JSON is read as another scene"
    try:
        again = scene.to_toml()
    except InvalidScene as error:
        refused(error)
        return
    assert json.loads(_core.Scene.from_toml(again, "b.toml").to_json()) == written, "TOML is read as another scene"
    for path, _, key, asset in scene.files():
        assert path and key and asset


# Structure that goes on and on.
DEEP = st.builds(
    lambda head, piece, count, tail: head + piece * count + tail,
    st.sampled_from(["", "a = ", "cloth = ", "[", "[[", "gravity = ", "[time]\ndt = "]),
    st.sampled_from(["[", "{a=", "a.", "[[a]]\n", "[a.", "a.b.", '"', "'''", "\\", "-", "1", "_", "[cloth.", "{"]),
    st.sampled_from([1, 10, 79, 130, 1000, 20_000]),
    st.sampled_from(["", "a", "a = 1", "]", "}", "a]", "a]]", "\n[a.b]\n"]),
)
_DEEP_JSON = st.builds(
    lambda piece, count, tail: '{"name": ' + piece * count + tail,
    st.sampled_from(["[", '{"a":', '"', "1", "-", "1e", "\\u"]),
    st.sampled_from([1, 10, 127, 130, 20_000]),
    st.sampled_from(["", "]", "}", "1"]),
)


def from_schema(root: Any, schema: Any, depth: int) -> SearchStrategy[Any]:
    """Values as a JSON schema describes them, with numbers of all sizes; now and then any value."""
    reference = schema.get("$ref") if isinstance(schema, dict) else None
    if reference:
        part = root
        for key in reference.removeprefix("#/").split("/"):
            part = part[key]
        return from_schema(root, part, depth)
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    for many in ("oneOf", "anyOf"):
        if many in schema:
            return st.one_of([from_schema(root, one, depth) for one in schema[many]])
    kind = schema.get("type")
    if isinstance(kind, list):
        return st.one_of([from_schema(root, {**schema, "type": one}, depth) for one in kind])
    match kind:
        case "object":
            return st.deferred(lambda: _table(root, schema, depth + 1))
        case "array":
            least, most = schema.get("minItems", 0), schema.get("maxItems", 3)
            return st.deferred(
                lambda: st.lists(from_schema(root, schema.get("items", {}), depth), min_size=least, max_size=most)
            )
        case "integer":
            return st.one_of(st.integers(0, 8), st.integers(schema.get("minimum", -(2**63)), 2**63 - 1))
        case "number":
            return st.one_of(
                st.sampled_from([0.0, 0.5, 1.0, 1e-3, -1.0]),
                st.floats(allow_nan=False, allow_infinity=False),
                st.floats(-10.0, 10.0),
                st.integers(-3, 3),
            )
        case "string":
            return st.one_of(st.sampled_from(["cotton", "a", "", "ball", "bowline.ply", "x.npy"]), st.text(max_size=5))
        case "boolean":
            return st.booleans()
        case "null":
            return st.none()
    return JUNK


def _table(root: Any, schema: Any, depth: int) -> SearchStrategy[dict[str, Any]]:
    properties = schema.get("properties", {})
    needed = set(schema.get("required", ()))
    if depth == 1:
        needed |= {"cloth"}
    values = {key: from_schema(root, inner, depth) for key, inner in properties.items()}
    return st.fixed_dictionaries(
        {key: value for key, value in values.items() if key in needed},
        optional={key: value for key, value in values.items() if key not in needed},
    ).map(lambda table: {key: value for key, value in table.items() if value is not None})


def toml(value: Any, *, top: bool = True) -> str:
    """A tree as TOML, tables in line."""
    if isinstance(value, dict):
        rows = [f"{_string(str(k))} = {toml(v, top=False)}" for k, v in value.items() if v is not None]
        return "\n".join(rows) if top else "{ " + ", ".join(rows) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml(v, top=False) for v in value if v is not None) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else f"{'-' if value < 0 else ''}inf"
    return repr(value)


def _string(text: str) -> str:
    return '"' + "".join(c if c.isalnum() or c in " ._-/" else f"\\U{ord(c):08x}" for c in text) + '"'


@contextlib.contextmanager
def plant() -> Iterator[None]:
    """A reader that does not expect a negative duration."""
    honest = _core.Scene

    class Careless:
        from_json = staticmethod(honest.from_json)

        @staticmethod
        def from_toml(text: str, file_name: str) -> _core.Scene:
            try:
                return honest.from_toml(text, file_name)
            except InvalidScene as error:
                if error.key == "duration":
                    raise OverflowError("cannot convert a duration to unsigned") from error
                raise

    with mock.patch.object(_core, "Scene", Careless):
        yield
