"""Stills and films of a run, drawn off screen."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim._arrays import optional
from clothsim._files import replacing, whole_folder, write_whole
from clothsim._progress import progress_bar
from clothsim._view.fields import Fields
from clothsim._view.overlay import annotated
from clothsim._view.source import Source
from clothsim._view.stage import Camera, Stage
from clothsim.errors import InvalidInput, OutputError
from clothsim.recording import Recording

__all__ = ["FILM_SUFFIXES", "STILL_SUFFIXES", "film_frames", "write_film", "write_still"]

STILL_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
FILM_SUFFIXES = (".mp4", ".gif", "")  # without a suffix: a folder of PNG files

# Shows of a GIF last whole hundredths of a second, and viewers slow down those below two.
_GIF_FASTEST = 50.0


class _Photographer:
    """A stage with the words that belong on its pictures."""

    def __init__(self, source: Source, fields: Fields, colour: str, camera: Camera, size: tuple[int, int], **how: Any):
        self._recording = source.frames()
        self._title = source.title
        self._fields = fields
        self.stage = Stage(self._recording, fields, colour, camera, size, off_screen=True, **how)

    def __enter__(self) -> _Photographer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stage.close()

    def take(self, frame: int) -> NDArray[np.uint8]:
        """Picture of a frame (height, width, 3)."""
        stage = self.stage
        if stage.frame != frame:
            stage.show(frame)
        colour = stage.colour
        span = stage.span() if colour not in ("none", "contact") else (0.0, 1.0)
        note = f"(within {1e3 * self._fields.reach:.3g} mm)" if colour == "contact" else ""
        time, count = float(self._recording.times[frame]), len(self._recording)
        return annotated(stage.image(), self._title, time, frame, count, colour, span, note)


def write_still(
    source: Source, path: Path, frame: int, fields: Fields, colour: str, camera: Camera, size: tuple[int, int]
) -> None:
    """Draw one frame into a PNG, JPEG or WebP, whole or not at all."""
    images = optional("PIL.Image", extra="view", purpose="writing pictures")
    _check_folder(path)
    with _Photographer(source, fields, colour, camera, size, fine=True, frame=frame) as photographer:
        image = photographer.take(frame)
    buffer = io.BytesIO()
    kind = {".png": "PNG", ".webp": "WEBP"}.get(path.suffix.lower(), "JPEG")
    images.fromarray(image).save(buffer, format=kind, quality=92, optimize=True)
    write_whole(path, buffer.getvalue())


def film_frames(recording: Recording, fps: float, speed: float, every: int | None = None) -> list[int]:
    """Frames of a film: those nearest to its moments t₀ + k·speed/fps, or with ``every`` each so-many-th frame."""
    count = len(recording)
    if every is not None:
        return list(range(0, count, every))
    start, end = float(recording.times[0]), float(recording.times[-1])
    moments = start + np.arange(int((end - start) * fps / speed + 1e-6) + 1) * speed / fps
    after = np.searchsorted(recording.times, moments).clip(1, max(1, count - 1))
    before = after - 1
    later = np.abs(recording.times[np.minimum(after, count - 1)] - moments)
    picked = np.where(np.abs(recording.times[before] - moments) <= later, before, after)
    return [min(int(frame), count - 1) for frame in picked]


def write_film(
    source: Source,
    path: Path,
    frames: list[int],
    fps: float,
    fields: Fields,
    colour: str,
    camera: Camera,
    size: tuple[int, int],
    *,
    overwrite: bool = False,
    progress: bool = True,
) -> float:
    """Draw frames into an MP4 (H.264), a GIF or a folder of PNG files, whole or not at all; return its frame rate.

    Raises
    ------
    MissingDependency
        An MP4 needs ffmpeg, which the package imageio-ffmpeg brings.
    OutputError
        It cannot be written; what was there before is intact.
    """
    images = optional("PIL.Image", extra="view", purpose="writing pictures")
    suffix = path.suffix.lower()
    _check_folder(path)
    if suffix == ".mp4":
        _ffmpeg()
        size = (size[0] - size[0] % 2, size[1] - size[1] % 2)  # H.264 halves its colours
    if suffix == ".gif":
        fps = 100.0 / max(2, round(100.0 / min(fps, _GIF_FASTEST)))
    bar = progress_bar(len(frames), enabled=progress, name=path.name)
    with bar, _Photographer(source, fields, colour, camera, size) as photographer:

        def pictures() -> Iterator[NDArray[np.uint8]]:
            for frame in frames:
                yield photographer.take(frame)
                bar.update()

        if suffix == "":
            _folder(images, path, pictures(), overwrite=overwrite)
        elif suffix == ".gif":
            _gif(images, path, pictures(), fps)
        else:
            _mp4(path, pictures(), size, fps)
    return fps


def _check_folder(path: Path) -> None:
    """Refuse a folder that is not there or cannot be written before anything is drawn."""
    folder = path.absolute().parent
    if not folder.is_dir():
        raise InvalidInput(f"{path}: expected a file in a folder that exists, got {folder}", name="path")
    if not os.access(folder, os.W_OK):
        raise OutputError(13, f"cannot write {path}: no permission to write into {folder}")


def _folder(images: Any, path: Path, pictures: Iterator[NDArray[np.uint8]], *, overwrite: bool) -> None:
    with whole_folder(path, overwrite=overwrite) as part:
        for number, picture in enumerate(pictures):
            images.fromarray(picture).save(part / f"{number:05d}.png")


def _gif(images: Any, path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    """One palette for all pictures would flicker less and look poorer; each has its own."""
    frames = (images.fromarray(picture).quantize(method=images.Quantize.MEDIANCUT, dither=0) for picture in pictures)
    with replacing(path) as part:
        first = next(frames)
        first.save(
            part, format="GIF", save_all=True, append_images=frames, duration=round(1e3 / fps), loop=0, optimize=False
        )  # fmt: skip


def _ffmpeg() -> str:
    """Path of ffmpeg: the system's, else the one that imageio-ffmpeg brings."""
    found = shutil.which("ffmpeg")
    purpose = "writing MP4 films without ffmpeg on the PATH (a .gif or a folder of pictures needs neither)"
    return found or str(optional("imageio_ffmpeg", extra="view", purpose=purpose).get_ffmpeg_exe())


def _mp4(path: Path, pictures: Iterator[NDArray[np.uint8]], size: tuple[int, int], fps: float) -> None:
    # CRF 18: no loss that one sees. faststart: plays in a browser before it is all there.
    command = [
        _ffmpeg(), "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}",
        "-r", f"{fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-crf", "18", "-preset", "medium",
        "-pix_fmt", "yuv420p", "-movflags", "+faststart",
    ]  # fmt: skip
    with replacing(path) as part, tempfile.TemporaryFile() as said:
        # A session of its own: Ctrl-C stops the drawing here, and what ffmpeg has is thrown away.
        process = subprocess.Popen([*command, str(part)], stdin=subprocess.PIPE, stderr=said, start_new_session=True)
        is_whole = False
        try:
            assert process.stdin is not None
            with process.stdin as stdin:
                for picture in pictures:
                    with contextlib.suppress(BrokenPipeError):  # ffmpeg is gone: it says why below
                        stdin.write(np.ascontiguousarray(picture).data)
                    if process.poll() is not None:
                        break
            is_whole = process.wait() == 0
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
        if not is_whole:
            said.seek(0)
            reason = said.read().decode(errors="replace").strip().splitlines() or [
                f"it ended with {process.returncode}"
            ]
            raise OutputError(5, f"cannot write {path}: ffmpeg: {reason[-1]}")
