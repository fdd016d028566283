"""One style for plots and rendered tiles."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from clothsim._arrays import Floats, optional
from clothsim.recording import Body, Recording

__all__ = ["FAINT", "GRID", "INK", "LAWS", "caption", "figure", "png", "show", "tidy", "tiles"]

INK, FAINT, GRID = "#343230", "#8c8882", "#e4e1db"
_LETTERS = 13.0  # of a note, per inch: the mean of its font, and some room
_MARGIN = 1.12  # of a tile's frame over what is seen in it
# One colour per bending law.
LAWS = {"linear": "#2f5d8c", "nonlinear": "#3f7a57", "plastic": "#c08a2e", "hysteresis": "#9c2f35"}


def figure(title: str, size: tuple[float, float], note: str = "") -> Any:
    """Make a figure of ``size`` [inch] with its title above and a note below, its lines broken at the width."""
    figures = optional("matplotlib.figure", extra="plot", purpose="drawing plots")
    optional("matplotlib.backends.backend_agg", extra="plot", purpose="drawing plots")
    made = figures.Figure(figsize=size, dpi=150, layout="constrained")
    made.suptitle(title, fontsize=15, color=INK, x=0.01, ha="left")
    if note:
        wide = int(_LETTERS * size[0])
        note = "\n".join(textwrap.fill(line, wide) for line in note.splitlines())
        made.supxlabel(note, fontsize=9.5, color=FAINT, x=0.01, ha="left")
    return made


def tidy(axis: Any, title: str = "", x: str = "", y: str = "") -> None:
    """Give an axis its titles and the house's looks."""
    if title:
        axis.set_title(title, fontsize=11.5, color=INK, loc="left")
    axis.set_xlabel(x, color=INK)
    axis.set_ylabel(y, color=INK)
    axis.grid(color=GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(colors=INK)


def caption(axis: Any, text: str, at: tuple[float, float] = (0.03, 0.97), *, size: float = 9.0) -> None:
    """Write a few lines into a corner of an axis, at a place in its own units from 0 to 1."""
    right, top = at[0] > 0.5, at[1] > 0.5
    axis.text(
        *at, text, transform=axis.transAxes, fontsize=size, color=INK, va="top" if top else "bottom",
        ha="right" if right else "left", linespacing=1.45,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 2.5},
    )  # fmt: skip


def png(made: Any) -> bytes:
    """The figure as the content of a PNG file."""
    buffer = io.BytesIO()
    made.savefig(buffer, format="png", facecolor="white")
    return buffer.getvalue()


def tiles(
    bodies: Sequence[Body],
    states: Sequence[Floats],
    standing: Floats | None = None,
    *,
    size: tuple[int, int] = (600, 600),
) -> list[Any]:
    """Render each state with one camera that sees all of them; needs PyVista.

    Parameters
    ----------
    bodies : sequence of Body
        What there is, as `Simulation.bodies` gives it.
    states : sequence of (n, 3) float64
        Positions of the bodies that move [m], as in a `Recording`.
    standing : (k, 3) float64, optional
        Positions of those that stand still [m].
    size : (int, int)
        Width and height [px].

    Returns
    -------
    list of (height, width, 3) uint8 arrays
    """
    from clothsim._export import film_strip

    # The camera comes as near as all frames allow: frames that are a little larger, not rendered, leave a margin.
    count = sum(body.vertex_count for body in bodies if body.kind == "cloth")
    middle = np.mean([state[:count].mean(axis=0) for state in states], axis=0)
    larger = [middle + _MARGIN * (state - middle) for state in states]
    recording = Recording(list(bodies), np.arange(2 * len(states), dtype=float), np.array([*states, *larger]), standing)
    return [film_strip.render(recording, index, size) for index in range(len(states))]


def show(axis: Any, image: Any, title: str, note: str = "") -> None:
    """Put a rendered tile on an axis."""
    axis.imshow(image, interpolation="lanczos")
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)
    axis.set_title(title, fontsize=11.5, color=INK, loc="left")
    if note:
        axis.set_xlabel(note, fontsize=9.5, color=FAINT, loc="left")
