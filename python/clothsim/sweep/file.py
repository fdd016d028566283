"""SWEEP.toml: what runs, what varies, what is kept."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from clothsim import _core, _toml
from clothsim._files import path_from
from clothsim._nearest import brief, hint
from clothsim.errors import ClothSimError, InvalidInput, InvalidScene
from clothsim.scene import Scene
from clothsim.study.axes import NAMED
from clothsim.sweep.draws import KINDS
from clothsim.sweep.request import Request

__all__ = ["SweepFile", "read"]

_KEYS = (
    "name", "scene", "set", "vary", "combine", "seeds", "metrics", "series", "keep", "timeout", "retries", "threads",
    "device", "checkpoint_interval",
)  # fmt: skip
_MOST_BYTES = 4 * 2**20  # far more than any sweep; what is no sweep is not read whole
_MOST_LEVELS = 60
_SEED_KEYS = ("count", "first", "disturbance", "draw")
# Keys that mean nothing in a scene: in [vary] or [set] they were written below a table that they belong above.
_OWN_KEYS = {"combine", "metrics", "series", "keep", "timeout", "retries", "checkpoint_interval"}
# What Python calls the keys of [seeds].
_RENAMED = {"seeds": "seeds.count", "seed": "seeds.first", "disturbance": "seeds.disturbance"}


@dataclass(frozen=True)
class SweepFile:
    """What a file asks for: the sweep, and how often a run whose worker was lost is started again."""

    request: Request
    retries: int | None


def read(path: str | os.PathLike[str], fixed: Mapping[str, Any] | None = None) -> SweepFile:
    """Read a sweep; ``fixed`` goes before its ``[set]``.

    Raises
    ------
    InvalidInput, InvalidScene
        The file cannot be read, or asks for what there is not; file and key are named.
    """
    where = path_from(path)
    try:
        return _made(_parsed(where), where, dict(fixed or {}))
    except InvalidInput as error:
        known = {key: getattr(error, key) for key in ("name", "expected", "got")}
        text = str(error)
        if (key := _RENAMED.get(known["name"])) and text.startswith(f"{known['name']}: "):
            text, known["name"] = f"{key}{text.removeprefix(known['name'])}", key
        raise InvalidInput(brief(f"{where}: {text}"), **known) from error
    except InvalidScene as error:
        known = {key: getattr(error, key) for key in ("file", "line", "key", "expected", "got", "nearest")}
        raise InvalidScene(brief(f"{where}: {error}"), **known) from error


def _parsed(where: Path) -> dict[str, Any]:
    try:
        with where.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
        if len(content) > _MOST_BYTES:
            raise ValueError(f"more than {_MOST_BYTES // 2**20} MiB")
        tables = _toml.loads(content.decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else getattr(error, "strerror", None) or error
        raise InvalidInput(f"cannot read the sweep: {reason}", name="SWEEP") from error
    _check_depth(tables)
    return tables


def _check_depth(tables: dict[str, Any]) -> None:
    """Refuse what is nested deeper than any scene, and deeper than what follows could follow."""
    level: list[Any] = [tables]
    for _ in range(_MOST_LEVELS):
        level = [
            value
            for node in level
            for value in (node.values() if isinstance(node, dict) else node)
            if isinstance(value, (dict, list))
        ]
        if not level:
            return
    raise InvalidInput(f"cannot read the sweep: nested more than {_MOST_LEVELS} deep", name="SWEEP")


def _made(tables: dict[str, Any], where: Path, fixed: dict[str, Any]) -> SweepFile:
    _known("", tables, _KEYS)
    seeds = _table(tables, "seeds")
    _known("seeds.", seeds, _SEED_KEYS)
    for name in ("vary", "set"):
        for key in filter(_OWN_KEYS.__contains__, _table(tables, name)):
            expected, got = "a key of the scene", f'"{key}", one of the sweep, which comes before its tables'
            raise InvalidInput(
                f"{name}.{key}: expected {expected}, got {got}", name=f"{name}.{key}", expected=expected, got=key
            )
    if "seeds" in tables and "count" not in seeds:
        raise InvalidInput("seeds.count: expected a whole number ≥ 1, got nothing", name="seeds.count")
    same = ("name", "combine", "metrics", "series", "keep", "timeout", "threads", "device", "checkpoint_interval")
    given = {key: tables[key] for key in same if key in tables}
    given |= {name: seeds[key] for name, path in _RENAMED.items() if (key := path.removeprefix("seeds.")) in seeds}
    request = Request(
        _scenes(tables.get("scene"), where),
        _flat(_table(tables, "vary"), _is_row),
        fixed={**_flat(_table(tables, "set"), lambda _: False), **fixed},
        draws=_flat(_table(seeds, "draw", "seeds."), _is_draw),
        **given,
    )
    return SweepFile(request, tables.get("retries"))


def _known(prefix: str, table: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    for key in table:
        if key not in keys:
            expected, got = f"one of the keys {', '.join(keys)}", brief(key, 80)
            raise InvalidInput(
                f'{prefix}{got}: expected {expected}, got the unknown key "{got}"{hint(key, keys)}',
                name=prefix + key,
                got=key,
            )


def _table(tables: Mapping[str, Any], key: str, prefix: str = "") -> dict[str, Any]:
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise InvalidInput(f"{prefix}{key}: expected a table, got {table!r}", name=prefix + key)
    return table


def _is_row(value: Mapping[str, Any]) -> bool:
    return "first" in value and "last" in value


def _is_draw(value: Mapping[str, Any]) -> bool:
    return len(value) == 1 and not isinstance(next(iter(value.values())), Mapping) and bool(
        hint(next(iter(value)), KINDS)
    )  # fmt: skip


def _flat(table: Mapping[str, Any], is_leaf: Any, prefix: str = "") -> dict[str, Any]:
    """Tables of tables as paths: ``contact.friction`` may be written with and without quotes."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        leaf = not isinstance(value, Mapping) or is_leaf(value) or "." in key or (not prefix and key in NAMED)
        if not leaf:
            out |= _flat(value, is_leaf, f"{prefix}{key}.")
        else:
            out[prefix + key] = value
    return out


def _scenes(given: Any, where: Path) -> dict[str, Scene]:
    if isinstance(given, dict):
        return {"": _inline(given, where)}
    paths = [given] if isinstance(given, str) else given
    if not isinstance(paths, list) or not paths or not all(isinstance(p, str) for p in paths):
        expected = "the path of a scene, a list of them, or a table [scene]"
        got = "nothing" if given is None else repr(given)
        raise InvalidInput(f"scene: expected {expected}, got {got}", name="scene", expected=expected, got=got)
    if twice := sorted(path for path, times in Counter(paths).items() if times > 1):
        raise InvalidInput(f"scene: expected each once, got {', '.join(twice)} twice", name="scene")
    return {path if len(paths) > 1 else "": Scene.load(path_from(where.parent / path, "scene")) for path in paths}


def _inline(tables: dict[str, Any], where: Path) -> Scene:
    try:
        scene = Scene()
        scene.folder = where.parent
        scene._core = _core.Scene.from_json(json.dumps(tables))
        scene._data = json.loads(scene._core.to_json())
        scene._load_files()
    except (ClothSimError, TypeError) as error:
        raise InvalidInput(f"scene: {error}", name="scene") from error
    return scene
