"""A slender block rocks from corner to corner: the angle that each impact leaves, against Housner's reference."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import references, robots


def main(argv=None):
    args = options(__doc__, t_end=1.6, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("rocking_block", tilt=0.15)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    q, v = references.rocking_block(trajectory.t, tilt=0.15)
    compare("angle at the end", trajectory.q[-1, 2], q[-1, 2], "rad")
    compare("largest distance of the centre", np.abs(trajectory.q[:, :2] - q[:, :2]).max(), 0.0, "m")
    return trajectory


if __name__ == "__main__":
    main()
