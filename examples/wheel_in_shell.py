"""A wheel rolls without slip inside a spherical shell along a level circle: its rate against the closed form."""

import numpy as np
from common import compare, compare_energy, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=2.0, dt=1e-3, argv=argv)
    scene, q0, v0 = robots.load("wheel_in_shell", theta=0.2, rho=0.8)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=1.0))
    show(trajectory, args)

    angle = np.unwrap(np.arctan2(trajectory.q[:, 1], trajectory.q[:, 0]))
    compare("rate on the wall", angle[-1] / trajectory.t[-1], robots.rolling_disc.angular_rate(0.2, 0.8), "rad/s")
    compare_energy(trajectory)
    return trajectory


if __name__ == "__main__":
    main()
