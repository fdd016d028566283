"""A film strip: several moments of a run side by side, rendered off screen."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints, optional
from clothsim._export.usd import vertex_normals
from clothsim._files import write_whole
from clothsim.recording import Body, Recording

__all__ = ["moments_of", "render", "write"]

_TILE = (600, 600)  # px
_SUPERSAMPLING = 2
_SHADOW_MAP = 4096  # texels along a side
_GAP = 10  # px between tiles
_BAND = 64  # px below the tiles for the times
_PAPER = (250, 249, 246)
_INK = (52, 50, 48)
_FAINT = (140, 136, 130)

# Front and back of each cloth, and colliders.
_CLOTHS = (("#9c2f35", "#c98f6a"), ("#2f5d8c", "#9fb8cf"), ("#c08a2e", "#e3cf9f"), ("#3f7a57", "#a9c9b3"))
_COLLIDER = "#d3d6da"
_FLOOR = "#f6f3ec"


def write(recording: Recording, path: Path, *, moments: int = 8) -> None:
    """Render ``moments`` frames, spread over the run with more of them where the cloth moves most, into a PNG."""
    frames = moments_of(recording, moments)
    tiles = [render(recording, frame) for frame in frames]
    write_whole(path, _compose(tiles, [float(recording.times[f]) for f in frames], recording.name))


def moments_of(recording: Recording, count: int) -> list[int]:
    """Frames that show the run: the first, the last, and between them equal shares of time and motion.

    The share of a frame is half its time and half the cloth's mean displacement since the frame before, so that fast
    phases get more pictures without losing the slow ones.
    """
    total = len(recording)
    if total <= count:
        return list(range(total))
    motion = np.zeros(total)
    before = [recording.positions(body, 0) for body in recording.cloth]
    for frame in range(1, total):
        now = [recording.positions(body, frame) for body in recording.cloth]
        steps = [np.linalg.norm(a - b, axis=1).mean() for a, b in zip(now, before, strict=True)]
        motion[frame] = np.mean(steps)
        before = now
    time = np.arange(total) / (total - 1)
    moved = np.cumsum(motion) / motion.sum() if motion.sum() > 0.0 else time
    share = 0.5 * (time + moved)
    picked = np.searchsorted(share, np.linspace(0.0, 1.0, count) - 1e-12).clip(0, total - 1)
    picked[-1] = total - 1
    for k in range(1, count):  # no frame twice
        picked[k] = max(picked[k], picked[k - 1] + 1)
    for k in range(count - 2, -1, -1):
        picked[k] = min(picked[k], picked[k + 1] - 1)
    return [int(frame) for frame in picked]


def render(recording: Recording, frame: int, size: tuple[int, int] = _TILE) -> Any:
    """One frame as an RGB image (height, width, 3) uint8."""
    pv = optional("pyvista", extra="view", purpose="rendering pictures")
    # Without a display VTK falls back to EGL, and says so on stderr.
    logger = optional("vtkmodules.vtkCommonCore", extra="view", purpose="rendering pictures").vtkLogger
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    plotter = pv.Plotter(off_screen=True, window_size=[side * _SUPERSAMPLING for side in size], lighting="none")
    try:
        plotter.set_background("#f4f2ee")
        subject = _subject(recording)
        low, high = subject.min(axis=0), subject.max(axis=0)
        up = 2 if recording.up == "z" else 1
        centre, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
        floor = low[up] - 0.004 * reach
        _add_floor(pv, plotter, centre, reach, floor, up)
        for number, body in enumerate(recording.bodies):
            if not _is_backdrop(recording, body, reach):
                _add_body(pv, plotter, recording, body, frame, number)
        _add_lights(pv, plotter, centre, reach, up)
        _place_camera(plotter, subject, up)
        plotter.enable_shadows()
        _refine_shadows(plotter)
        image = plotter.screenshot(None, return_img=True)
    finally:
        plotter.close()
    k = _SUPERSAMPLING
    height, width = image.shape[0] // k, image.shape[1] // k
    tiles = image[: height * k, : width * k, :3].reshape(height, k, width, k, 3).astype(np.float64)
    return np.rint(tiles.mean(axis=(1, 3))).astype(np.uint8)


def _subject(recording: Recording) -> Floats:
    """Points that are to be seen: the cloth over the whole run (a sample of it), and colliders of about its size."""
    frames = np.unique(np.linspace(0, len(recording) - 1, 25).astype(int))
    points = [recording.positions(body, int(f))[::7] for body in recording.cloth for f in frames]
    span = float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
    for body in recording.bodies:
        x = recording.positions(body, 0)
        if body.kind == "collider" and np.linalg.norm(np.ptp(x, axis=0)) < 1.5 * span:
            points.append(x)
    return np.concatenate(points)


def _is_backdrop(recording: Recording, body: Body, reach: float) -> bool:
    """A collider so large that it would hide everything (a floor): the drawn floor stands for it."""
    if body.kind == "cloth":
        return False
    extent = np.ptp(recording.positions(body, 0), axis=0)
    return bool(np.linalg.norm(extent) > 3.0 * reach)


def _polydata(pv: Any, x: Floats, triangles: Ints) -> Any:
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1).reshape(-1)
    surface = pv.PolyData(x.astype(np.float32), faces)
    surface.point_data.active_normals = vertex_normals(x, triangles).astype(np.float32)
    return surface


def _add_body(pv: Any, plotter: Any, recording: Recording, body: Body, frame: int, number: int) -> None:
    surface = _polydata(pv, recording.positions(body, frame), body.triangles)
    if body.kind == "collider":
        plotter.add_mesh(
            surface, color=_COLLIDER, smooth_shading=True, ambient=0.3, diffuse=0.7, specular=0.2, specular_power=20
        )
        return
    front, back = _CLOTHS[number % len(_CLOTHS)]
    look = {"ambient": 0.25, "diffuse": 0.8, "specular": 0.08, "specular_power": 8}
    plotter.add_mesh(surface, color=front, smooth_shading=True, backface_params={"color": back, **look}, **look)


def _add_floor(pv: Any, plotter: Any, centre: Floats, reach: float, floor: float, up: int) -> None:
    normal, at = np.zeros(3), centre.copy()
    normal[up], at[up] = 1.0, floor
    plane = pv.Disc(center=at, inner=0.0, outer=12.0 * reach, normal=normal, c_res=96)
    plotter.add_mesh(plane, color=_FLOOR, ambient=0.45, diffuse=0.6, specular=0.0)


def _axes(up: int) -> tuple[Floats, Floats, Floats]:
    """Right, up, towards the viewer."""
    if up == 1:
        return np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0])
    return np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([0, -1.0, 0])


def _add_lights(pv: Any, plotter: Any, centre: Floats, reach: float, up: int) -> None:
    right, upward, front = _axes(up)

    key = centre + 6.0 * reach * _unit(-0.55 * right + 1.35 * upward + 0.6 * front)
    plotter.add_light(
        pv.Light(
            position=key, focal_point=centre, intensity=0.78, color="#fff5e8", positional=True, cone_angle=45,
            exponent=0, attenuation_values=(1, 0, 0),
        )
    )  # fmt: skip
    # Headlights cast no shadow in VTK.
    plotter.add_light(pv.Light(light_type="headlight", intensity=0.32, color="#eaf1ff"))


def _refine_shadows(plotter: Any) -> None:
    """Raise the resolution of the shadow map, where this PyVista lets one reach it."""
    passes = getattr(plotter.renderer, "_render_passes", None)
    shadow = getattr(passes, "_shadow_map_pass", None)
    if shadow is not None:
        shadow.GetShadowMapBakerPass().SetResolution(_SHADOW_MAP)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


def _place_camera(plotter: Any, subject: Floats, up: int) -> None:
    """Look down a little from the front right, as near as all points of the subject allow."""
    right, upward, front = _axes(up)
    view = _unit(0.5 * right + 0.55 * upward + 1.0 * front)
    across = _unit(np.cross(upward, view))
    above = np.cross(view, across)
    camera = plotter.camera
    camera.up = tuple(upward)
    camera.view_angle = 28.0
    tangent = np.tan(np.radians(camera.view_angle / 2)) * 0.92
    axes = np.stack([across, above, view])
    local = subject @ axes.T
    centre = 0.5 * (local.min(axis=0) + local.max(axis=0))
    offset = local - centre
    distance = float((np.abs(offset[:, :2]).max(axis=1) / tangent + offset[:, 2]).max())
    camera.focal_point = tuple(centre @ axes)
    camera.position = tuple((centre + [0.0, 0.0, distance]) @ axes)
    plotter.renderer.reset_camera_clipping_range()


def _compose(tiles: list[Any], times: list[float], title: str) -> bytes:
    """Tiles in a row (two rows from five on), the time below each."""
    image_module = optional("PIL.Image", extra="view", purpose="writing pictures")
    draw_module = optional("PIL.ImageDraw", extra="view", purpose="writing pictures")
    font_module = optional("PIL.ImageFont", extra="view", purpose="writing pictures")
    rows = 1 if len(tiles) <= 4 else 2
    columns = -(-len(tiles) // rows)
    width, height = _TILE
    head = 84 if title else _GAP
    sheet = image_module.new(
        "RGB",
        (columns * (width + _GAP) + _GAP, head + rows * (height + _BAND) + _GAP),
        _PAPER,
    )
    draw = draw_module.Draw(sheet)
    if title:
        draw.text((_GAP + 14, 24), title, fill=_INK, font=font_module.load_default(38))
    for index, (tile, time) in enumerate(zip(tiles, times, strict=True)):
        left = _GAP + index % columns * (width + _GAP)
        top = head + index // columns * (height + _BAND)
        sheet.paste(image_module.fromarray(tile), (left, top))
        draw.text((left + 14, top + height + 14), f"{time:.2f} s", fill=_FAINT, font=font_module.load_default(28))
    buffer = io.BytesIO()
    sheet.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()
