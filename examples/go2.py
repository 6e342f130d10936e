"""Unitree Go2 drops 0.1 m, lands on its four feet and stands; PD control holds its joints."""

from common import compare_weight, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=1.5, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("go2", height=0.1, mu=0.8)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    # standing still, the ground carries the weight
    compare_weight(trajectory)
    return trajectory


if __name__ == "__main__":
    main()
