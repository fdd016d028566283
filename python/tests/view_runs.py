"""A small run and a recording made by hand, for the tests of views."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from conftest import SCENE

import clothsim as cs
from clothsim._run.job import Job


def small_run(folder: Path) -> Path:
    """The scene of all tests, run for its 16 frames; its output folder."""
    folder.mkdir(parents=True)
    (folder / "scene.toml").write_text(SCENE)
    Job(cs.Scene.load(folder / "scene.toml"), folder / "out", progress=False).run()
    return folder / "out"


def falling() -> cs.Recording:
    """Two cloths, one above the other and 1 cm apart, z up: they fall 0.1 m a frame; a ball turns and rises."""
    sheet, ball, post = cs.Mesh.grid(1.0, 1.0, 6, 6), cs.Mesh.sphere(0.2, 2), cs.Mesh.box((0.2, 0.2, 0.2))
    lay = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # from y up to z up
    low = sheet.vertices @ lay.T + [0, 0, 1.0]
    bodies = [
        cs.Body("low", "cloth", 36, sheet.triangles, sheet.uv, rest="uv"),
        cs.Body("high </script>", "cloth", 36, sheet.triangles, rest="start"),
        cs.Body("ball", "collider", len(ball.vertices), ball.triangles),
        cs.Body("post", "collider", len(post.vertices), post.triangles, None, True),
    ]
    rows = []
    for k in range(7):
        turn = np.array([[np.cos(0.3 * k), -np.sin(0.3 * k), 0], [np.sin(0.3 * k), np.cos(0.3 * k), 0], [0, 0, 1]])
        fallen = low - [0, 0, 0.1 * k]
        rows.append(np.concatenate([fallen, fallen + [0, 0, 0.01], ball.vertices @ turn.T + [2, 0, 0.05 * k]]))
    return cs.Recording(
        bodies, np.arange(7) / 20, np.array(rows), post.vertices + [0, 0, 0.1], fps=20, up="z", name="<b>fall</b>",
        thickness=0.01,
    )  # fmt: skip


def facts_of(out: Path) -> list[dict[str, float]]:
    found: list[dict[str, float]] = json.loads((out / "report.json").read_text())["frames"]
    return found
