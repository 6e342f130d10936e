"""How each system is run unless the options of the command line say otherwise."""

from __future__ import annotations

from typing import NamedTuple


class Defaults(NamedTuple):
    """How a system is run unless the options say otherwise.

    Attributes:
        t_end: end of the run [s].
        dt: step [s].
        rho_inf: parameter of the generalized-alpha method [-].
    """

    t_end: float = 2.0
    dt: float = 1e-3
    rho_inf: float = 0.5


# those of the literature where there are, else long enough to come to rest or to see the motion
DEFAULTS = {
    "andrews": Defaults(0.03, 2e-5, 0.9),
    "anymal": Defaults(1.5, 2e-3),
    "arm": Defaults(3.0, 1e-3, 0.9),
    "ball_in_corner": Defaults(2.0, 1e-3),
    "ball_in_cylinder": Defaults(6.0, 1e-2),
    "balls_in_box": Defaults(1.0, 1e-3),
    "belt": Defaults(2.2, 2e-3, 0.9),
    "box_on_incline": Defaults(1.0, 2e-3),
    "bricard": Defaults(10.0, 1e-2, 0.9),
    "cantilever": Defaults(0.05, 1e-4, 0.8),
    "cradle": Defaults(2.0, 2e-3),
    "four_bar": Defaults(2.0, 2e-3, 0.9),
    "go2": Defaults(1.5, 2e-3),
    "governor": Defaults(10.0, 1e-2),
    "hopper": Defaults(1.0, 5e-5, 0.0),
    "n_four_bar": Defaults(10.0, 5e-3, 0.9),
    "painleve_rod": Defaults(1.2, 8e-4, 0.9),
    "quadruped": Defaults(1.5, 2e-3),
    "rocking_block": Defaults(1.6, 2e-3),
    "rolling_disc": Defaults(3.0, 2e-3, 0.9),
    "rotating_ball": Defaults(1.5, 2e-3),
    "slider_crank": Defaults(1.0, 1e-3, 0.9),
    "solo12": Defaults(1.5, 1e-3),
    "tippe_top": Defaults(8.0, 1e-3),
    "turntable": Defaults(7.33, 5e-3, 0.9),
    "wall": Defaults(0.5, 2e-3),
    "wheel_in_shell": Defaults(2.0, 1e-3, 1.0),
}
