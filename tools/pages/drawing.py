"""How the pictures of the effects are drawn: plots of one style, and rendered tiles side by side."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

import clothsim as cs
from clothsim._export.film_strip import render

FOLDER = Path(__file__).parents[2] / "docs" / "images" / "effects"
RED, BLUE, OCHRE, GREEN, GREY = "#9c2f35", "#2f5d8c", "#c08a2e", "#3f7a57", "#8c8882"
COLOURS = (RED, BLUE, OCHRE, GREEN, GREY)
PAPER, INK = "#faf9f6", "#343230"
TILE = (360, 330)  # px


def plot(count: int = 1, *, share: bool = False) -> tuple[Any, Any]:
    """Return a figure and its axes in the style of the site."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * count if count < 3 else 10.5, 2.9), dpi=110, layout="constrained", facecolor=PAPER)
    axes = figure.subplots(1, count, sharey=share)
    for axis in np.atleast_1d(axes):
        axis.set_facecolor(PAPER)
        axis.grid(color="#e4e1db", linewidth=0.8)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(colors=INK, labelsize=8)
    return figure, axes


def finish(figure: Any) -> bytes:
    """Add legends where there are labels, and return the PNG."""
    for axis in figure.axes:
        axis.title.set_fontsize(9.5)
        axis.xaxis.label.set_fontsize(9)
        axis.yaxis.label.set_fontsize(9)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(frameon=False, fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor=PAPER)
    return _small(buffer.getvalue())


def run(scene: dict[str, Any] | cs.Scene, seconds: float, fps: float = 30.0, **options: Any) -> cs.Recording:
    """Simulate a scene and return its frames."""
    scene = scene if isinstance(scene, cs.Scene) else cs.Scene(**scene)
    return cs.record(cs.Simulation(scene, device="cpu", **options), seconds, fps=fps, progress=False)


def alone(recording: cs.Recording, frame: int) -> cs.Recording:
    """That frame as a recording of its own, so that the camera comes as near as it allows."""
    number = frame % len(recording)
    moving = [recording.positions(body, number) for body in recording.bodies if not body.static]
    standing = [recording.positions(body, number) for body in recording.bodies if body.static]
    return cs.Recording(
        recording.bodies,
        recording.times[number : number + 1],
        np.concatenate(moving)[None],
        np.concatenate(standing) if standing else None,
        up=recording.up,
    )


def tiles(shown: list[tuple[str, cs.Recording, int]]) -> bytes:
    """Render frames of recordings side by side, each with a caption below."""
    from PIL import Image, ImageDraw, ImageFont

    width, height = TILE
    sheet = Image.new("RGB", (len(shown) * (width + 8) - 8, height + 34), PAPER)
    draw = ImageDraw.Draw(sheet)
    for k, (caption, recording, frame) in enumerate(shown):
        left = k * (width + 8)
        number = frame % len(recording)
        sheet.paste(Image.fromarray(render(recording, number, TILE)), (left, 0))
        draw.text((left + 8, height + 8), caption, fill=INK, font=ImageFont.load_default(17))
    buffer = io.BytesIO()
    sheet.save(buffer, format="PNG")
    return _small(buffer.getvalue())


def _small(png: bytes) -> bytes:
    """A palette of 160 colours: a third of the bytes, and no difference to see."""
    from PIL import Image

    image = Image.open(io.BytesIO(png)).convert("RGB").quantize(160, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()
