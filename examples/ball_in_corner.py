"""A ball comes to rest between two planes that it touches both, after bouncing on one of them: section 10.2."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=2.0, dt=1e-3, argv=argv)
    scene, q0, v0 = robots.load("ball_in_corner")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    # the bounces accumulate at 1.360845 s, with the centre above the corner
    if trajectory.t[-1] > 1.4:
        moving = np.abs(trajectory.v).max(axis=1) > 1e-3
        compare("time of rest", trajectory.t[moving][-1], 1.360845, "s")
        compare("height of the centre at rest", trajectory.q[-1, 1], 0.1 * np.sqrt(2), "m")
    return trajectory


if __name__ == "__main__":
    main()
