"""A cantilever is bent by a force and let go; its period beside that of its first mode."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=0.05, dt=1e-4, argv=argv)
    scene, q0, v0 = robots.load("cantilever")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.8))
    show(trajectory, args)

    # the tip passes its position of rest twice in a period
    modes = nga.eigenmodes(scene, scene.q_ref)
    tip = trajectory.q[:, -1] - modes.equilibrium.q[-1]
    i = np.flatnonzero(tip[1:] * tip[:-1] < 0)
    if len(i) > 2:
        passes = trajectory.t[i] + args.dt * tip[i] / (tip[i] - tip[i + 1])
        compare("period", 2 * np.diff(passes).mean(), 1 / modes.frequencies[0], "s")
    return trajectory


if __name__ == "__main__":
    main()
