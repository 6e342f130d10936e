"""Andrews' squeezing mechanism: seven bodies, three loops, angles at 0.03 s against the published ones."""

from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.andrews import ANGLES, END_ANGLES, END_TIME, in_order


def main(argv=None):
    args = options(__doc__, t_end=0.03, dt=2e-5, argv=argv)
    scene, q0, v0 = robots.load("andrews")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    if len(trajectory.t) > 1 and abs(trajectory.t[-1] - END_TIME) < 1e-9:
        for name, angle, expected in zip(ANGLES, in_order(scene, trajectory.q[-1]), END_ANGLES, strict=True):
            compare(name, angle, expected, "rad")
    return trajectory


if __name__ == "__main__":
    main()
