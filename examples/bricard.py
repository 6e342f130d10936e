"""Bricard's overconstrained mechanism swings: one redundant constraint, and its period from its energy."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=10.0, dt=1e-2, argv=argv)
    scene, q0, v0 = robots.load("bricard")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    v = trajectory.v[:, 0]
    back = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))
    if len(back):  # at rest again
        i = back[-1]
        period = (trajectory.t[i] - v[i] * trajectory.dt / (v[i + 1] - v[i])) / len(back)
        compare("period", period, 4.98630861, "s")
    return trajectory


if __name__ == "__main__":
    main()
