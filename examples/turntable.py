"""A ball rolls on a turning table and runs a circle with 2/7 of the rate of the table."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=7.33, dt=5e-3, argv=argv)
    scene, q0, v0 = robots.load("turntable", rate=3.0, speed=0.1, x=0.15)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    radius, rate = robots.turntable.circle(rate=3.0, speed=0.1)
    from_centre = trajectory.q[:, :2] - [0.15 - radius, 0.0]
    angle = np.unwrap(np.arctan2(from_centre[:, 1], from_centre[:, 0]))
    compare("radius of the circle", np.hypot(*from_centre[-1]), radius, "m")
    compare("rate of the ball", angle[-1] / trajectory.t[-1], rate, "rad/s")
    return trajectory


if __name__ == "__main__":
    main()
