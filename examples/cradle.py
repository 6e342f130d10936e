"""Newton's cradle with small gaps: the angles of the balls against a reference from impact to impact."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import references, robots


def main(argv=None):
    args = options(__doc__, t_end=2.0, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("cradle", gap=2e-3, e_N=0.9)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    q, _ = references.cradle(trajectory.t, gap=2e-3, e_N=0.9)
    compare("angle of the last ball at the end", trajectory.q[-1, -1], q[-1, -1], "rad")
    compare("largest difference of any angle", np.abs(trajectory.q - q).max(), 0.0, "rad")
    return trajectory


if __name__ == "__main__":
    main()
