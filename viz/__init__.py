"""What a trajectory looks like: a replay in one HTML file, a live viewer, a figure, a video.

Reads a `Trajectory` and nothing from inside the solver. meshcat, matplotlib and imageio are imported when used.
"""

from .figure import plot
from .live import play
from .page import save_html
from .video import save_video

__all__ = ["play", "plot", "save_html", "save_video"]
