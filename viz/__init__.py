"""What a trajectory looks like: a replay in one HTML file or in a notebook, a live viewer, a figure, a video.

Reads a `Trajectory` and nothing from inside the solver. meshcat, matplotlib and ffmpeg are imported when used.
"""

from .beam_figure import plot_beams
from .figure import plot
from .live import play
from .notebook import embed
from .page import save_html
from .video import pictures, save_video

__all__ = ["embed", "pictures", "play", "plot", "plot_beams", "save_html", "save_video"]
