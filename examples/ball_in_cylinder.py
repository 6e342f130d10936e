"""A ball slips and rolls inside a tube without sinking into its wall, even with large steps: section 10.3."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=6.0, dt=1e-2, argv=argv)
    scene, q0, v0 = robots.load("ball_in_cylinder")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    # the axis of the tube is at x = 0, z = 1
    distance = np.hypot(trajectory.q[:, 0], trajectory.q[:, 1] - 1.0)
    compare("largest distance of the ball from the axis", distance.max(), 0.9, "m")
    compare("smallest", distance.min(), 0.9, "m")
    return trajectory


if __name__ == "__main__":
    main()
