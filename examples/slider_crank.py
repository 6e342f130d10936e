"""A slider-crank turns freely under gravity: a URDF tree, closed by a revolute joint."""

from common import compare_energy, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=1e-3, argv=argv)
    scene, q0, v0 = robots.load("slider_crank")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    compare_energy(trajectory)
    return trajectory


if __name__ == "__main__":
    main()
