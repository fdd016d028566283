"""One HTML page that shows a run in any browser, without a network."""

from __future__ import annotations

import base64
import html
import json
import math
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats
from clothsim._export.plots import costliest
from clothsim._export.studio import body_colours, is_backdrop, subject
from clothsim._files import write_whole
from clothsim._progress import progress_bar
from clothsim._view.fields import Fields
from clothsim._view.pack import Packed, pack
from clothsim._view.source import Source
from clothsim._view.stage import Camera
from clothsim.errors import InvalidInput
from clothsim.recording import Recording

__all__ = ["Page", "thinned", "write"]

_SCRIPTS = (
    "data.js", "camera.js", "shaders.js", "renderer.js", "plots.js", "dom.js", "themes.js", "playback.js", "panel.js",
    "pointer.js", "controls.js", "interface.js",
)  # fmt: skip

# Bytes of a vertex in a frame before compression: a position, and strain, contact and speed. About a third is left of
# them, and base64 makes four bytes of three.
_RAW, _LEFT = 9, 0.45

_ENERGIES = {
    "total": "ink", "kinetic": "#c0453f", "gravity": "#3f78b5", "stretch": "#c98a22", "shear": "#3f8f62",
    "bending": "#8a5fae",
}  # fmt: skip
_CONTACTS = {"proximities": ("within the thickness", "#3f78b5"), "collisions": ("colliding", "#c0453f")}
_EFFECTS = ("#3f78b5", "#c0453f", "#c98a22", "#3f8f62", "#8a5fae", "#8d8a84", "#4f9aa3", "#b9618c", "#98922f")


@dataclass(frozen=True)
class Page:
    """What was written.

    Attributes
    ----------
    path : Path
        The page.
    bytes : int
        Its size.
    frames : int
        How many frames it has.
    every : int
        One in so many of the run's frames.
    precision : float
        Largest rounding error of a coordinate [m].
    """

    path: Path
    bytes: int
    frames: int
    every: int
    precision: float


def thinned(count: int, every: int) -> list[int]:
    """Each ``every``-th of ``count`` frames, and the last."""
    frames = list(range(0, count, every))
    return frames if not frames or frames[-1] == count - 1 else [*frames, count - 1]


def write(
    source: Source,
    path: Path,
    *,
    every: int | None = None,
    limit: float = 40.0,
    colour: str = "none",
    camera: Camera | None = None,
    frame: int | None = None,
    thickness: float | None = None,
    progress: bool = True,
) -> Page:
    """Write the page, whole or not at all.

    Parameters
    ----------
    source : Source
        The run.
    path : Path
        Where to.
    every : int, optional
        One in so many frames; by default as few are left out as ``limit`` allows.
    limit : float
        Largest size of the page [MB].
    colour : str
        The colour map that it opens with.
    camera : Camera, optional
        Where it looks from at first.
    frame : int, optional
        The frame that it stands on at first; by default it plays.
    thickness : float, optional
        Distance that counts as contact [m].
    progress : bool
        Show a bar.

    Raises
    ------
    InvalidInput
        The page would be larger than ``limit``.
    OutputError
        It cannot be written.
    """
    recording = source.frames()
    fields = Fields(recording, thickness)
    if colour == "contact":
        _ = fields.reach  # says what is missing, before any work
    vertices = sum(body.vertex_count for body in recording.bodies if not body.static)
    step = every or max(1, math.ceil(len(recording) * vertices * _RAW * _LEFT / (limit * 1e6)))
    while True:
        frames = thinned(len(recording), step)
        if every is None and len(frames) < 3 < len(recording):
            raise _too_large(source, limit, "even with two frames", "")
        bar = progress_bar(3 * len(frames), enabled=progress, name="packing")
        with bar:
            packed = pack(recording, frames, fields, bar=bar)
            bar.update(bar.total - bar.n)
        start = {"colour": colour, "frame": frame}
        content = _compose(source, recording, fields, frames, step, packed, start | asdict(camera or Camera()))
        size = len(content) / 1e6
        if size <= limit:
            break
        fit = step * math.ceil(1.05 * size / limit)
        if every is not None:
            raise _too_large(source, limit, f"of {size:.0f} MB", f"--every {fit}, or ")
        step = fit
    write_whole(path, content)
    return Page(path, len(content), len(frames), step, packed.precision)


def _too_large(source: Source, limit: float, got: str, fit: str) -> InvalidInput:
    return InvalidInput(
        f"{source.path}: expected a run that makes a page of at most {limit:g} MB, got one {got}: {fit}--limit MB "
        "allows more (browsers hold some 500 MB)",
        name="--limit",
    )


