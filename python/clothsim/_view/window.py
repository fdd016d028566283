"""A window with a run: play, pause, scrub, step, colour maps (PyVista)."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
import time
from typing import Any

import numpy as np

from clothsim._export.studio import pyvista
from clothsim._view.colours import CONTACT_COLOURS, MAPS, table
from clothsim._view.fields import Fields
from clothsim._view.source import Source
from clothsim._view.stage import Camera, Stage
from clothsim.errors import InvalidInput

__all__ = ["Window", "check_display"]

_INK = "#2b2927"
_KEYS = "space: play   left, right: step   home, end   c: colour   h: whole scene   q: close"
_TICK = 15  # ms between two looks at the clock


def check_display() -> None:
    """Make sure that a window can be shown.

    Raises
    ------
    InvalidInput
        There is no display, or it cannot be reached.
    """
    if not sys.platform.startswith("linux"):
        return
    other = "--still FILE.png, --film FILE.mp4 or --browser need none"
    if os.environ.get("WAYLAND_DISPLAY") and not os.environ.get("DISPLAY"):
        raise InvalidInput(f"display: expected an X display ($DISPLAY; Xwayland has one), got Wayland alone; {other}")
    if not os.environ.get("DISPLAY"):
        raise InvalidInput(f"display: expected a display to show a window on, got none ($DISPLAY is not set); {other}")
    name = ctypes.util.find_library("X11")
    if name is None:
        return
    x11 = ctypes.CDLL(name)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        got = f"DISPLAY={os.environ['DISPLAY']}, which cannot be opened"
        raise InvalidInput(f"display: expected a display to show a window on, got {got}; {other}")
    x11.XCloseDisplay(ctypes.c_void_p(display))


class Window:
    """A stage with a clock, a slider and keys.

    Parameters
    ----------
    source : Source
        The run.
    fields : Fields
        Its colour maps.
    colour : str
        The one shown first.
    camera : Camera
        Where from.
    size : (int, int)
        Width and height [px].
    frame : int
        The frame shown first.
    speed : float
        Seconds of the run in a second.
    off_screen : bool
        Draw into memory, for tests.
    """

    def __init__(
        self,
        source: Source,
        fields: Fields,
        colour: str,
        camera: Camera,
        size: tuple[int, int],
        *,
        frame: int = 0,
        speed: float = 1.0,
        off_screen: bool = False,
    ) -> None:
        self._recording = source.frames()
        self._title = source.title
        self._fields = fields
        self._speed = speed
        self.playing = False
        self._began = (0.0, 0.0)
        self.stage = Stage(self._recording, fields, colour, camera, size, off_screen=off_screen, shadows=False)
        plotter = self.stage.plotter
        last = len(self._recording) - 1
        self._slider: Any = None
        if last > 0:
            self._slider = plotter.add_slider_widget(
                self._scrub, [0, last], value=frame, title="", fmt="%.0f", color=_INK, interaction_event="always",
                pointa=(0.28, 0.1), pointb=(0.96, 0.1), slider_width=0.014, tube_width=0.003,
            )  # fmt: skip
        plotter.add_text(_KEYS, position=(14, 10), font_size=8, color="#8a857e", name="keys")
        for key, action in {
            "space": self.toggle, "Left": lambda: self.step(-1), "Right": lambda: self.step(1),
            "Home": lambda: self.go(0), "End": lambda: self.go(last), "c": self.next_colour, "h": self._home,
        }.items():  # fmt: skip
            plotter.add_key_event(key, action)
        self._legend()
        self.go(frame)

    # What keys and the slider do -----------------------------------------------------------------------------

    def go(self, frame: int) -> None:
        """Show a frame, the nearest that there is."""
        frame = max(0, min(len(self._recording) - 1, frame))
        self.stage.show(frame)
        text = f"{self._title}\n{self._recording.times[frame]:.3f} s   frame {frame} / {len(self._recording) - 1}"
        self.stage.plotter.add_text(text, position="upper_left", font_size=12, color=_INK, name="facts", render=False)
        if self._slider is not None:
            self._slider.GetRepresentation().SetValue(frame)

    def step(self, by: int) -> None:
        """Pause, and go some frames on or back."""
        self.playing = False
        self.go(self.stage.frame + by)
        self.stage.plotter.render()

    def toggle(self) -> None:
        """Play or pause; from the last frame: from the start again."""
        self.playing = not self.playing
        if self.playing and self.stage.frame == len(self._recording) - 1:
            self.go(0)
        self._began = (time.monotonic(), float(self._recording.times[self.stage.frame]))

    def next_colour(self) -> None:
        """Show the next colour map that the run allows."""
        names = [name for name in MAPS if name != "contact" or self._fields.has_contact]
        self.stage.set_colour(names[(names.index(self.stage.colour) + 1) % len(names)])
        self._legend()
        self.stage.plotter.render()

    def tick(self, now: float) -> None:
        """Show the frame of this moment [s, of a clock], if it plays."""
        if not self.playing:
            return
        times = self._recording.times
        moment = self._began[1] + (now - self._began[0]) * self._speed
        frame = int(np.searchsorted(times, moment, side="right")) - 1
        if frame != self.stage.frame:
            self.go(frame)
            self.stage.plotter.render()
        if moment >= times[-1]:
            self.playing = False

    def _scrub(self, value: float) -> None:
        if round(value) != self.stage.frame:
            self.playing = False
            self.go(round(value))

    def _home(self) -> None:
        self.stage.place_camera()
        self.stage.plotter.render()

    def _legend(self) -> None:
        """Colour bar with its unit, or the classes of contact."""
        plotter, name = self.stage.plotter, self.stage.colour
        for title in list(plotter.scalar_bars.keys()):
            plotter.remove_scalar_bar(title, render=False)
        plotter.remove_legend(render=False)
        if name == "contact":
            labels = [[t, c] for t, c in zip(("no contact", "on cloth", "on a collider"), CONTACT_COLOURS, strict=True)]
            plotter.add_legend(labels, bcolor=None, face="rectangle", size=(0.16, 0.1), loc="center left")
        elif name != "none":
            found, (low, high) = MAPS[name], self.stage.span()
            lookup = pyvista().LookupTable(scalar_range=(low * found.scale, high * found.scale))
            lookup.values = np.column_stack([table(found), np.full(256, 255, np.uint8)])
            mapper = pyvista().DataSetMapper()
            mapper.lookup_table = lookup
            plotter.add_scalar_bar(
                f"{found.label} [{found.unit}]", mapper=mapper, vertical=True, n_labels=5, fmt="%.3g", color=_INK,
                position_x=0.08, position_y=0.25, width=0.05, height=0.5, title_font_size=14, label_font_size=12,
                render=False,
            )  # fmt: skip

    def show(self) -> None:
        """Open the window; returns when it is closed."""
        plotter = self.stage.plotter
        plotter.add_timer_event(max_steps=2**31 - 1, duration=_TICK, callback=lambda _: self.tick(time.monotonic()))
        try:
            plotter.show(title=f"clothsim: {self._title}")
        finally:
            self.close()

    def close(self) -> None:
        """Give the window back."""
        self.stage.close()
