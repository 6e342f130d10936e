"""A run as a video: the page of `save_html`, photographed frame by frame by a headless browser."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.common.files import replacing
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import SceneError

from .browser import Browser, find_browser
from .page import save_html

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

VIDEO_COMMAND = "pip install imageio-ffmpeg"


def save_video(
    trajectory: Trajectory | Sequence[Trajectory],
    path: str | os.PathLike[str],
    fps: float = 30.0,
    speed: float = 1.0,
    size: tuple[int, int] = (1280, 720),
    labels: Sequence[str] | None = None,
    browser: str | os.PathLike[str] | None = None,
) -> Path:
    """Film a run. It needs Chromium or Chrome, and for .mp4 ffmpeg or the package imageio-ffmpeg.

    Args:
        trajectory: a run, or several to show in one scene.
        path: of the file, .mp4 or .gif.
        fps: frames per second of the video [1/s].
        speed: simulated seconds per second of the video [-].
        size: width and height [pixels]; .mp4 takes the next even numbers.
        labels: names of the runs.
        browser: the program; None looks for one.

    Returns:
        The path.

    Raises:
        SceneError: a format or number that cannot be. MissingPackageError: something is not installed.
        OSError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ".gif"):
        raise SceneError(f"save_video writes .mp4 and .gif, not {path.suffix or 'a file without ending'}")
    if not (np.isfinite([fps, speed]).all() and fps > 0 and speed > 0 and min(size) > 0):
        raise SceneError("save_video: fps, speed and size must be positive")
    if path.suffix.lower() == ".mp4":
        find_ffmpeg()
        size = (size[0] + size[0] % 2, size[1] + size[1] % 2)
    program = find_browser(browser)
    write = _write_mp4 if path.suffix.lower() == ".mp4" else _write_gif
    with _camera(trajectory, size, labels, program) as camera:
        start, end = camera.evaluate("[replay.start, replay.end]")
        times = np.minimum(np.arange(start, end + 0.5 * speed / fps, speed / fps), end)
        with replacing(path) as beside:
            write(beside, camera, times, fps)
    return path


def pictures(
    trajectory: Trajectory,
    times: Sequence[float] | np.ndarray,
    size: tuple[int, int] = (1280, 720),
    browser: str | os.PathLike[str] | None = None,
) -> list[np.ndarray]:
    """Pictures of a run, each of shape (height, width, 3), bytes. It needs Chromium or Chrome.

    Args:
        trajectory: a run.
        times: of the pictures [s].
        size: width and height [pixels].
        browser: the program; None looks for one.

    Raises:
        MissingPackageError: something is not installed.
    """
    with _camera(trajectory, size, None, find_browser(browser)) as camera:
        return [np.asarray(_picture(camera, time)) for time in times]


@contextmanager
def _camera(
    trajectory: Trajectory | Sequence[Trajectory], size: tuple[int, int], labels: Sequence[str] | None, program: str
) -> Iterator[Browser]:
    """A browser that shows the page of a run, without what is around the scene."""
    with tempfile.TemporaryDirectory(prefix="replay-") as folder:
        page = save_html(trajectory, Path(folder) / "replay.html", labels=labels)
        with Browser(*size, path=program) as camera:
            camera.open(page, ready="window.replay", fragment="paused")
            camera.evaluate("document.body.classList.add('filming')")
            yield camera


def find_ffmpeg() -> str:
    """The program that encodes .mp4: the one on the PATH, or that of the package imageio-ffmpeg.

    Raises:
        MissingPackageError: there is none.
    """
    return shutil.which("ffmpeg") or require("imageio_ffmpeg", "save_video to .mp4", VIDEO_COMMAND).get_ffmpeg_exe()


def _picture(camera: Browser, time: float) -> Any:
    """The page at a time [s], as an image of PIL."""
    image = require("PIL.Image", "save_video", "pip install pillow")
    camera.evaluate(f"replay.set_time({float(time)})")
    return image.open(io.BytesIO(camera.screenshot())).convert("RGB")


def _write_mp4(path: Path, camera: Browser, times: np.ndarray, fps: float) -> None:
    first = _picture(camera, times[0])
    form = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{first.width}x{first.height}", "-r", f"{fps:g}", "-i", "-"]
    code = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart", str(path)]
    command = [find_ffmpeg(), "-y", "-loglevel", "error", *form, *code]
    # what it has to say goes to a file: a pipe that nobody reads could fill up
    with tempfile.TemporaryFile() as said, subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said) as encoder:
        assert encoder.stdin is not None
        with suppress(BrokenPipeError):
            for time in times:
                encoder.stdin.write(_picture(camera, time).tobytes())
            encoder.stdin.close()
        if encoder.wait() != 0:
            said.seek(0)
            raise OSError(f"{path}: ffmpeg says {' '.join(said.read().decode(errors='replace').split())}")


def _write_gif(path: Path, camera: Browser, times: np.ndarray, fps: float) -> None:
    # one palette for all frames, taken from a few of them, or the colours flicker
    some = np.concatenate([np.asarray(_picture(camera, time)) for time in times[:: max(len(times) // 6, 1)]])
    image = require("PIL.Image", "save_video", "pip install pillow")
    palette = image.fromarray(some).quantize(256, method=image.Quantize.FASTOCTREE)  # it keeps rare bright colours
    first, *rest = (_picture(camera, time).quantize(palette=palette, dither=0) for time in times)
    first.save(path, save_all=True, append_images=rest, duration=1000 / fps, loop=0, optimize=False)
