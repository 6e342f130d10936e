"""A run as an animation of meshcat's own, for pages that embed its viewer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pinocchio as pin

from ngalpha_pin.common.optional import require

from .frames import FPS, sample
from .player import ROOT

if TYPE_CHECKING:
    import meshcat

    from ngalpha_pin import Trajectory


def animation(
    trajectory: Trajectory, viewer: meshcat.Visualizer, fps: float = FPS, root: str = ROOT
) -> meshcat.animation.Animation:
    """The motion of the bodies under their names in the viewer, which `play` has given: `viewer[root]["joint3"]`.

    Show it by `viewer.set_animation(animation)`; `viewer.static_html()` then is a page with meshcat's own controls. Its
    `lower()` is the content of the command "set_animation" of meshcat's protocol.

    Args:
        trajectory: any run.
        viewer: with the bodies.
        fps: frames per second of simulated time [1/s].
        root: path of the bodies in it.

    Raises:
        MissingPackageError: meshcat is not installed.
    """
    module = require("meshcat.animation", "animation", "pip install meshcat")
    found, frames = module.Animation(default_framerate=fps), sample(trajectory, fps)
    for t, poses in zip(frames.t - frames.t[0], frames.pose, strict=True):
        with found.at_frame(viewer[root], t * fps) as frame:
            for j, pose in enumerate(poses[1:], start=1):
                frame[f"joint{j}"].set_transform(pin.XYZQUATToSE3(pose).homogeneous)
    return found
