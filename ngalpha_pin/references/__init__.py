"""Reference motions, independent of the solver: closed forms, and event-driven integration to round-off.

Every function takes the times t (n,) in [s] and returns (q, v), each with one row per time, in the coordinates of the
module of the same name in `ngalpha_pin.robots`. Velocities are right-continuous: at the time of an impact they are
those after it. A reference that ends at an event gives NaN after it.
"""

from .closed_forms import box_on_incline, pendulum
from .cradle import cradle
from .paper import (
    ball_in_corner,
    ball_in_corner_arcs,
    ball_in_cylinder,
    ball_in_cylinder_arcs,
    painleve_rod,
    painleve_slide,
    rotating_ball,
    rotating_ball_arcs,
)
from .rocking import rocking_block
from .rolling import free_rolling_disc, rolling_disc, turntable
from .spinning_body import free_body, tippe_top

__all__ = [
    "ball_in_corner",
    "ball_in_corner_arcs",
    "ball_in_cylinder",
    "ball_in_cylinder_arcs",
    "box_on_incline",
    "cradle",
    "free_body",
    "free_rolling_disc",
    "painleve_rod",
    "painleve_slide",
    "pendulum",
    "rocking_block",
    "rolling_disc",
    "rotating_ball",
    "rotating_ball_arcs",
    "tippe_top",
    "turntable",
]
