"""A run as a video: the page of `save_html`, photographed frame by frame by a headless browser."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.errors import SceneError

from .browser import Browser, find_browser
from .optional import require
from .page import save_html

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

VIDEO_COMMAND = 'pip install "imageio[ffmpeg]"'


def save_video(
    trajectory: Trajectory | Sequence[Trajectory],
    path: str | os.PathLike[str],
    fps: float = 30.0,
    speed: float = 1.0,
    size: tuple[int, int] = (1280, 720),
    labels: Sequence[str] | None = None,
    browser: str | os.PathLike[str] | None = None,
) -> Path:
    """Film a run. It needs Chromium or Chrome, and for .mp4 the package imageio with ffmpeg.

    Args:
        trajectory: a run, or several to show in one scene.
        path: of the file, .mp4 or .gif.
        fps: frames per second of the video [1/s].
        speed: simulated seconds per second of the video [-].
        size: width and height [pixels].
        labels: names of the runs.
        browser: the program; None looks for one.

    Returns:
        The path.

    Raises:
        SceneError: a format or number that cannot be. MissingPackageError: something is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ".gif"):
        raise SceneError(f"save_video writes .mp4 and .gif, not {path.suffix or 'a file without ending'}")
    if not (np.isfinite([fps, speed]).all() and fps > 0 and speed > 0 and min(size) > 0):
        raise SceneError("save_video: fps, speed and size must be positive")
    if path.suffix.lower() == ".mp4":
        require("imageio_ffmpeg", "save_video to .mp4", VIDEO_COMMAND)
    program = find_browser(browser)
    write = _write_mp4 if path.suffix.lower() == ".mp4" else _write_gif
    with tempfile.TemporaryDirectory(prefix="replay-") as folder:
        page = save_html(trajectory, Path(folder) / "replay.html", labels=labels)
        with Browser(*size, path=program) as camera:
            camera.open(page, ready="window.replay", fragment="paused")
            camera.evaluate("document.body.classList.add('filming')")
            start, end = camera.evaluate("[replay.start, replay.end]")
            times = np.minimum(np.arange(start, end + 0.5 * speed / fps, speed / fps), end)
            write(path, camera, times, fps)
    return path


def _picture(camera: Browser, time: float) -> Any:
    """The page at a time [s], as an image of PIL."""
    image = require("PIL.Image", "save_video", "pip install pillow")
    camera.evaluate(f"replay.set_time({float(time)})")
    return image.open(io.BytesIO(camera.screenshot())).convert("RGB")


def _write_mp4(path: Path, camera: Browser, times: np.ndarray, fps: float) -> None:
    imageio = require("imageio.v2", "save_video to .mp4", VIDEO_COMMAND)
    with imageio.get_writer(path, fps=fps, macro_block_size=2, quality=8) as writer:
        for time in times:
            writer.append_data(np.asarray(_picture(camera, time)))


def _write_gif(path: Path, camera: Browser, times: np.ndarray, fps: float) -> None:
    # one palette for all frames, taken from a few of them, or the colours flicker
    some = np.concatenate([np.asarray(_picture(camera, time)) for time in times[:: max(len(times) // 6, 1)]])
    image = require("PIL.Image", "save_video", "pip install pillow")
    palette = image.fromarray(some).quantize(256, method=image.Quantize.FASTOCTREE)  # it keeps rare bright colours
    first, *rest = (_picture(camera, time).quantize(palette=palette, dither=0) for time in times)
    first.save(path, save_all=True, append_images=rest, duration=1000 / fps, loop=0, optimize=False)
