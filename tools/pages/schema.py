"""The page of every key of a scene, made from docs/scene.schema.json: key, type, unit, default, meaning."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "docs" / "scene.schema.json"

Node = dict[str, Any]

HEAD = """# Every key of a scene

Made from [the JSON schema](scene.schema.json) of this version, which `clothsim schema` prints. Editors that know JSON
schemas complete and check scene files with it. How the parts work together: [scene files](scene-files.md).

A unit of – says that the number has none. A key in bold is required. From Python the same keys are the arguments of
`cs.Scene`, `Scene.add_cloth` and `Scene.add_collider`.
"""

# Where each part stands in a file, in reading order; a part that is used in several places stands under the first.
_PARTS = {
    "": ("Scene", "Top level"),
    "Time": ("Time", "`[time]`"),
    "SolverParams": ("SolverParams", "`[solver]`"),
    "Air": ("Air", "`[air]`"),
    "Contact": ("Contact", "`[contact]`"),
    "PairFriction": ("PairFriction", "`[[contact.pairs]]`"),
    "Friction": ("Friction", "A friction"),
    "FrictionTable": ("FrictionTable", "A friction table"),
    "Effects": ("Effects", "`[effects]`"),
    "Sleep": ("Sleep", "`[effects.sleep]`"),
    "Cloth": ("Cloth", "`[[cloth]]`"),
    "MeshSource": ("MeshSource", "`mesh`"),
    "MaterialChoice": ("MaterialChoice", "`material`"),
    "Pin": ("Pin", "`[[cloth.pins]]`"),
    "Region": ("Region", "`[[cloth.regions]]`"),
    "Seam": ("Seam", "`[[cloth.seams]]`"),
    "StrainLimitSource": ("StrainLimitSource", "`strain_limit`"),
    "Collider": ("Collider", "`[[collider]]`"),
    "ShapeSource": ("ShapeSource", "`shape`"),
    "SequenceSource": ("SequenceSource", "`sequence`"),
    "Keyframe": ("Keyframe", "`keyframes`"),
    "Rotation": ("Rotation", "`rotation`"),
    "BoxRegion": ("BoxRegion", "`box`"),
    "Output": ("Output", "`[output]`"),
}


def page() -> str:
    """Return the page as Markdown."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    definitions: dict[str, Node] = schema["$defs"]
    titles = {name: title for name, (_, title) in _PARTS.items() if name}
    later = [name for name in definitions if name not in titles and _has_section(definitions[name])]
    titles |= {name: f"`{name}`" for name in later}
    # What follows from where it is used: a table that only one choice names stands after that choice.
    order = [name for name in _PARTS if name == "" or name in definitions]
    for name in later:
        users = [k for k, user in enumerate(order) if user and f'"#/$defs/{name}"' in json.dumps(definitions[user])]
        order.insert((max(users) + 1) if users else len(order), name)
    writer = _Writer(definitions, titles)
    parts = [HEAD]
    for name in order:
        node = schema if name == "" else definitions[name]
        title = "Top level" if name == "" else titles[name]
        parts.append(writer.section(title, name, node))
    return "\n".join(parts)


