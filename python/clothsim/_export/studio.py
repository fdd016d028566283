"""The studio of all pictures: bodies with their colours, floor, lights, shadows and camera for PyVista."""

from __future__ import annotations

from typing import Any

import numpy as np

from clothsim._arrays import Floats, Ints, optional
from clothsim._export.usd import vertex_normals
from clothsim.recording import Body, Recording

__all__ = [
    "AZIMUTH",
    "BACKGROUND",
    "ELEVATION",
    "add_body",
    "add_floor",
    "add_lights",
    "add_surface",
    "body_colours",
    "is_backdrop",
    "place_camera",
    "polydata",
    "pyvista",
    "refine_shadows",
    "subject",
]

BACKGROUND = "#f4f2ee"

# Where the camera stands unless it is told otherwise [deg]: a little to the right, a little above.
AZIMUTH = float(np.degrees(np.arctan2(0.5, 1.0)))
ELEVATION = float(np.degrees(np.arctan2(0.55, np.hypot(0.5, 1.0))))
_SHADOW_MAP = 4096  # texels along a side

# Front and back of each cloth, and colliders.
_CLOTHS = (("#9c2f35", "#c98f6a"), ("#2f5d8c", "#9fb8cf"), ("#c08a2e", "#e3cf9f"), ("#3f7a57", "#a9c9b3"))
_COLLIDER = "#d3d6da"
_FLOOR = "#f6f3ec"


def pyvista() -> Any:
    """PyVista, with VTK's remarks about missing displays turned off."""
    pv = optional("pyvista", extra="view", purpose="rendering pictures")
    # Without a display VTK falls back to EGL, and says so on stderr.
    logger = optional("vtkmodules.vtkCommonCore", extra="view", purpose="rendering pictures").vtkLogger
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    return pv


def body_colours(body: Body, number: int) -> tuple[str, str]:
    """Front and back of a body, ``number``-th of its recording."""
    return _CLOTHS[number % len(_CLOTHS)] if body.kind == "cloth" else (_COLLIDER, _COLLIDER)


def subject(recording: Recording, frame: int | None = None) -> Floats:
    """Points that are to be seen: the cloth (a sample of it) in a frame or the whole run, and colliders of its size."""
    frames = np.unique(np.linspace(0, len(recording) - 1, 25).astype(int)) if frame is None else np.array([frame])
    points = [recording.positions(body, int(f))[::7] for body in recording.cloth for f in frames]
    if not points:
        return np.concatenate([recording.positions(body, int(frames[0])) for body in recording.bodies])
    span = float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
    for body in recording.bodies:
        x = recording.positions(body, int(frames[0]))
        if body.kind == "collider" and np.linalg.norm(np.ptp(x, axis=0)) < 1.5 * span:
            points.append(x)
    return np.concatenate(points)


def is_backdrop(recording: Recording, body: Body, reach: float) -> bool:
    """A collider so large that it would hide everything (a floor): the drawn floor stands for it."""
    if body.kind == "cloth":
        return False
    extent = np.ptp(recording.positions(body, 0), axis=0)
    return bool(np.linalg.norm(extent) > 3.0 * reach)


def polydata(pv: Any, x: Floats, triangles: Ints) -> Any:
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1).reshape(-1)
    surface = pv.PolyData(x.astype(np.float32), faces)
    surface.point_data.active_normals = vertex_normals(x, triangles).astype(np.float32)
    return surface


def add_body(pv: Any, plotter: Any, recording: Recording, body: Body, frame: int, number: int) -> None:
    """Add a body as it is in a frame."""
    add_surface(plotter, polydata(pv, recording.positions(body, frame), body.triangles), body, number)


def add_surface(plotter: Any, surface: Any, body: Body, number: int, *, painted: bool = False) -> None:
    """Add a body's surface in its colours, or in those of its array ``rgb``; a second time: replace it."""
    if body.kind == "collider":
        plotter.add_mesh(
            surface, name=f"body {number}", color=_COLLIDER, smooth_shading=True, ambient=0.3, diffuse=0.7,
            specular=0.2, specular_power=20,
        )  # fmt: skip
        return
    look = {"name": f"body {number}", "smooth_shading": True, "reset_camera": False}
    shine = {"ambient": 0.28, "diffuse": 0.95, "specular": 0.08, "specular_power": 8}
    if painted:
        # No brighter than its colours, which are to be read.
        plotter.add_mesh(surface, scalars="rgb", rgb=True, **look, ambient=0.36, diffuse=0.6, specular=0.0)
        return
    front, back = body_colours(body, number)
    plotter.add_mesh(surface, color=front, backface_params={"color": back, **shine}, **look, **shine)


def add_floor(pv: Any, plotter: Any, centre: Floats, reach: float, floor: float, up: int) -> None:
    normal, at = np.zeros(3), centre.copy()
    normal[up], at[up] = 1.0, floor
    plane = pv.Disc(center=at, inner=0.0, outer=12.0 * reach, normal=normal, c_res=96)
    plotter.add_mesh(plane, color=_FLOOR, ambient=0.63, diffuse=0.4, specular=0.0)


def _axes(up: int) -> tuple[Floats, Floats, Floats]:
    """Right, up, towards the viewer."""
    if up == 1:
        return np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0])
    return np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([0, -1.0, 0])


def add_lights(pv: Any, plotter: Any, centre: Floats, reach: float, up: int) -> None:
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


def refine_shadows(plotter: Any) -> None:
    """Raise the resolution of the shadow map, where this PyVista lets one reach it."""
    passes = getattr(plotter.renderer, "_render_passes", None)
    shadow = getattr(passes, "_shadow_map_pass", None)
    if shadow is not None:
        shadow.GetShadowMapBakerPass().SetResolution(_SHADOW_MAP)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


def place_camera(
    plotter: Any, subject: Floats, up: int, *, azimuth: float = AZIMUTH, elevation: float = ELEVATION, zoom: float = 1.0
) -> None:
    """Look at the subject's middle from a direction [deg], as near as all its points allow, and ``zoom`` times nearer.

    ``azimuth`` goes from the front to the right, ``elevation`` from the horizon up, within ±89°.
    """
    right, upward, front = _axes(up)
    turn, rise = np.radians(azimuth), np.radians(elevation)
    view = np.cos(rise) * (np.sin(turn) * right + np.cos(turn) * front) + np.sin(rise) * upward
    across = _unit(np.cross(upward, view))
    above = np.cross(view, across)
    camera = plotter.camera
    camera.up = tuple(upward)
    camera.view_angle = 28.0
    tangent = np.tan(np.radians(camera.view_angle / 2)) * 0.92
    width, height = plotter.window_size
    tangents = tangent * np.array([width / height, 1.0])  # the angle of view is the vertical one
    axes = np.stack([across, above, view])
    local = subject @ axes.T
    centre = 0.5 * (local.min(axis=0) + local.max(axis=0))
    offset = local - centre
    distance = float(((np.abs(offset[:, :2]) / tangents).max(axis=1) + offset[:, 2]).max()) / zoom
    camera.focal_point = tuple(centre @ axes)
    camera.position = tuple((centre + [0.0, 0.0, distance]) @ axes)
    plotter.renderer.reset_camera_clipping_range()