def _compose(
    source: Source,
    recording: Recording,
    fields: Fields,
    frames: list[int],
    every: int,
    packed: Packed,
    start: dict[str, Any],
) -> bytes:
    header = {**packed.header, **_scene(recording, fields.up), **_words(source, recording, frames, every, packed)}
    for number, (entry, body) in enumerate(zip(header["bodies"], recording.bodies, strict=True)):
        entry["colours"] = body_colours(body, number)
    header["times"] = [round(float(t), 9) for t in recording.times[frames]]
    header["numbers"] = frames
    header["total"] = len(recording)
    header["start"] = start
    header["plots"] = _plots([source.facts[f] for f in frames]) if len(source.facts) >= len(recording) else []
    assets = resources.files("clothsim._view") / "page"
    read = {name: (assets / name).read_text(encoding="utf-8") for name in ("page.html", "page.css", *_SCRIPTS)}
    parts = {
        "title": html.escape(source.title),
        "style": read["page.css"].strip(),
        "script": "\n".join(read[name].strip() for name in _SCRIPTS),
        # In a script element of HTML only "<" could end it.
        "header": json.dumps(header, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "data": base64.b64encode(packed.data).decode(),
    }
    out = []
    for piece in read["page.html"].split("{{"):
        name, closed, rest = piece.partition("}}")
        out.append(parts[name] + rest if closed else piece)
    return "".join(out).encode()


def _scene(recording: Recording, up: int) -> dict[str, Any]:
    """Where things are: what the camera frames, the floor and the lines on it."""
    points = subject(recording)
    low, high = points.min(axis=0), points.max(axis=0)
    reach = max(float(np.linalg.norm(high - low)), 1e-6)
    backdrop = any(is_backdrop(recording, body, reach) for body in recording.bodies)
    return {
        "up": up, "outline": _outermost(points), "middle": (0.5 * (low + high)).tolist(), "reach": reach,
        "floor": float(low[up] - 0.004 * reach), "drawFloor": not backdrop,
        "spacing": 10.0 ** math.floor(math.log10(reach / 2.0)),
    }  # fmt: skip


def _outermost(points: Floats) -> list[list[float]]:
    """Points that lie farthest in evenly spread directions (a Fibonacci lattice): what a camera frames."""
    k = np.arange(64)
    z, turn = 1.0 - (2.0 * k + 1.0) / len(k), k * np.pi * (3.0 - np.sqrt(5.0))
    directions = np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z], axis=1)
    found = np.unique(np.argmax(points @ directions.T, axis=0))
    return [[float(f"{value:.6g}") for value in points[i]] for i in found]


def _words(source: Source, recording: Recording, frames: list[int], every: int, packed: Packed) -> dict[str, Any]:
    cloth = recording.cloth
    triangles = sum(len(body.triangles) for body in cloth)
    start, end = float(recording.times[0]), float(recording.times[-1])
    span = f"{end:.4g} s" if start == 0.0 else f"{start:.4g} to {end:.4g} s"
    facts = [f"{len(recording)} frames, {span}", f"{triangles:,} cloth triangles"]
    facts += [f"every {every}th frame"] if every > 1 else []
    if len(source.facts) and source.effects:
        milliseconds = 1e3 * sum(sum(fact["seconds"].values()) for fact in source.facts)
        facts.append(f"{milliseconds / max(1, len(source.facts) - 1):.0f} ms a frame")
    facts.append(f"drawn to {1e3 * packed.precision:.2g} mm")
    names = ", ".join(body.name for body in recording.bodies)
    return {
        "title": source.title, "facts": " · ".join(facts), "notices": source.notices,
        "description": f"{source.title}: animation of {names}, {len(frames)} frames, {span}",
        "digits": 3 if recording.fps > 99 or end - start < 1.0 else 2,
    }  # fmt: skip


def _plots(facts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    energies = []
    for kind, colour in _ENERGIES.items():
        values = np.array([fact["energy"].get(kind, 0.0) for fact in facts])
        if kind in ("gravity", "total"):  # their zero is arbitrary: shown from the start
            values = values - values[0]
        if np.any(values):
            energies.append(_series(f"Δ {kind}" if kind in ("gravity", "total") else kind, colour, values))
    plots = [{"title": "Energy", "unit": "J", "series": energies}]
    contacts = []
    for key, (label, colour) in _CONTACTS.items():
        values = np.array([(fact["contact"] or {}).get(key, 0) / max(1, fact["steps"]) for fact in facts])
        if np.any(values):
            contacts.append(_series(label, colour, values))
    plots.append({"title": "Contacts", "unit": "pairs per step", "series": contacts})
    seconds = np.array([sum(fact["seconds"].values()) for fact in facts])
    costs = [_series("wall clock", "#8a5fae", 1e3 * seconds)] if np.any(seconds) else []
    plots.append({"title": "Time per frame", "unit": "ms", "series": costs})
    priced = zip(costliest(facts).items(), _EFFECTS, strict=False)
    effects = [_series(name, colour, np.array(values)) for (name, values), colour in priced]
    plots.append({"title": "Cost of each effect", "unit": "ms per frame", "series": effects})
    return [plot for plot in plots if plot["series"]]


def _series(label: str, colour: str, values: Floats) -> dict[str, Any]:
    return {"label": label, "colour": colour, "values": [float(f"{v:.5g}") for v in values]}
