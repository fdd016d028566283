"""A film strip: several moments of a run side by side, rendered off screen."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from clothsim._arrays import optional
from clothsim._export import studio
from clothsim._files import write_whole
from clothsim.recording import Recording

__all__ = ["moments_of", "render", "write"]

_TILE = (600, 600)  # px
_SUPERSAMPLING = 2
_GAP = 10  # px between tiles
_BAND = 64  # px below the tiles for the times
_PAPER = (250, 249, 246)
_INK = (52, 50, 48)
_FAINT = (140, 136, 130)


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
    pv = studio.pyvista()
    plotter = pv.Plotter(off_screen=True, window_size=[side * _SUPERSAMPLING for side in size], lighting="none")
    try:
        plotter.set_background(studio.BACKGROUND)
        points = studio.subject(recording)
        low, high = points.min(axis=0), points.max(axis=0)
        up = 2 if recording.up == "z" else 1
        centre, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
        floor = low[up] - 0.004 * reach
        studio.add_floor(pv, plotter, centre, reach, floor, up)
        for number, body in enumerate(recording.bodies):
            if not studio.is_backdrop(recording, body, reach):
                studio.add_body(pv, plotter, recording, body, frame, number)
        studio.add_lights(pv, plotter, centre, reach, up)
        studio.place_camera(plotter, points, up)
        plotter.enable_shadows()
        studio.refine_shadows(plotter)
        image = plotter.screenshot(None, return_img=True)
    finally:
        plotter.close()
    k = _SUPERSAMPLING
    height, width = image.shape[0] // k, image.shape[1] // k
    tiles = image[: height * k, : width * k, :3].reshape(height, k, width, k, 3).astype(np.float64)
    return np.rint(tiles.mean(axis=(1, 3))).astype(np.uint8)


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
