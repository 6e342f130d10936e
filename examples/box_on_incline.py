"""A box is sent up an incline of 20 degrees: friction stops it, and it stays without creep."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import references, robots


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("box_on_incline", angle=np.radians(20.0), mu=0.5, speed=-1.0)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    q, v = references.box_on_incline(trajectory.t, angle=np.radians(20.0), mu=0.5, speed=-1.0)
    compare("distance at the end", trajectory.q[-1, 0], q[-1, 0], "m")
    compare("speed at the end", trajectory.v[-1, 0], v[-1, 0], "m/s")
    return trajectory


if __name__ == "__main__":
    main()