def keys_of_the_schema() -> Iterator[tuple[str, str]]:
    """Yield every part and key that the page has to have."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    nodes = {"": schema, **schema["$defs"]}
    for name, node in nodes.items():
        for holder in [node, *node.get("oneOf", []), *node.get("anyOf", [])]:
            for key in holder.get("properties", {}):
                yield name, key


def anchor(name: str) -> str:
    """The anchor of a part: ``""`` is the top level."""
    return f"schema-{name.lower()}" if name else "schema-top"


def _has_section(node: Node) -> bool:
    return "properties" in node or any(
        "properties" in choice or "$ref" in choice for choice in node.get("oneOf", []) + node.get("anyOf", [])
    )


class _Writer:
    def __init__(self, definitions: dict[str, Node], titles: dict[str, str]) -> None:
        self._definitions = definitions
        self._titles = titles

    def section(self, title: str, name: str, node: Node) -> str:
        lines = [f"## {title} {{ #{anchor(name)} }}", "", _text(node.get("description", "")), ""]
        if "properties" in node:
            lines += self._table(node)
        choices = node.get("oneOf", []) + node.get("anyOf", [])
        if choices:
            lines += ["One of:", ""]
            lines += [line for choice in choices for line in self._choice(choice)]
        return "\n".join([*lines, ""])

    def _choice(self, node: Node) -> list[str]:
        meaning = _text(node.get("description", "")).replace("\n", " ")
        if "properties" not in node:
            return [f"- {self._type(node)}: {meaning}"]
        constants = {key: value["const"] for key, value in node["properties"].items() if "const" in value}
        mark = ", ".join(f"{key} = {_toml(value)}" for key, value in constants.items())
        rest = {key: value for key, value in node["properties"].items() if key not in constants}
        head = ["", f"**`{mark}`**: {meaning}", ""]
        return head + (self._table({**node, "properties": rest}) if rest else [])

    def _table(self, node: Node) -> list[str]:
        lines = [
            '<div class="keys" markdown>',
            "",
            "| key | type | unit | default | meaning |",
            "|---|---|---|---|---|",
        ]
        required = node.get("required", [])
        first = [key for key in node["properties"] if key in required]
        for key in first + [key for key in node["properties"] if key not in required]:
            value = node["properties"][key]
            meaning, unit = _unit(_text(value.get("description", "")).replace("\n", " "))
            meaning += self._values(value)
            shown = f"**`{key}`**" if key in required else f"`{key}`"
            cells = [shown, self._type(value), unit, self._default(value), meaning]
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        return [*lines, "", "</div>", ""]

    def _values(self, node: Node) -> str:
        """The meaning of each value, for a key with a few named ones."""
        name = node.get("$ref", "").rsplit("/", 1)[-1]
        choices = self._definitions.get(name, {}).get("oneOf", [])
        if len(choices) < 2 or not all("const" in choice for choice in choices):
            return ""
        return "".join(f"<br>`{_toml(choice['const'])}`: {_text(choice.get('description', ''))}" for choice in choices)

    def _default(self, node: Node) -> str:
        value = node.get("default")
        if value is None or (isinstance(value, dict) and value) or value == []:
            return ""
        return f"`{_toml(value)}`"

    def _type(self, node: Node) -> str:
        if "$ref" in node:
            return self._reference(node["$ref"].rsplit("/", 1)[1])
        if "const" in node:
            return f"`{_toml(node['const'])}`"
        choices = [choice for choice in node.get("anyOf", []) if choice.get("type") != "null"]
        if choices:
            return " or ".join(dict.fromkeys(self._type(choice) for choice in choices))
        kinds = node.get("type", "any")
        kinds = [kind for kind in ([kinds] if isinstance(kinds, str) else kinds) if kind != "null"]
        if kinds == ["array"]:
            return self._array(node)
        words = {"number": "number", "integer": "integer", "boolean": "true or false", "string": "text"}
        text = " or ".join(words.get(kind, kind) for kind in kinds)
        return text + (f" ≥ {node['minimum']}" if "minimum" in node and node["minimum"] != 0 else "")

    def _array(self, node: Node) -> str:
        inner = self._type(node["items"])
        count = node.get("maxItems") if node.get("maxItems") == node.get("minItems") else None
        if inner.startswith("list") or " " in inner:
            inner = f"({inner})" if not inner.startswith("[") else inner
        return f"{count} × {inner}" if count else f"list of {inner}"

    def _reference(self, name: str) -> str:
        node = self._definitions[name]
        choices = node.get("oneOf", []) + node.get("anyOf", [])
        if choices and all("const" in choice for choice in choices):
            return "one of" if len(choices) > 1 else f"`{_toml(choices[0]['const'])}`"
        if name in self._titles:
            return f"[{self._titles[name]}](#{anchor(name)})"
        return " or ".join(dict.fromkeys(self._type(choice) for choice in choices))


def _unit(text: str) -> tuple[str, str]:
    """Take the unit, the first ``[…]`` that is no interval and no link, out of a meaning."""
    found = re.search(r" ?\[((?:-|[A-Za-zµ1°][^\],]*))\](?!\()", text)
    if not found:
        return text, ""
    return (text[: found.start()] + text[found.end() :]).strip(), found[1].replace("-", "–") if found[
        1
    ] == "-" else found[1]


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, float):
        return f"{value:g}" if abs(value) < 1e-3 and value else repr(value)
    return str(value)


def _text(text: str) -> str:
    """A description as Markdown: its paragraphs as they are, comparisons with ``<`` kept from becoming tags."""
    return text.replace("<", "&lt;")
