"""A guided hopper with a beam as its shin lands, bounces and slips: section 10.5."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.hopper import MASS


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=5e-5, argv=argv)
    scene, q0, v0 = robots.load("hopper")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.0))
    show(trajectory, args)

    landed = np.flatnonzero(trajectory.P_N[:, 0] > 0)
    if len(landed):
        compare("first touch-down", trajectory.t[landed[0]], 0.12622, "s")
        upwards = np.concatenate(([1.0, 0.0], np.tile([0.0, 1.0], (len(v0) - 2) // 2)))
        momentum = upwards @ trajectory.system.mass_matrix(trajectory.q[-1]) @ trajectory.v[-1]
        gained = momentum + MASS * 9.81 * trajectory.t[-1]
        compare("percussions of the ground", trajectory.P_N.sum(), gained, "N s")
    return trajectory


if __name__ == "__main__":
    main()
