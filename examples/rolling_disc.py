"""A disc rolls on a plane without slip in steady precession: the rate against its closed form, and no drift."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=3.0, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("rolling_disc", theta=1.0, rho=0.5)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    angle = np.unwrap(np.arctan2(trajectory.q[:, 1], trajectory.q[:, 0]))
    compare("rate of precession", angle[-1] / trajectory.t[-1], robots.rolling_disc.angular_rate(1.0, 0.5), "rad/s")
    compare("largest slip velocity", np.abs(trajectory.constraint_motion.rate).max(), 0.0, "m/s")
    return trajectory


if __name__ == "__main__":
    main()
