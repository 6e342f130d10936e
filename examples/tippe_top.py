"""A spinning top turns over and stands on its stick: friction with drilling, section 10.6."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.tippe_top import inclination


def main(argv=None):
    args = options(__doc__, t_end=8.0, dt=1e-3, argv=argv)
    scene, q0, v0 = robots.load("tippe_top")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    theta = inclination(trajectory.q)
    print(f"largest inclination: {theta.max():.4f} rad at {trajectory.t[theta.argmax()]:.3f} s")
    # the stick touches the ground when the lowest points of both spheres are level
    touched = np.flatnonzero(trajectory.P_N[:, 1] > 0)
    if len(touched):
        compare("the stick touches the ground at", trajectory.t[touched[0]], 1.371044, "s")
        compare("inclination then", theta[touched[0]], np.arccos(-(15e-3 - 5e-3) / (16e-3 - 3e-3)), "rad")
    return trajectory


if __name__ == "__main__":
    main()
