"""One frame of a run in PyVista: what pictures, films and the window share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import Floats
from clothsim._export import studio
from clothsim._export.usd import vertex_normals
from clothsim._view.colours import CONTACT_COLOURS, MAPS, rgb, table
from clothsim._view.fields import Fields
from clothsim.recording import Body, Recording

__all__ = ["Camera", "Stage"]


@dataclass(frozen=True)
class Camera:
    """Where the picture is taken from.

    Attributes
    ----------
    azimuth, elevation : float
        Direction [deg]: from the front to the right, and up.
    zoom : float
        How much nearer than what shows the whole run, > 0.
    """

    azimuth: float = studio.AZIMUTH
    elevation: float = studio.ELEVATION
    zoom: float = 1.0


class Stage:
    """A plotter with the bodies of a run, moved from frame to frame.

    Parameters
    ----------
    recording : Recording
        The run.
    fields : Fields
        Its colour maps.
    colour : str
        Which of them is shown.
    camera : Camera
        Where from.
    size : (int, int)
        Width and height [px].
    frame : int, optional
        What the camera is placed for, and what is shown first; by default the whole run, and its start.
    off_screen : bool
        Pictures instead of a window.
    shadows : bool
        Draw shadows.
    fine : bool
        Pictures are drawn at twice the size and made smaller: smoother, and four times the work.
    """

    def __init__(
        self, recording: Recording, fields: Fields, colour: str, camera: Camera, size: tuple[int, int],
        *, off_screen: bool, fine: bool = False, frame: int | None = None,
        shadows: bool = True,
    ) -> None:  # fmt: skip
        self._pv = studio.pyvista()
        self.recording = recording
        self.fields = fields
        self.camera = camera
        self.colour = "none"
        self.frame = frame or 0
        self._scale = 2 if fine else 1
        self._spans: dict[str, tuple[float, float]] = {}
        self._surfaces: dict[str, Any] = {}
        self.plotter = self._pv.Plotter(
            off_screen=off_screen, window_size=[side * self._scale for side in size], lighting="none"
        )
        try:
            self._points = studio.subject(recording, frame)
            self._build(shadows=shadows)
            self.set_colour(colour)
        except BaseException:
            self.close()
            raise

    def _build(self, *, shadows: bool) -> None:
        plotter, up = self.plotter, self.fields.up
        plotter.set_background(studio.BACKGROUND)
        whole = studio.subject(self.recording)
        low, high = whole.min(axis=0), whole.max(axis=0)
        centre, reach = 0.5 * (low + high), max(float(np.linalg.norm(high - low)), 1e-6)
        studio.add_floor(self._pv, plotter, centre, reach, low[up] - 0.004 * reach, up)
        self._shown = [
            (number, body)
            for number, body in enumerate(self.recording.bodies)
            if not studio.is_backdrop(self.recording, body, reach)
        ]
        for number, body in self._shown:
            surface = studio.polydata(self._pv, self.recording.positions(body, 0), body.triangles)
            self._surfaces[body.name] = surface
            studio.add_surface(plotter, surface, body, number)
        studio.add_lights(self._pv, plotter, centre, reach, up)
        self.place_camera()
        if shadows:
            plotter.enable_shadows()
            studio.refine_shadows(plotter)

    def place_camera(self) -> None:
        """Look at the whole run again."""
        camera = self.camera
        studio.place_camera(
            self.plotter, self._points, self.fields.up,
            azimuth=camera.azimuth, elevation=camera.elevation, zoom=camera.zoom,
        )  # fmt: skip

    def span(self) -> tuple[float, float]:
        """Range of the colour map that is shown, in SI."""
        if self.colour not in self._spans:
            self._spans[self.colour] = self.fields.span(self.colour)
        return self._spans[self.colour]

    def set_colour(self, name: str) -> None:
        """Show another colour map, in the frame that is shown."""
        if name == "contact":
            _ = self.fields.reach  # says what is missing
        self.colour = name
        for number, body in self._shown:
            if body.kind != "cloth":
                continue
            surface = self._surfaces[body.name]
            if name != "none":
                self._paint(body, surface)
            studio.add_surface(self.plotter, surface, body, number, painted=name != "none")
        self.show(self.frame)

    def show(self, frame: int) -> None:
        """Move to a frame."""
        self.frame = frame
        touches = self.fields.contact(frame) if self.colour == "contact" else {}
        for _, body in self._shown:
            if body.static:
                continue
            surface = self._surfaces[body.name]
            x = self.recording.positions(body, frame)
            surface.points = x.astype(np.float32)
            surface.point_data.active_normals = vertex_normals(x, body.triangles).astype(np.float32)
            if body.kind == "cloth" and self.colour != "none":
                self._paint(body, surface, touches.get(body.name))

    def _paint(self, body: Body, surface: Any, touches: NDArray[np.uint8] | None = None) -> None:
        """Give each vertex its colour."""
        if self.colour == "contact":
            if touches is None:
                touches = self.fields.contact(self.frame)[body.name]
            surface.point_data["rgb"] = np.array([rgb(c) for c in CONTACT_COLOURS], np.uint8)[touches]
            return
        low, high = self.span()
        values: Floats = self.fields.values(self.colour, body, self.frame)
        at = np.rint(np.clip((values - low) / (high - low), 0.0, 1.0) * 255.0).astype(int)
        surface.point_data["rgb"] = table(MAPS[self.colour])[at]

    def image(self) -> NDArray[np.uint8]:
        """Draw what is shown: (height, width, 3)."""
        self.plotter.render()
        image = np.asarray(self.plotter.screenshot(None, return_img=True))[:, :, :3]
        if self._scale == 1:
            return image
        corners = [image[a::2, b::2].astype(np.uint16) for a in (0, 1) for b in (0, 1)]
        mean: NDArray[np.uint8] = ((sum(corners[1:], corners[0]) + 2) >> 2).astype(np.uint8)
        return mean

    def close(self) -> None:
        """Give the plotter back."""
        self.plotter.close()
