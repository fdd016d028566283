"""The animations of Wong 2010 at a few moments, for figures 5 and 6 and table 1: pictures, motion, contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim import collision
from clothsim._arrays import Floats
from clothsim.recording import Body
from clothsim.reproduce import pictures
from clothsim.reproduce.animations import SETS, Animation, Listed
from clothsim.reproduce.animations.contacts import Contacts, contacts, passing
from clothsim.reproduce.contract import Check, Effort, Table

__all__ = ["Shot", "checks", "draw_titled", "here", "parameters", "shoot", "tables"]

MOMENTS, QUICK_MOMENTS = (0, 30, 59), (0, 59)  # frames; all but the first are drawn
COLUMNS = (
    "set", "animation", "what", "frame", "cloth triangles", "other triangles", "thickness [mm]", "mean edge [mm]",
    "mean motion of the cloth [mm]", "largest motion [mm]", "contacts cloth-cloth", "contacts cloth-body",
    "triangle pairs that intersect",
)  # fmt: skip
MADE = "by formula, not simulated; shapes, sizes and motion are chosen: the paper's animations are not published"


@dataclass(frozen=True)
class Shot:
    """An animation at one frame.

    Attributes
    ----------
    experiment : str
        Set one or two.
    listed : Listed
        Which animation.
    animation : Animation
        Its frames.
    frame : int
        Which of them.
    x : (n, 3) float64
        Positions [m].
    edge : float
        Mean length of the cloth's edges [m].
    motion : (n,) float64
        Way of the cloth's vertices to the next frame [m].
    contacts : Contacts
        On that way.
    passing : int
        Pairs of triangles that pass through each other, bodies among themselves left out.
    """

    experiment: str
    listed: Listed
    animation: Animation
    frame: int
    x: Floats
    edge: float
    motion: Floats
    contacts: Contacts
    passing: int


def shoot(effort: Effort, experiments: Sequence[str], name: str) -> list[Shot]:
    """Detect at the moments of each animation of the sets."""
    shots = []
    listed = [(experiment, item) for experiment in experiments for item in SETS[experiment]]
    moments = QUICK_MOMENTS if effort.quick else MOMENTS
    with effort.bar(len(listed) * len(moments), name, "moment") as bar:
        for experiment, item in listed:
            animation = item.make(quick=effort.quick)
            triangles = animation.triangles[: animation.count(cloth=True)]
            vertices = animation.cloth_vertices()
            for frame in moments:
                x, after = animation.frame(frame), animation.frame(frame + 1)
                found = collision.detect(
                    x, after, animation.triangles, thickness=animation.thickness, threads=effort.threads
                )
                edges = np.linalg.norm(x[triangles] - x[np.roll(triangles, 1, axis=1)], axis=2)
                motion = np.linalg.norm(after - x, axis=1)[:vertices]
                through = len(passing(animation, x, threads=effort.threads))
                shots.append(
                    Shot(experiment, item, animation, frame, x, float(edges.mean()), motion,
                         contacts(animation, found), through)
                )  # fmt: skip
                bar.update()
    return shots


def parameters(shots: Sequence[Shot]) -> dict[str, str]:
    """How the animations came about."""
    return {
        "made": MADE, "time between frames [s]": ", ".join(f"{s.animation.dt:g}" for s in shots if s.frame == 0),
        "contacts": "continuous, from each frame to the next, method bvh",
    }  # fmt: skip


def tables(shots: Sequence[Shot]) -> dict[str, Table]:
    """One row per animation and moment."""
    rows = [
        (
            s.experiment, s.listed.number, s.listed.title, s.frame, s.animation.count(cloth=True),
            s.animation.count(cloth=False), 1e3 * s.animation.thickness, 1e3 * s.edge, 1e3 * float(s.motion.mean()),
            1e3 * float(s.motion.max()), s.contacts.cloth, s.contacts.body, s.passing,
        )
        for s in shots
    ]  # fmt: skip
    return {"": Table(COLUMNS, rows)}


def here(shots: Sequence[Shot]) -> str:
    """Contacts at the last moment, and motion."""
    last = [s for s in shots if s.frame == MOMENTS[-1]]
    words = [
        f"{s.listed.title}: {s.animation.count(cloth=True):,} + {s.animation.count(cloth=False):,} triangles, "
        f"{s.contacts.cloth:,} contacts of cloth with cloth, {s.contacts.body:,} with the body, motion "
        f"{float(s.motion.mean()) / s.edge:.2f} edges per frame"
        for s in last
    ]
    return "; ".join(words)


def checks(shots: Sequence[Shot]) -> list[Check]:
    """What makes them fit for the experiments."""
    start = sum(s.passing for s in shots if s.frame == 0)
    last = [s for s in shots if s.frame == MOMENTS[-1]]
    touch = all(min(s.contacts.cloth, s.contacts.body) > 0 for s in last)
    return [
        Check("pairs of triangles that intersect at the start", float(start), 0.0, 0.0, "a simulation starts so"),
        Check.true("cloth touches cloth and body in each", touch,
                   "what the experiments are about"),
        Check.true("motion is coherent", all(float(s.motion.max()) < s.edge for s in shots),
                   "no vertex moves by an edge in a frame; the paper's example has 0.0015 of a cube"),
    ]  # fmt: skip


def draw_titled(shots: Sequence[Shot], title: str) -> bytes:
    """Each animation in a column."""
    note = "By formula, not simulated. Contacts: bvh, continuous."
    columns = [
        [s for s in shots if s.listed is item and s.frame > 0] for item in dict.fromkeys(s.listed for s in shots)
    ]
    figure = pictures.figure(title, (3.6 * len(columns), 0.6 + 3.4 * len(columns[0])), note)
    axes = figure.subplots(len(columns[0]), len(columns), squeeze=False)
    for column, shown in enumerate(columns):
        images = pictures.tiles(_bodies(shown[0].animation), [s.x for s in shown], size=(520, 480))
        for row, (shot, image) in enumerate(zip(shown, images, strict=True)):
            heading = f"{shot.listed.number}: {shot.listed.title}" if row == 0 else ""
            words = f"frame {shot.frame}: contacts {shot.contacts.cloth:,} cloth, {shot.contacts.body:,} body"
            pictures.show(axes[row, column], image, heading, words)
    return pictures.png(figure)


def _bodies(animation: Animation) -> list[Body]:
    return [
        Body(
            part.name, "cloth" if part.cloth else "collider", int(part.vertices.stop - part.vertices.start),
            animation.triangles[part.triangles] - part.vertices.start,
        )
        for part in animation.parts
    ]  # fmt: skip
