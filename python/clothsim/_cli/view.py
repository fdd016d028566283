"""``clothsim view``."""

from __future__ import annotations

import argparse
import json
import math
import sys
import webbrowser
from pathlib import Path
from typing import Any

from clothsim._cli.arguments import count, folder
from clothsim._export.studio import AZIMUTH, ELEVATION
from clothsim._view.colours import MAPS, colour_map
from clothsim._view.fields import Fields
from clothsim._view.pictures import FILM_SUFFIXES, STILL_SUFFIXES, film_frames, write_film, write_still
from clothsim._view.source import Source
from clothsim._view.stage import Camera
from clothsim.errors import InvalidInput, OutputExists
from clothsim.recording import Recording

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "view"
HELP = (
    "Look at a run, finished or not: in a window, as a still, a film, plots or one HTML page for any browser; coloured "
    "by strain, contact, speed or height."
)
EXAMPLE = (
    "clothsim view out/drape --browser --open; clothsim view out/drape --color strain --still strain.png --frame 100; "
    "clothsim view out/drape --film drape.mp4 --size 1280x720; clothsim view out/drape --plots energy.svg"
)
_PLOT_SUFFIXES = (".png", ".svg", ".pdf")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The run, what is made of it, and how it is shown."""
    parser.add_argument("run", metavar="OUT", type=folder, help="folder of a run (or a frames.npz)")
    made = parser.add_argument_group("what is made (none of these: a window)")
    made.add_argument("--still", metavar="FILE", type=Path, help="picture of one frame: .png, .jpg, .webp")
    made.add_argument(
        "--film", metavar="FILE", type=Path, help="film: .mp4, .gif, or a folder (no suffix) for a PNG per frame"
    )
    made.add_argument("--plots", metavar="FILE", type=Path, help="energy, time and contacts: .png, .svg, .pdf")
    made.add_argument("--browser", action="store_true", help="one HTML page that needs no network")
    made.add_argument("-o", "--out", metavar="PAGE", type=Path, help="where the page goes (default: OUT/view.html)")
    made.add_argument("--open", action="store_true", help="open the page in the system's browser")
    made.add_argument("--overwrite", action="store_true", help="replace files of the same name")
    look = parser.add_argument_group("how it is shown")
    look.add_argument(
        "--color", "--colour", dest="color", metavar="MAP", default="none",
        help=f"colours of the cloth: {', '.join(MAPS)} (default: none)",
    )  # fmt: skip
    look.add_argument("--frame", metavar="N", type=int, help="frame (default: the last of a still; -2: the one before)")
    look.add_argument("--every", metavar="N", type=count, help="one frame in N, of films and pages")
    look.add_argument("--fps", metavar="F", type=_positive, help="pictures per second of a film (default: 30 at most)")
    look.add_argument("--speed", metavar="S", type=_positive, default=1.0, help="seconds of the run in a second")
    look.add_argument("--size", metavar="WxH", type=_size, default=(1280, 800), help="pixels (default: 1280x800)")
    look.add_argument(
        "--azimuth", metavar="DEG", type=_number, default=AZIMUTH, help="camera: from the front to the right"
    )
    look.add_argument("--elevation", metavar="DEG", type=_elevation, default=ELEVATION, help="camera: upwards")
    look.add_argument("--zoom", metavar="Z", type=_positive, default=1.0, help="camera: so much nearer")
    look.add_argument(
        "--thickness", metavar="M", type=_positive,
        help="distance that counts as contact [m] (default: 1.25 times the run's thickness)",
    )  # fmt: skip
    look.add_argument(
        "--limit", metavar="MB", type=_positive, default=40.0, help="largest page; frames are left out for it"
    )
    look.add_argument("-q", "--quiet", action="store_true", help="no progress and no notes on stderr")


def execute(options: argparse.Namespace) -> int:
    """Make what is asked for, or open a window."""
    colour_map(options.color)
    _check(options)
    wants_window = not (options.still or options.film or options.plots or options.browser)
    if wants_window:
        from clothsim._view.window import check_display

        check_display()
    source = Source.of(options.run)
    quiet = options.quiet or options.json
    if not quiet:
        for notice in source.notices:
            print(f"note: {notice}", file=sys.stderr)
    report: dict[str, Any] = {"run": str(options.run), "notices": source.notices, "written": []}
    if options.plots:
        report["written"].append(_plots(source, options))
    if options.still or options.film or options.browser or wants_window:
        recording = source.frames()
        fields = Fields(recording, options.thickness)
        asked = source.frame_number(options.frame)
        frame = asked if asked is not None else 0 if wants_window else len(recording) - 1
        camera = Camera(options.azimuth, options.elevation, options.zoom)
        report |= {"frames": len(recording), "color": options.color}
        if options.still:
            write_still(source, options.still, frame, fields, options.color, camera, options.size)
            report["written"].append({"kind": "still", "path": str(options.still), "frame": frame})
        if options.film:
            report["written"].append(_film(source, recording, fields, camera, options, quiet=quiet))
        if options.browser:
            report["written"].append(_page(source, camera, asked, options, quiet=quiet))
        if wants_window:
            from clothsim._view.window import Window

            Window(source, fields, options.color, camera, options.size, frame=frame, speed=options.speed).show()
    if options.json:
        print(json.dumps(report))
    else:
        for made in report["written"]:
            print(_line(made))
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse, before anything is read, what cannot be written or does not go together."""
    if not options.browser:
        for name, given in (("--out", options.out), ("--open", options.open)):
            if given:
                raise InvalidInput(f"{name}: expected --browser with it, got {name} alone", name=name)
    kinds = (
        ("--still", options.still, STILL_SUFFIXES), ("--film", options.film, FILM_SUFFIXES),
        ("--plots", options.plots, _PLOT_SUFFIXES), ("--out", options.out, (".html", ".htm")),
    )  # fmt: skip
    for name, path, suffixes in kinds:
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            known = ", ".join(s or "no suffix (a folder)" for s in suffixes)
            raise InvalidInput(f"{name}: expected a file ending in {known}, got {path}", name=name)
        if path.exists() and not options.overwrite:
            raise OutputExists(f"{path}: there is something of that name already; --overwrite replaces it")
        if path.is_dir() and path.suffix:
            raise InvalidInput(f"{name}: expected a file, got the folder {path}", name=name)


