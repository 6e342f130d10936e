"""A spinning ball falls on a plane, slips, and rolls: the friction of section 10.1."""

import numpy as np
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=1.5, dt=2e-3, argv=argv)
    omega = 50.0
    scene, q0, v0 = robots.load("rotating_ball", omega=omega, e_N=0.0, mu=0.2)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    # it falls 0.9 m, and slips: both percussions are at the border of the friction cone
    impact = np.sqrt(2 * 9.81 * 0.9)
    if trajectory.t[-1] > 0.45:
        compare("normal percussion of the impact", trajectory.La_N.max(), impact, "N s")
        compare("friction percussion of the impact", np.abs(trajectory.La_F).max(), 0.2 * impact, "N s")
    if trajectory.t[-1] > 0.75:
        compare("speed of the rolling ball", trajectory.v[-1, 0], -2 / 7 * 0.1 * omega, "m/s")
    return trajectory


if __name__ == "__main__":
    main()
