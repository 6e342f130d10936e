"""A block on a moving belt, held by a spring, sticks and slips in turn."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=2.2, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("belt")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    # it starts to slip at mu m g = stiffness x; the closed form of the period is in the tests
    x = trajectory.q[:, 1] - 0.4 * 9.81 / 100.0
    before = np.flatnonzero((x[:-1] <= 0.0) & (x[1:] > 0.0))
    starts = trajectory.t[before] - x[before] / trajectory.v[before, 1]
    if len(starts) > 1:
        compare("period", starts[-1] - starts[-2], 0.6736837, "s")
    return trajectory


if __name__ == "__main__":
    main()
