"""Balls fall into a box and come to rest on each other; many contacts at once. `benchmarks/crowd.py` has 64 of them."""

from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=1e-3, argv=argv)
    scene, q0, v0 = robots.load("balls_in_box", side=2, layers=2)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    compare("penetration", trajectory.audit().penetration, 0.0, "m")
    return trajectory


if __name__ == "__main__":
    main()
