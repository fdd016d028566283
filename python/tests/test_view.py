"""``clothsim view``: pictures, films, plots, the window; runs that are not what they should be."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENE, RunCli
from view_runs import falling, small_run

import clothsim as cs
from clothsim import _cli
from clothsim._export.plots import costliest
from clothsim._view.fields import Fields
from clothsim._view.pictures import _ffmpeg, film_frames, write_film, write_still
from clothsim._view.source import Source
from clothsim._view.stage import Camera, Stage
from clothsim._view.window import Window, check_display

SMALL = (240, 160)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_run(tmp_path_factory.mktemp("view") / "run")


@pytest.fixture
def unfinished(tmp_path: Path) -> Path:
    """A run that Ctrl-C stopped on its way."""
    (tmp_path / "scene.toml").write_text(SCENE)
    code = (
        "import os, signal, sys\n"
        "from clothsim import _cli\n"
        "from clothsim._run import frames\n"
        "append = frames.FrameWriter.append\n"
        "def stop(self, *a):\n"
        "    append(self, *a)\n"
        "    if self.frames == 5: os.kill(os.getpid(), signal.SIGINT)\n"
        "frames.FrameWriter.append = stop\n"
        "sys.exit(_cli.main(sys.argv[1:]))\n"
    )
    out = tmp_path / "out"
    command = [sys.executable, "-c", code, "run", str(tmp_path / "scene.toml"), "-o", str(out), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130, done.stderr
    return out


@pytest.fixture
def ffmpeg() -> str:
    try:
        return _ffmpeg()
    except cs.MissingDependency as reason:
        pytest.skip(str(reason))


def cli(*arguments: str | Path) -> int:
    return _cli.main(["view", *map(str, arguments)])


def pixels(path: Path) -> Any:
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def blue(image: Any) -> Any:
    """Where the second cloth is seen."""
    return image[..., 2] > 1.25 * image[..., 0]


# What is made ----------------------------------------------------------------------------------------------------


def test_a_still_shows_its_frame_with_a_colour_bar(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    look = ["--size", "240x160", "--quiet"]
    assert cli(run, "--still", tmp_path / "a.png", "--frame", "0", "--json", *look) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["written"] == [{"kind": "still", "path": str(tmp_path / "a.png"), "frame": 0}]
    assert (report["frames"], report["notices"]) == (16, [])
    assert cli(run, "--still", tmp_path / "b.png", *look) == 0
    assert "frame 15" in capsys.readouterr().out, "the last one by default"
    first, last = pixels(tmp_path / "a.png"), pixels(tmp_path / "b.png")
    assert first.shape == (160, 240, 3)
    red = [(p[..., 0] > 1.4 * p[..., 2]).mean() for p in (first, last)]
    assert min(red) > 0.05, "no cloth"
    assert np.abs(first - last).max() > 100
    for name in ("strain", "contact", "speed", "height"):
        assert cli(run, "--still", tmp_path / f"{name}.png", "--color", name, *look) == 0
    assert blue(pixels(tmp_path / "contact.png"))[40:120].mean() > 0.02, "the ball's contact"
    made = [pixels(tmp_path / f"{name}.png") for name in ("strain", "speed", "height")]
    assert all(np.abs(a - b).max() > 60 for a, b in itertools.pairwise(made))
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".png"] * 6


def test_the_camera_turns_and_nears(tmp_path: Path) -> None:
    source = Source(tmp_path, falling())
    fields = Fields(source.frames())
    seen = []
    for camera in (Camera(), Camera(azimuth=180.0), Camera(elevation=80.0), Camera(zoom=0.5)):
        stage = Stage(source.frames(), fields, "none", camera, SMALL, off_screen=True)
        seen.append(stage.image().astype(int))
        stage.close()
    assert 0.0 < blue(seen[3]).sum() < 0.5 * blue(seen[0]).sum()
    assert blue(seen[2]).sum() > 1.5 * blue(seen[0]).sum()
    assert np.abs(seen[1] - seen[0]).max() > 60


def test_films_read_back(run: Path, tmp_path: Path, ffmpeg: str) -> None:
    from PIL import Image

    look = ["--size", "161x121", "--quiet"]
    assert cli(run, "--film", tmp_path / "a.mp4", "--fps", "10", *look) == 0
    read = [ffmpeg, "-i", str(tmp_path / "a.mp4"), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(read, capture_output=True, check=True)
    about = done.stderr.decode()
    assert all(word in about for word in ("h264", "yuv420p", "160x120", "10 fps")), about
    shown = np.frombuffer(done.stdout, np.uint8).reshape(-1, 120, 160, 3).astype(int)
    assert len(shown) == 6, "half a second, both ends"
    assert np.abs(shown[0] - shown[-1]).max() > 80
    assert cli(run, "--film", tmp_path / "a.gif", "--fps", "30", "--every", "5", *look) == 0
    with Image.open(tmp_path / "a.gif") as gif:
        assert (getattr(gif, "n_frames", 1), gif.info["duration"], gif.size) == (4, 30, (161, 121))
    assert cli(run, "--film", tmp_path / "pictures", "--every", "8", *look) == 0
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == ["00000.png", "00001.png"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gif", "a.mp4", "pictures"]


def test_films_show_the_nearest_frame_of_each_moment() -> None:
    frames = falling()  # 7 frames, 20 a second
    assert film_frames(frames, 20.0, 1.0) == list(range(7))
    assert film_frames(frames, 10.0, 1.0) == [0, 2, 4, 6]
    slow = film_frames(frames, 20.0, 0.5)
    assert (len(slow), slow[::2]) == (13, [0, 1, 2, 3, 4, 5, 6])
    assert film_frames(frames, 20.0, 2.0) == [0, 2, 4, 6]
    assert film_frames(frames, 20.0, 1.0, 4) == [0, 4]
    alone = cs.Recording([frames.bodies[3]], np.zeros(1), np.zeros((1, 0, 3)), np.zeros((8, 3)))
    assert film_frames(alone, 30.0, 1.0) == [0]


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "folder"])
@pytest.mark.parametrize("failure", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_film_that_is_interrupted_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ffmpeg: str, name: str, failure: BaseException
) -> None:
    path = tmp_path / name
    if path.suffix:
        path.write_bytes(b"old")
    else:
        path.mkdir()
        (path / "old").write_bytes(b"old")
    shown = iter([np.zeros((120, 160, 3), np.uint8)] * 2)

    def image(_: Stage) -> Any:
        for picture in shown:
            return picture
        raise failure

    monkeypatch.setattr(Stage, "image", image)
    source = Source(tmp_path, falling())
    fields = Fields(source.frames())
    with pytest.raises((KeyboardInterrupt, cs.OutputError)):
        write_film(
            source, path, [0, 1, 2, 3], 10.0, fields, "none", Camera(), (160, 120), overwrite=True, progress=False
        )
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (path if path.suffix else path / "old").read_bytes() == b"old"


def test_plots_are_pictures_of_the_report(run: Path, tmp_path: Path) -> None:
    assert cli(run, "--plots", tmp_path / "a.png", "--quiet") == 0
    assert pixels(tmp_path / "a.png").std() > 10
    assert cli(run, "--plots", tmp_path / "a.svg", "--quiet") == 0
    text = (tmp_path / "a.svg").read_text()
    assert text.startswith("<?xml")
    assert cli(run, "--plots", tmp_path / "b.svg", "--quiet") == 0
    assert (tmp_path / "b.svg").read_text() == text, "equal runs, equal files"
    report = json.loads((run / "report.json").read_bytes())
    (tmp_path / "only").mkdir()
    (tmp_path / "only" / "report.json").write_text(json.dumps(report))
    assert cli(tmp_path / "only", "--plots", tmp_path / "c.png", "--quiet") == 0, "plots need no frames"


def test_frames_tell_what_each_effect_cost(run: Path) -> None:
    """Over the frames of a run they are what its report says of the whole."""
    report = json.loads((run / "report.json").read_bytes())
    frames = [frame["effects"] for frame in report["frames"]]
    assert not any(frames[0].values()), "the start has no steps"
    assert min(value for frame in frames for value in frame.values()) >= 0.0
    whole = {row["name"]: row["milliseconds"] for row in report["effects"] if row["milliseconds"] is not None}
    assert whole.keys() == frames[-1].keys()
    for name, total in whole.items():
        assert sum(frame.get(name, 0.0) for frame in frames) == pytest.approx(total, rel=1e-9, abs=1e-9), name


def test_the_dearest_effects_have_a_curve_of_their_own() -> None:
    names = [f"effect {k}" for k in range(11)]
    frames = [{"effects": {name: float(k) for k, name in enumerate(names)}} for _ in range(3)]
    found = costliest([{"effects": dict.fromkeys(names, 0.0)}, *frames])
    assert list(found) == [*names[:2:-1], "2 others"], "the one that costs nothing has none"
    assert found["2 others"] == [0.0, 3.0, 3.0, 3.0]
    assert found["effect 10"] == [0.0, 10.0, 10.0, 10.0]
    assert costliest([{"seconds": {}}]) == {}, "runs of an earlier version say nothing of it"


def test_the_window_plays_steps_and_colours(tmp_path: Path) -> None:
    source = Source(tmp_path, falling())
    window = Window(source, Fields(source.frames()), "none", Camera(), SMALL, frame=2, off_screen=True)
    keys = window.stage.plotter.iren._key_press_event_callbacks
    try:
        assert window.stage.frame == 2
        window.step(3)
        assert window.stage.frame == 5
        keys["Home"][0]()
        assert window.stage.frame == 0
        before = window.stage.image().astype(int)
        keys["space"][0]()
        window.tick(window._began[0] + 0.11)  # two frames of 1/20 s
        assert (window.playing, window.stage.frame) == (True, 2)
        assert np.abs(window.stage.image().astype(int) - before).max() > 60
        window.tick(window._began[0] + 9.0)
        assert (window.playing, window.stage.frame) == (False, 6)
        keys["space"][0]()
        assert (window.playing, window.stage.frame) == (True, 0), "from the start again"
        seen = []
        for name in ("strain", "contact", "speed", "height", "none"):
            keys["c"][0]()
            assert window.stage.colour == name
            seen.append(window.stage.image().astype(int))
        assert all(np.abs(a - b).max() > 60 for a, b in itertools.pairwise(seen))
        window._scrub(4.4)
        assert (window.playing, window.stage.frame) == (False, 4)
    finally:
        window.close()


def test_without_a_display_the_other_ways_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    if not sys.platform.startswith("linux"):
        pytest.skip("other systems always have a display")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for display in (None, ":987"):
        monkeypatch.delenv("DISPLAY", raising=False)
        if display is not None:
            monkeypatch.setenv("DISPLAY", display)
        with pytest.raises(cs.InvalidInput, match=r"--still FILE.png, --film FILE.mp4 or --browser"):
            check_display()


# Runs in other states --------------------------------------------------------------------------------------------


def test_an_unfinished_run_shows_what_is_there(unfinished: Path, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted((p, p.stat().st_mtime_ns) for p in unfinished.rglob("*"))
    source = Source.of(unfinished)
    assert source.notices == [f"the run is not finished: 5 frames so far ({source.frames().times[-1]:g} of 0.5 s)"]
    whole = cs.Recording.load(run / "frames.npz")
    part = source.frames()
    assert (len(part), part.thickness, part.bodies[0].rest) == (5, 0.006, "start")
    for body in whole.bodies:
        np.testing.assert_array_equal(part.positions(body.name, 4), whole.positions(body.name, 4))
    assert len(source.facts) == 5
    picture = unfinished.parent / "a.png"
    assert cli(unfinished, "--still", picture, "--size", "160x120") == 0
    assert "note: the run is not finished: 5 frames so far" in capsys.readouterr().err
    assert sorted((p, p.stat().st_mtime_ns) for p in unfinished.rglob("*")) == before, "looking changes nothing"
    # A line that is being written does not count.
    with (unfinished / ".clothsim" / "frames.jsonl").open("ab") as file:
        file.write(b'{"frame": 5, "ti')
    assert len(Source.of(unfinished).frames()) == 5


def test_runs_that_are_not_whole_say_so(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    shutil.copy(run / "frames.npz", copy)
    assert Source.of(copy).notices == ["report.json is missing: no plots"]
    (copy / "report.json").write_text("{")
    assert Source.of(copy).notices == ["report.json cannot be read (JSONDecodeError): no plots"]
    (copy / "report.json").write_text(
        json.dumps({"frames": [], "effects": [], "error": "SimulationDiverged: vertex 3"})
    )
    assert Source.of(copy).notices == ["the run stopped with an error: SimulationDiverged: vertex 3"]
    assert Source.of(copy / "frames.npz").notices == ["only frames: no report, so no plots"]
    (copy / ".clothsim").mkdir()
    (copy / ".clothsim" / "frames.bin").write_bytes(b"")
    assert any("a newer run" in notice for notice in Source.of(copy).notices)
    (copy / "frames.npz").unlink()
    with pytest.raises(cs.InvalidInput, match="got one with output.npz = false"):
        Source.of(copy).frames()


@pytest.mark.parametrize("change", [
    lambda report: report["frames"][3].pop("energy"),
    lambda report: report["frames"][3]["energy"].pop("total"),
    lambda report: report["frames"][3].update(time="late"),
    lambda report: report["frames"][3].update(seconds=None),
    lambda report: report["frames"][3]["contact"].update(collisions="many"),
    lambda report: report["frames"].append(7),
    lambda report: report["frames"][3].update(work={"pins": 1}),
    lambda report: report["frames"][3]["effects"].update(hinge=float("nan")),
    lambda report: report["effects"].append({}),
])  # fmt: skip
def test_a_report_that_is_not_what_it_should_be(run: Path, tmp_path: Path, change: Any) -> None:
    """Stills and pages do without it; plots are refused."""
    copy = tmp_path / "copy"
    copy.mkdir()
    shutil.copy(run / "frames.npz", copy)
    report = json.loads((run / "report.json").read_bytes())
    (copy / "report.json").write_text(json.dumps(report))
    assert Source.of(copy).facts
    change(report)
    (copy / "report.json").write_text(json.dumps(report))
    (notice,) = Source.of(copy).notices
    assert notice.startswith("report.json cannot be read (")
    assert _cli.main(["view", str(copy), "--browser", "-q"]) == 0
    assert _cli.main(["view", str(copy), "--plots", str(copy / "plots.png"), "-q"]) == 2
    assert not (copy / "plots.png").exists()


@pytest.mark.parametrize(("arguments", "code", "message"), [
    (["none"], 2, "none: expected the folder of a run (clothsim run SCENE -o OUT makes one), got nothing of that name"),
    (["empty"], 2, "expected the folder of a run (frames.npz, report.json), got a folder with nothing"),
    (["begun"], 2, "expected a run with a checkpoint or finished, got a run that has just begun"),
    (["scene.toml"], 2, "scene.toml: not a recording that can be read"),
    (["RUN", "--frame", "16"], 2, "--frame: expected a frame from 0 to 15 (or -1, the last), got 16"),
    (["RUN", "--frame", "-17"], 2, "--frame: expected a frame from 0 to 15"),
    (["RUN", "--color", "strian"], 2, 'got \'strian\' (did you mean "strain"?)'),
    (["RUN", "--still", "b.bmp"], 2, "--still: expected a file ending in .png, .jpg, .jpeg, .webp, got b.bmp"),
    (["RUN", "--film", "b.avi"], 2, "--film: expected a file ending in .mp4, .gif, no suffix (a folder), got b.avi"),
    (["RUN", "--still", "there.png"], 2, "there.png: there is something of that name already; --overwrite replaces it"),
    (["RUN", "--still", "no/b.png"], 2, "no/b.png: expected a file in a folder that exists"),
    (["RUN", "--plots", "no/b.png"], 1, "cannot write no/b.png: No such file"),
    (["RUN", "--size", "10x10"], 2, "--size: expected WIDTHxHEIGHT from 64 to 7680 pixels, as 1280x800, got '10x10'"),
    (["RUN", "--fps", "0"], 2, "--fps: expected a number > 0, got '0'"),
    (["RUN", "--elevation", "95"], 2, "--elevation: expected degrees from -89 to 89, got '95'"),
    (["RUN", "--open"], 2, "--open: expected --browser with it, got --open alone"),
    (["RUN", "--browser", "--limit", "0.001"], 2, "makes a page of at most 0.001 MB, got one"),
    (["RUN", "--browser", "-o", "page.txt"], 2, "--out: expected a file ending in .html, .htm, got page.txt"),
    (["bare.npz", "--color", "contact"], 2, "--color contact: expected a run with contact, got one without"),
    (["bare.npz", "--plots", "p.png"], 2, "expected a run with a report for --plots, got one without"),
    (["nothing.npz"], 2, "expected a run with frames, got a recording of none"),
    (["nobody.npz"], 2, "expected a run with bodies, got a recording of none"),
    (["nobody.npz", "--browser"], 2, "expected a run with bodies, got a recording of none"),
    (["afar.npz", "--browser"], 2, "expected coordinates up to 1e+12 m, got 1e+300 m"),
])  # fmt: skip
def test_bad_input_is_named(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    arguments: list[str], code: int, message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    Path("begun/.clothsim").mkdir(parents=True)
    Path("begun/.clothsim/frames.bin").write_bytes(b"")
    Path("scene.toml").write_text("name = 'a'")
    Path("there.png").write_bytes(b"old")
    bodies = [cs.Body("a", "cloth", 3, np.array([[0, 1, 2]]))]
    cs.Recording(bodies, np.zeros(1), np.eye(3)[None]).save("bare.npz")
    cs.Recording(bodies, np.zeros(0), np.zeros((0, 3, 3))).save("nothing.npz")
    cs.Recording([], np.zeros(1), np.zeros((1, 0, 3))).save("nobody.npz")
    cs.Recording(bodies, np.zeros(1), 1e300 * np.eye(3)[None]).save("afar.npz")
    before = sorted(tmp_path.rglob("*"))
    words = [str(run) if word == "RUN" else word for word in arguments]
    makes = {"--still", "--film", "--plots", "--browser", "--open"}
    try:
        got = _cli.main(["view", *words, *([] if makes & set(words) else ["--still", "x.png"]), "-q"])
    except SystemExit as stop:
        got = int(str(stop.code))
    said = capsys.readouterr().err
    assert (got, message in said) == (code, True), said
    assert "Traceback" not in said
    assert sorted(tmp_path.rglob("*")) == before
    assert Path("there.png").read_bytes() == b"old"


def test_a_folder_that_cannot_be_written_is_named(run: Path, tmp_path: Path) -> None:
    if os.geteuid() == 0:
        place = Path("/proc/self")  # nobody may write there
    else:
        place = tmp_path / "closed"
        place.mkdir(mode=0o500)
    with pytest.raises(cs.ClothSimError, match="cannot write"):
        source = Source.of(run)
        write_still(source, place / "a.png", 0, Fields(source.frames()), "none", Camera(), (64, 64))


@pytest.mark.parametrize(("package", "arguments"), [
    ("pyvista", ["--still", "a.png"]), ("imageio_ffmpeg", ["--film", "a.mp4"]),
    ("matplotlib.figure", ["--plots", "a.pdf"]),
])  # fmt: skip
def test_a_missing_package_is_named(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    package: str, arguments: list[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))  # no ffmpeg of the system
    monkeypatch.setitem(sys.modules, package, None)
    assert cli(run, *arguments) == 2
    said = capsys.readouterr().err
    assert "needs the package" in said
    assert "pip install 'clothsim[" in said
    assert list(tmp_path.iterdir()) == []


def test_help_has_examples(run_cli: RunCli) -> None:
    done = run_cli("view", "--help")
    assert "clothsim view out/drape --browser --open" in " ".join(done.stdout.split())
