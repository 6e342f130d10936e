"""Two four-bars in a row fall through their flat positions and go on as parallelograms."""

import numpy as np
from common import compare, compare_energy, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=10.0, dt=5e-3, argv=argv)
    scene, q0, v0 = robots.load("n_four_bar")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    show(trajectory, args)

    compare_energy(trajectory)
    up = trajectory.q[:, [scene.model.idx_qs[scene.model.getJointId(name)] for name in ("up0", "up1", "up2")]]
    compare("largest angle between uprights", np.ptp(up, axis=1).max(), 0.0, "rad")
    return trajectory


if __name__ == "__main__":
    main()
