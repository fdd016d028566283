"""Scenes: what there is, how it moves, how it is stepped and what is written."""

from __future__ import annotations

import copy
import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim import _core, _formats
from clothsim._arrays import Floats, Ints, floats
from clothsim._export.names import file_stem
from clothsim._files import path_from, write_whole
from clothsim._formats import RawMesh, numpy_files
from clothsim._plain import plain
from clothsim.animation import Animation
from clothsim.errors import InvalidScene
from clothsim.friction import Pair
from clothsim.material import Material
from clothsim.mesh import Mesh

__all__ = ["Animation", "Scene"]


class Scene:
    """A scene. Keys and units are those of scene files: ``clothsim schema`` prints them all.

    Bodies may be given here as tables, or added with `add_cloth` and `add_collider`. In a table ``mesh`` may be a
    `Mesh`, ``material`` a `Material`, ``velocities`` an array (n, 3) [m/s] and ``sequence`` an `Animation`.

    Parameters
    ----------
    name : str
        Name for reports.
    duration : float
        Time to simulate [s].
    up : {"y", "z"}
        The axis that points up; the default gravity follows it.
    gravity : (3,) array, optional
        Acceleration [m/s²]; 9.81 m/s² against ``up`` by default.
    start : {"as-given", "untangle"}
        What is done about a start state whose surfaces pass through each other: it is refused, or small penetrations
        are repaired and listed in the report.
    time, solver, air, contact, effects, output : mapping, optional
        Tables of a scene file. Without ``contact`` nothing touches anything. `set_friction` adds friction of two
        bodies, once they are there.
    cloth, collider : sequence of mappings
        Bodies.

    Raises
    ------
    InvalidScene
        A key is not known (the nearest known one is named), a value is missing or out of range.

    Examples
    --------
    >>> import clothsim as cs
    >>> scene = cs.Scene(duration=0.1, contact={"thickness": 0.004})
    >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 11, 11), "cotton", position=(0.0, 0.6, 0.0))
    >>> scene.add_collider("ball", shape={"type": "sphere", "radius": 0.5, "tolerance": 0.01})
    >>> scene
    Scene('scene', cloth: cloth, colliders: ball)
    """

    def __init__(
        self,
        *,
        name: str = "scene",
        duration: float = 1.0,
        up: str = "y",
        gravity: ArrayLike | None = None,
        time: Mapping[str, Any] | None = None,
        solver: Mapping[str, Any] | None = None,
        air: Mapping[str, Any] | None = None,
        contact: Mapping[str, Any] | None = None,
        effects: Mapping[str, Any] | None = None,
        cloth: Sequence[Mapping[str, Any]] = (),
        collider: Sequence[Mapping[str, Any]] = (),
        output: Mapping[str, Any] | None = None,
        start: str = "as-given",
    ) -> None:
        self._meshes: dict[str, Mesh] = {}
        self._sequences: dict[str, tuple[Floats, Ints, float | None]] = {}
        self._velocities: dict[str, Floats] = {}
        self._core: _core.Scene | None = None
        self.folder: Path | None = None
        tables = {
            "name": name, "up": up, "gravity": gravity if gravity is None or isinstance(gravity, (list,
            tuple)) else np.asarray(gravity),
            "duration": duration,
            "start": start, "time": time, "solver": solver, "air": air, "contact": contact, "effects": effects,
            "output": output,
        }  # fmt: skip
        self._data: dict[str, Any] = plain(tables, "")
        for key, tables_of in (("cloth", cloth), ("collider", collider)):
            if isinstance(tables_of, (str, Mapping)) or not all(isinstance(table, Mapping) for table in tables_of):
                expected = "a list of tables"
                raise InvalidScene(f"{key}: expected {expected}, got {tables_of!r}", key=key, expected=expected)
        self._data["cloth"] = [self._cloth_table(table, f"cloth[{i}]") for i, table in enumerate(cloth)]
        self._data["collider"] = [self._collider_table(table, f"collider[{i}]") for i, table in enumerate(collider)]
        if cloth:
            self.check()

    # Bodies ----------------------------------------------------------------------------------------------------

    def add_cloth(
        self,
        mesh: Mesh | Mapping[str, Any],
        material: str | Material | Mapping[str, Any] = "cotton",
        *,
        name: str = "cloth",
        **keys: Any,
    ) -> None:
        """Add a piece of cloth.

        Parameters
        ----------
        mesh : Mesh or mapping
            The mesh, or a table such as ``{"generator": "grid", …}`` or ``{"file": "skirt.obj"}``.
        material : str, Material or mapping
            A name in the library, or parameters.
        name : str
            Unique among all bodies.
        **keys
            Further keys of a ``[[cloth]]`` table: ``position`` [m], ``rotation``, ``velocity`` [m/s],
            ``velocities`` (n, 3) [m/s], ``rest``, ``warp``, ``self_collision``, ``pins``, ``regions``, ``seams``,
            ``friction``, ``self_friction``, ``strain_limit``.
        """
        table = {"name": name, "mesh": mesh, "material": material, **keys}
        self._append("cloth", self._cloth_table(table, f"cloth[{len(self._data['cloth'])}]"))

    def add_collider(self, name: str, **keys: Any) -> None:
        """Add a body that moves as prescribed and that cloth meets.

        Parameters
        ----------
        name : str
            Unique among all bodies.
        **keys
            Exactly one of ``shape`` (``{"type": "sphere", "radius": m, "tolerance": m}``, capsule, box, plane, cone),
            ``mesh`` (a `Mesh` or a table) and ``sequence`` (an `Animation` or a table); and ``position`` [m],
            ``rotation``, ``keyframes``, ``friction``.
        """
        self._append(
            "collider", self._collider_table({"name": name, **keys}, f"collider[{len(self._data['collider'])}]")
        )

    def set_friction(self, first: str, second: str, friction: float | Pair | Mapping[str, Any]) -> None:
        """Set the friction of two bodies, before all other entries.

        Parameters
        ----------
        first, second : str
            Names of two bodies of the scene, at least one of them cloth; one name twice is that cloth against itself.
        friction : float, Pair or mapping
            Coulomb's coefficient; a pair of `clothsim.friction.pairs`; a table with ``law`` and its parameters.

        Raises
        ------
        InvalidScene
            The scene has no ``contact`` or no such bodies, or the friction is no law.

        Examples
        --------
        >>> import clothsim as cs
        >>> scene = cs.Scene(contact={"friction": 0.3})
        >>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 5, 5), "silk", name="scarf", position=(0.0, 0.6, 0.0))
        >>> scene.add_collider("arm", shape={"type": "capsule", "radius": 0.05, "half_height": 0.2, "tolerance": 0.01})
        >>> scene.set_friction("scarf", "arm", cs.friction.pairs["cotton-skin-forearm"])
        >>> scene.to_dict()["contact"]["pairs"]
        [{'between': ['scarf', 'arm'], 'friction': {'pair': 'cotton-skin-forearm'}}]
        """
        contact = self._data.get("contact")
        if contact is None:
            expected = "a table (friction is part of contact)"
            raise InvalidScene(f"contact: expected {expected}, got nothing", key="contact", expected=expected)
        before = contact.get("pairs", [])
        kept = [pair for pair in before if sorted(pair["between"]) != sorted((first, second))]
        pair = _table({"between": [first, second], "friction": friction}, f"contact.pairs[{len(kept)}]")
        contact["pairs"] = [*kept, pair]
        self._core = None
        try:
            self.check()
        except InvalidScene:
            contact["pairs"] = before
            raise

    def _append(self, kind: str, table: dict[str, Any]) -> None:
        bodies = self._data[kind]
        before, bodies[:] = list(bodies), [*bodies, table]
        self._core = None
        if self._data["cloth"]:
            try:
                self.check()
            except InvalidScene:
                bodies[:] = before
                raise

    def _cloth_table(self, table: Mapping[str, Any], key: str) -> dict[str, Any]:
        out = dict(table)
        if isinstance(out.get("mesh"), Mesh):
            out["mesh"] = {"asset": self._keep(self._meshes, out["mesh"], str(out.get("name", "cloth")))}
        if isinstance(out.get("material"), Material):
            out["material"] = out["material"].to_dict()
        velocities = out.get("velocities")
        if velocities is not None and not isinstance(velocities, str):
            array = floats(velocities, "velocities", "shape (n, 3)")
            out["velocities"] = self._keep(self._velocities, array, f"{out.get('name', 'cloth')}-velocities")
        return _table(out, key)

    def _collider_table(self, table: Mapping[str, Any], key: str) -> dict[str, Any]:
        out = dict(table)
        if isinstance(out.get("mesh"), Mesh):
            out["mesh"] = {"asset": self._keep(self._meshes, out["mesh"], str(out.get("name", "collider")))}
        sequence = out.get("sequence")
        if isinstance(sequence, Animation):
            frames = (sequence.positions, sequence.triangles, sequence.fps)
            asset = self._keep(self._sequences, frames, str(out.get("name", "collider")))
            out["sequence"] = {"asset": asset, "fps": sequence.fps}
        return _table(out, key)

    def _keep(self, where: dict[str, Any], asset: Any, name: str) -> str:
        """Hold an array under a name that is free."""
        candidate, number = name, 1
        while candidate in where:
            number += 1
            candidate = f"{name}-{number}"
        where[candidate] = asset
        return candidate

    # What it says ----------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name for reports."""
        return str(self.to_dict()["name"])

    @property
    def duration(self) -> float:
        """Time to simulate [s]."""
        return float(self._data["duration"])

    @property
    def output(self) -> dict[str, Any]:
        """What a run writes, defaults written out; a copy."""
        return dict(self.to_dict()["output"])

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the scene's file, defaults written out; a copy."""
        if not self._data["cloth"]:
            return copy.deepcopy(self._data)
        result: dict[str, Any] = json.loads(self.check().to_json())
        return result

    def check(self) -> _core.Scene:
        """Refuse what cannot be simulated, as far as the scene alone tells; meshes are checked by `Simulation`.

        Raises
        ------
        InvalidScene
            Names file and line (of a loaded scene), key, what was expected and what came.
        """
        if self._core is None:
            self._core = _core.Scene.from_json(json.dumps(self._data))
        return self._core

    # Files -----------------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file (TOML) and the mesh files that it names, relative to it.

        Animated meshes are read as by `Animation.load`; start velocities are ``.npy`` files (n, 3).

        Parameters
        ----------
        path : str or path
            The scene file.

        Raises
        ------
        InvalidScene
            The file cannot be read, or says something that cannot be simulated; file, line and key are named.
        """
        where = path_from(path)
        try:
            text = where.read_bytes().decode("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InvalidScene(f"{where}: cannot read the scene: {reason}", file=str(where)) from error
        scene = cls()
        scene.folder = where.parent
        scene._core = _core.Scene.from_toml(text, str(where))
        scene._data = json.loads(scene._core.to_json())
        scene._load_files()
        return scene

    def _load_files(self) -> None:
        core = self.check()
        folder = self.folder or Path()
        for path, is_sequence, key, asset in core.files():
            try:
                if is_sequence:
                    self._sequences[asset] = self._read_sequence(folder / path, key)
                else:
                    self._meshes[path] = Mesh.load(folder / path)
            except (ValueError, OSError) as error:
                core.fail(key, "a file that can be used", str(error))
        for i, cloth in enumerate(self._data["cloth"]):
            velocities = cloth.get("velocities")
            if velocities is not None and velocities.endswith(".npy"):
                try:
                    self._velocities[velocities] = floats(
                        numpy_files.load(folder / velocities), "velocities", "shape (n, 3)"
                    )
                except (ValueError, OSError) as error:
                    core.fail(f"cloth[{i}].velocities", "a file that can be used", str(error))

    def _read_sequence(self, path: Path, key: str) -> tuple[Floats, Ints, float | None]:
        """Frames of the collider whose ``sequence.file`` is at ``key``, and their rate if the file says one."""
        from clothsim._formats import animation as formats

        source = self._data["collider"][int(key[len("collider[") : key.index("]")])]["sequence"]
        request = formats.Request(
            source.get("fps"), source.get("scale") or 1.0, source.get("up"), self._data["up"], source.get("animation"),
            source.get("part"),
        )  # fmt: skip
        raw = formats.read(path, request)
        return raw.positions, raw.triangles, raw.fps

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a scene file (TOML, defaults written out), and beside it the meshes that the scene holds as arrays.

        Meshes go to ``<scene>_<name>.ply`` (``.obj`` if a UV seam needs it), animations to ``.npz``, start velocities
        to ``.npy``. Names of files that the scene was loaded with are kept if it is saved into the same folder, else
        those files are written too. Each file is written whole or not at all, the scene last.

        Parameters
        ----------
        path : str or path
            The scene file.
        """
        where = path_from(path)
        data = self.to_dict()
        stems = iter(_file_stems(where.stem, [body["name"] for body in (*data["cloth"], *data["collider"])]))
        names = (asset for _, is_sequence, _, asset in self.check().files() if is_sequence)
        here = self.folder is not None and self.folder.resolve() == where.parent.resolve()
        for body in (*data["cloth"], *data["collider"]):
            mesh = body.get("mesh") or {}
            stem = next(stems)
            name = mesh.get("asset", mesh.get("file"))
            if name is not None and not (here and "file" in mesh):
                body["mesh"] = {"file": _save_mesh(self._meshes[name], where, stem)}
            sequence = body.get("sequence") or {}
            name = next(names) if sequence.get("file") else sequence.get("asset")
            if name is not None and not (here and sequence.get("file")):
                file = f"{stem}.npz"
                positions, triangles, fps = self._sequences[name]
                write_whole(where.with_name(file), _npz(positions=positions, triangles=triangles))
                body["sequence"] = {"file": file, "fps": sequence.get("fps") or fps, "start": sequence["start"]}
            name = body.get("velocities")
            if name is not None and not (here and name.endswith(".npy")):
                file = f"{stem}_velocities.npy"
                write_whole(where.with_name(file), _npy(self._velocities[name]))
                body["velocities"] = file
        write_whole(where, _core.Scene.from_json(json.dumps(data)).to_toml().encode())

    def assets(
        self,
    ) -> tuple[
        dict[str, tuple[Floats, Ints, Floats | None, dict[str, list[int]]]],
        dict[str, tuple[Floats, Ints, float | None]],
        dict[str, Floats],
    ]:
        """Return what the scene holds by name: meshes with groups, animated meshes with rates, start velocities."""
        meshes = {
            name: (mesh.vertices, mesh.triangles, mesh.uv, {g: t.tolist() for g, t in mesh.groups.items()})
            for name, mesh in self._meshes.items()
        }
        return meshes, dict(self._sequences), dict(self._velocities)

    def __repr__(self) -> str:
        cloth = ", ".join(str(c["name"]) for c in self._data["cloth"]) or "none"
        colliders = ", ".join(str(c["name"]) for c in self._data["collider"]) or "none"
        return f"Scene({self._data['name']!r}, cloth: {cloth}, colliders: {colliders})"


def _table(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    out: dict[str, Any] = plain(table, key)
    return out


def _file_stems(scene: str, names: list[str]) -> list[str]:
    """Stem of each body's files; bodies whose names differ only in what file names cannot hold get numbers."""
    stems: list[str] = []
    for name in names:
        stem, number = f"{scene}_{file_stem(name)}", 1
        while stem.casefold() in (s.casefold() for s in stems):
            number += 1
            stem = f"{scene}_{file_stem(name)}-{number}"
        stems.append(stem)
    return stems


def _save_mesh(mesh: Mesh, scene: Path, stem: str) -> str:
    raw = RawMesh(mesh.vertices, mesh.triangles, mesh.uv, mesh.groups)
    for suffix in (".obj",) if mesh.groups else (".ply", ".obj"):
        path = scene.with_name(stem + suffix)
        content = _formats.write(path, raw)
        if suffix == ".obj" or mesh.uv is None or _formats.parse(content, path).uv is not None:
            write_whole(path, content)
            return path.name
    raise AssertionError("an OBJ file holds every mesh")


def _npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _npy(array: Floats) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()
