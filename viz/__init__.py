"""What a trajectory looks like: a replay in one HTML file or in a notebook, a figure, a video; a simulation to touch.

Reads a `Trajectory` and nothing from inside the solver. meshcat, matplotlib, viser and ffmpeg are imported when used.
"""

from .animation import animation
from .beam_figure import plot_beams
from .figure import plot
from .notebook import embed
from .page import save_html
from .player import play
from .touch import LiveView, live
from .video import pictures, save_video

__all__ = [
    "LiveView",
    "animation",
    "embed",
    "live",
    "pictures",
    "play",
    "plot",
    "plot_beams",
    "save_html",
    "save_video",
]