def _plots(source: Source, options: argparse.Namespace) -> dict[str, Any]:
    if not source.facts:
        raise InvalidInput(f"{options.run}: expected a run with a report for --plots, got one without", name="OUT")
    from clothsim._export import plots

    plots.write(source.facts, options.plots, source.title, effects=source.effects)
    return {"kind": "plots", "path": str(options.plots)}


def _film(
    source: Source, recording: Recording, fields: Fields, camera: Camera, options: argparse.Namespace, *, quiet: bool
) -> dict[str, Any]:
    fps = options.fps or min(recording.fps, 30.0)
    frames = film_frames(recording, fps, options.speed, options.every)
    fps = write_film(
        source, options.film, frames, fps, fields, options.color, camera, options.size,
        overwrite=options.overwrite, progress=not quiet,
    )  # fmt: skip
    return {"kind": "film", "path": str(options.film), "pictures": len(frames), "fps": fps}


def _page(
    source: Source, camera: Camera, frame: int | None, options: argparse.Namespace, *, quiet: bool
) -> dict[str, Any]:
    from clothsim._view import browser

    run: Path = options.run
    path = options.out or (run if run.is_dir() else run.parent) / "view.html"
    page = browser.write(
        source, path, every=options.every, limit=options.limit, colour=options.color, camera=camera, frame=frame,
        thickness=options.thickness, progress=not quiet,
    )  # fmt: skip
    if options.every is None and page.every > 1 and not quiet:
        print(
            f"note: one frame in {page.every}, so that the page is below {options.limit:g} MB (--limit MB, --every N)",
            file=sys.stderr,
        )
    if options.open and not webbrowser.open(path.resolve().as_uri()):
        print(f"clothsim: no browser was found to open {path}", file=sys.stderr)
    return {
        "kind": "page", "path": str(path), "bytes": page.bytes, "frames": page.frames, "every": page.every,
        "precision": page.precision,
    }  # fmt: skip


def _line(made: dict[str, Any]) -> str:
    facts = {"still": "frame {frame}", "film": "{pictures} pictures, {fps:g} per second", "plots": "plots"}
    page = f"{made.get('frames')} frames, {made.get('bytes', 0) / 1e6:.1f} MB; opens in any browser"
    return f"{made['path']}  {facts.get(made['kind'], page).format(**made)}"


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}")
    return value


def _positive(text: str) -> float:
    try:
        value = _number(text)
    except argparse.ArgumentTypeError:
        value = 0.0
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"expected a number > 0, got {text!r}")
    return value


def _elevation(text: str) -> float:
    value = _number(text)
    if not -89.0 <= value <= 89.0:
        raise argparse.ArgumentTypeError(f"expected degrees from -89 to 89, got {text!r}")
    return value


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) == 2 and all(part.isdecimal() for part in parts):
        width, height = int(parts[0]), int(parts[1])
        if 64 <= width <= 7680 and 64 <= height <= 7680:
            return width, height
    raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT from 64 to 7680 pixels, as 1280x800, got {text!r}")
