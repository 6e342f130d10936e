"""A rod slides on its tip until friction throws it off the ground, though nothing collides: section 10.4."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=1.2, dt=8e-4, argv=argv)
    scene, q0, v0 = robots.load("painleve_rod")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    # the normal force blows up where sliding lets the tip accelerate without any force
    if trajectory.t[-1] > 0.85:
        blow_up = trajectory.t[np.argmax(trajectory.P_N[:, 0])]
        compare("time of the blow-up", blow_up, 0.8145497, "s")
    return trajectory


if __name__ == "__main__":
    main()
