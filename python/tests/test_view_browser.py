"""The page for the browser: what is in it, and what headless Chromium shows of it."""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Browser, Tab
from numpy.typing import NDArray
from view_runs import facts_of, falling, small_run

import clothsim as cs
from clothsim import _cli
from clothsim._view import browser as pages
from clothsim._view.pack import restored
from clothsim._view.source import Source

# What no control covers in a window of 800 × 500.
VIEW = np.s_[80:410, :480]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = small_run(tmp_path_factory.mktemp("browser") / "run")
    assert _cli.main(["view", str(out), "--browser", "--quiet"]) == 0
    return out


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    started = Browser(tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


@pytest.fixture(autouse=True)
def one_tab(request: pytest.FixtureRequest) -> Iterator[None]:
    """Pages that are drawn in the background cost time."""
    yield
    if "chromium" in request.fixturenames:
        request.getfixturevalue("chromium").close_tabs()


def parts(page: Path) -> tuple[dict[str, Any], bytes]:
    """Header and data of a page."""
    text = page.read_text(encoding="utf-8")
    header = re.search(r'id="header">(.*?)</script>', text, re.S)
    data = re.search(r'id="data">(.*?)</script>', text, re.S)
    assert header is not None
    assert data is not None
    return json.loads(header[1]), zlib.decompress(base64.b64decode(data[1]))


def positions(entry: dict[str, Any], raw: bytes) -> NDArray[np.float64]:
    place = entry["positions"]
    planes = np.frombuffer(raw, np.uint8, place["bytes"], place["at"])
    numbers = restored(planes.reshape(entry["count"], 3, 2, entry["vertices"]))
    return np.asarray(numbers * entry["step"] + np.array(entry["low"]))


# The file ----------------------------------------------------------------------------------------------------------


def test_the_page_holds_the_frames_to_its_precision(run: Path) -> None:
    header, raw = parts(run / "view.html")
    frames = cs.Recording.load(run / "frames.npz")
    assert header["raw"] == len(raw)
    assert header["times"] == pytest.approx(frames.times.tolist())
    cloth, ball = header["bodies"]
    assert (cloth["name"], cloth["kind"], ball["name"], ball["count"]) == ("cloth", "cloth", "ball", 1)
    got = positions(cloth, raw)
    for frame in range(16):
        error = np.abs(got[frame] - frames.positions("cloth", frame)).max()
        assert error <= 0.5 * cloth["step"] * (1 + 1e-9)
    assert cloth["step"] < 2e-4, "a 400th of an edge of 6 cm"
    # The ball turns: its first positions, and a matrix per frame.
    motion = np.frombuffer(raw, "<f4", 12 * 16, ball["motion"]["at"]).reshape(16, 4, 3).astype(float)
    turned = positions(ball, raw)[0] @ motion[15, :3] + motion[15, 3]
    assert np.abs(turned - frames.positions("ball", 15)).max() < ball["step"] + 1e-6
    total = header["plots"][0]["series"][0]["values"]
    facts: list[Any] = facts_of(run)
    assert total[-1] == pytest.approx(facts[-1]["energy"]["total"] - facts[0]["energy"]["total"], rel=1e-4)
    costs = next(plot for plot in header["plots"] if plot["title"] == "Cost of each effect")
    contact = next(series for series in costs["series"] if series["label"] == "contact")
    assert contact["values"] == pytest.approx([f["effects"].get("contact", 0.0) for f in facts], rel=1e-4)


def test_the_page_needs_nothing_else(run: Path, tmp_path: Path) -> None:
    text = (run / "view.html").read_text(encoding="utf-8")
    code = text.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert not re.search(r"https?://|\bfetch\(|XMLHttpRequest|\bimport\b.*from|src=|@import", code)
    # Names in a scene cannot become code.
    pages.write(Source(tmp_path, falling()), tmp_path / "a.html", progress=False)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert html.escape("<b>fall</b>") in text
    assert "<b>fall" not in text
    assert text.count("</script>") == 3
    assert parts(tmp_path / "a.html")[0]["bodies"][1]["name"] == "high </script>"


def test_frames_are_thinned_for_the_limit(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = (run / "view.html").stat().st_size
    limit = 0.9 * whole / 1e6
    out = tmp_path / "a.html"
    assert _cli.main(["view", str(run), "--browser", "-o", str(out), "--limit", f"{limit:.6f}"]) == 0
    assert "note: one frame in 2, so that the page is below" in capsys.readouterr().err
    assert out.stat().st_size <= limit * 1e6
    header, _ = parts(out)
    assert header["numbers"] == [0, 2, 4, 6, 8, 10, 12, 14, 15]
    assert (header["total"], len(header["plots"][0]["series"][0]["values"])) == (16, 9)
    small = ["view", str(run), "--browser", "-o", str(tmp_path / "b.html"), "--every", "1", "--limit", f"{limit:.6f}"]
    assert _cli.main(small) == 2
    assert re.search(r"got one of 0 MB: --every 2, or --limit MB allows more", capsys.readouterr().err)
    report = ["view", str(run), "--browser", "--every", "3", "--json"]
    assert _cli.main(report) == 0
    made = json.loads(capsys.readouterr().out)["written"][0]
    assert (made["kind"], made["frames"], made["every"]) == ("page", 6, 3)
    assert made["bytes"] == (run / "view.html").stat().st_size
    assert _cli.main(["view", str(run), "--browser", "--quiet"]) == 0


# In Chromium -------------------------------------------------------------------------------------------------------


def red(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Where the first cloth is seen, its front or its back: both are red or brown."""
    return np.asarray(picture[..., 0] > 1.3 * picture[..., 2])


def outline(tab: Tab, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of points [m] in the window [px]."""
    return np.array(tab.run(f"{points.tolist()}.map((p) => clothsim.project(p))"))


def test_chromium_shows_the_cloth_where_it_is(run: Path, chromium: Browser, tmp_path: Path) -> None:
    frames = cs.Recording.load(run / "frames.npz")
    tab = chromium.open(run / "view.html", "frame=0&panel=off")
    assert tab.run("document.documentElement.dataset.state") == "ready"
    shown = []
    for frame in (0, 15):
        tab.run(f"location.hash = '#frame={frame}&panel=off'")
        tab.wait(f"clothsim.frame === {frame}")
        picture = tab.screenshot(tmp_path / f"{frame}.png")
        shown.append(picture)
        assert picture.std() > 15, "an empty page"
        scene = red(picture)
        scene[:70], scene[420:] = False, False  # the words above and the controls below
        rows, columns = np.nonzero(scene)
        expected = outline(tab, frames.positions("cloth", frame))
        for got, places in ((columns, expected[:, 0]), (rows, expected[:, 1])):
            # Two pixels: the width of a drawn edge; and the far side may be hidden behind what is nearer.
            assert got.min() == pytest.approx(places.min(), abs=3)
        assert columns.max() == pytest.approx(expected[:, 0].max(), abs=3)
    assert np.abs(shown[1] - shown[0])[VIEW].max() > 60, "another frame is another picture"
    assert tab.complaints() == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in tab.requests())


def test_controls_do_what_they_say(run: Path, chromium: Browser) -> None:
    tab = chromium.open(run / "view.html", "frame=4")
    assert tab.run("clothsim.frame") == 4
    tab.key("ArrowRight")
    assert tab.run("clothsim.frame") == 5
    tab.key("End")
    assert tab.run("document.getElementById('frame').textContent") == "frame 15 / 15"
    assert tab.run("document.getElementById('time').textContent") == "0.500 s"
    assert tab.run("document.getElementById('scrub').getAttribute('aria-valuetext')") == "frame 15 of 15, 0.500 seconds"
    tab.key(" ")  # from the end: plays from the start
    tab.wait("clothsim.playing && clothsim.frame > 0")
    assert tab.run("document.getElementById('play').getAttribute('aria-label')") == "Pause"
    tab.key(" ")
    assert tab.run("clothsim.playing") is False
    tab.key("Home")
    pictures = {}
    for name in ("strain", "contact", "speed", "height", "none"):
        tab.key("c")
        assert tab.run("document.getElementById('colour').value") == name
        assert bool(tab.run("document.getElementById('legend').textContent")) == (name != "none")
        tab.run("clothsim.setFrame(12)")
        pictures[name] = tab.screenshot()
    legend = "document.getElementById('legend').textContent"
    tab.run("clothsim.setMap('strain')")
    assert tab.run(legend).replace("against", " %").split("%")[0].strip().startswith("0")
    tab.run("clothsim.setMap('contact')")
    assert "on a collider" in tab.run(legend)
    assert "7.5 mm" in tab.run(legend)
    views = [picture[VIEW] for picture in pictures.values()]
    assert all(np.abs(a - b).max() > 50 for k, a in enumerate(views) for b in views[:k])
    # Turning, zooming and hiding.
    before = tab.screenshot()[VIEW]
    tab.mouse("mousePressed", 200, 250, button="left", buttons=1, clickCount=1)
    tab.mouse("mouseMoved", 300, 270, button="left", buttons=1)
    tab.mouse("mouseReleased", 300, 270, button="left", clickCount=1)
    turned = tab.screenshot()[VIEW]
    tab.mouse("mouseWheel", 200, 250, deltaX=0, deltaY=400)
    away = tab.screenshot()[VIEW]
    tab.key("h")
    tab.run("document.querySelector('#bodies input').click()")
    hidden = tab.screenshot()[VIEW]
    for one, other in ((before, turned), (turned, away), (before, hidden)):
        assert np.abs(one - other).max() > 50
    tab.run("clothsim.setMap('none')")
    assert red(tab.screenshot()[VIEW]).sum() == 0, "the cloth is hidden"
    # Every control has a name, every picture a description.
    nameless = tab.run(
        "[...document.querySelectorAll('button, select, input, canvas')].filter((e) => !(e.getAttribute('aria-label')"
        " || e.labels?.length || e.textContent.trim())).length"
    )
    assert nameless == 0
    assert tab.complaints() == []


def test_light_dark_small_windows_and_meshes(run: Path, chromium: Browser) -> None:
    light_tab = chromium.open(run / "view.html", "frame=9&color=contact")
    light = light_tab.screenshot()
    light_tab.close()
    dark_tab = chromium.open(run / "view.html", "frame=9&color=contact", dark=True)
    dark = dark_tab.screenshot()
    assert light[250, 5].mean() > 200
    assert dark[250, 5].mean() < 60
    dark_tab.key("t")
    assert dark_tab.screenshot()[250, 5].mean() > 200
    plain = dark_tab.screenshot()
    dark_tab.key("e")
    assert np.abs(dark_tab.screenshot() - plain)[VIEW].max() > 20, "the mesh's edges"
    assert dark_tab.complaints() == []
    dark_tab.close()
    small = chromium.open(run / "view.html", "frame=9", (400, 700))
    assert small.run("document.getElementById('panel').hidden") is True
    assert small.run("document.documentElement.scrollWidth") <= 400
    assert red(small.screenshot())[120:600].mean() > 0.02
    assert small.complaints() == []


def test_two_cloths_z_up_and_names_of_any_kind(tmp_path: Path, chromium: Browser) -> None:
    frames = falling()
    pages.write(Source(tmp_path, frames), tmp_path / "a.html", progress=False, colour="contact")
    tab = chromium.open(tmp_path / "a.html", "frame=5")
    assert tab.run("document.getElementById('title').textContent") == "<b>fall</b>"
    assert tab.run("clothsim.bodies.map((b) => b.name)") == [b.name for b in frames.bodies]
    for body in frames.bodies:  # the motion of the ball, too
        got = np.array(tab.run(f"Array.from(clothsim.bodies[{frames.bodies.index(body)}].x)")).reshape(-1, 3)
        assert np.abs(got - frames.positions(body, 5)).max() < 4e-4, body.name
    up, down = outline(tab, np.array([[0.0, 0, 1], [0, 0, 0]]))
    assert up[1] < down[1] - 40, "z is up"
    assert tab.run("document.getElementById('plots-part').hidden") is True, "no report, no plots"
    assert tab.complaints() == []


def test_a_damaged_page_says_so(run: Path, chromium: Browser, tmp_path: Path) -> None:
    text = (run / "view.html").read_text(encoding="utf-8")
    at = text.index('id="data">') + 2000
    (tmp_path / "cut.html").write_text(text[:at] + text[at + 4000 :], encoding="utf-8")
    tab = chromium.open(tmp_path / "cut.html")
    assert tab.run("document.documentElement.dataset.state") == "failed"
    assert tab.run("document.getElementById('failure').hidden") is False
    assert tab.run("document.getElementById('failure').textContent")
    assert tab.complaints() != [], "and the check of the other tests would have seen it"
