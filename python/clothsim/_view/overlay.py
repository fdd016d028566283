"""Words on pictures: title, time, frame number, and the colour bar with its unit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import optional
from clothsim._view.colours import CONTACT_COLOURS, MAPS, table

__all__ = ["annotated"]

_INK, _FAINT = (43, 41, 39), (125, 119, 112)


def annotated(
    image: NDArray[np.uint8], title: str, time: float, frame: int, count: int, colour: str, span: tuple[float, float],
    note: str = "",
) -> NDArray[np.uint8]:  # fmt: skip
    """Write on an image (height, width, 3): title, time [s], frame of ``count``, and the colour map's bar."""
    images = optional("PIL.Image", extra="view", purpose="writing pictures")
    drawing = optional("PIL.ImageDraw", extra="view", purpose="writing pictures")
    picture = images.fromarray(image)
    draw = drawing.Draw(picture)
    unit = max(6.0, min(picture.width, 1.5 * picture.height) / 100.0)
    margin = 2.4 * unit
    draw.text((margin, margin), title, fill=_INK, font=_font(2.6 * unit))
    line = f"{time:.3f} s   frame {frame} / {count - 1}"
    draw.text((margin, margin + 3.7 * unit), line, fill=_FAINT, font=_font(1.7 * unit))
    bottom = picture.height - margin
    if colour == "contact":
        _classes(draw, margin, bottom, unit, note)
    elif colour != "none":
        _bar(images, picture, draw, colour, span, margin, bottom, unit)
    return np.asarray(picture)


def _font(size: float) -> Any:
    return optional("PIL.ImageFont", extra="view", purpose="writing pictures").load_default(size)


def _bar(
    images: Any,
    picture: Any,
    draw: Any,
    colour: str,
    span: tuple[float, float],
    left: float,
    bottom: float,
    unit: float,
) -> None:
    found = MAPS[colour]
    width, height = round(34 * unit), round(1.5 * unit)
    top = round(bottom - 2.6 * unit - height)
    small = _font(1.6 * unit)
    draw.text((left, top - 2.7 * unit), f"{found.label} [{found.unit}]", fill=_INK, font=small)
    strip = np.broadcast_to(table(found, width)[None], (height, width, 3))
    picture.paste(images.fromarray(np.ascontiguousarray(strip)), (round(left), top))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        value = (span[0] + share * (span[1] - span[0])) * found.scale
        at = left + share * (width - 1)
        draw.line([(at, top + height), (at, top + height + 0.5 * unit)], fill=_FAINT, width=max(1, round(unit / 8)))
        anchor = "la" if share == 0.0 else "ma"
        draw.text((at, top + height + 0.8 * unit), f"{value:.3g}", fill=_INK, font=small, anchor=anchor)


def _classes(draw: Any, left: float, bottom: float, unit: float, note: str) -> None:
    small = _font(1.6 * unit)
    at, top = left, bottom - 2.0 * unit
    for text, fill in zip(("no contact", "on cloth", "on a collider"), CONTACT_COLOURS, strict=True):
        draw.rounded_rectangle(
            [at, top, at + 1.8 * unit, top + 1.8 * unit], 0.4 * unit, fill=fill, outline=_FAINT, width=1
        )
        draw.text((at + 2.5 * unit, top + 0.9 * unit), text, fill=_INK, font=small, anchor="lm")
        at += 4.6 * unit + draw.textlength(text, font=small)
    draw.text((at, top + 0.9 * unit), note, fill=_FAINT, font=small, anchor="lm")
