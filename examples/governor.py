"""A flyball governor with very stiff springs at coarse steps; its angular momentum stays."""

import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def momentum(scene, trajectory, i):
    """Angular momentum about the shaft at one time."""
    data = scene.model.createData()
    return pin.computeCentroidalMomentum(scene.model, data, trajectory.q[i], trajectory.v[i]).angular[2]


def main(argv=None):
    args = options(__doc__, t_end=10.0, dt=1e-2, argv=argv)
    scene, q0, v0 = robots.load("governor")
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    compare("angular momentum at the end", *(momentum(scene, trajectory, i) for i in (-1, 0)), "kg m^2/s")
    return trajectory


if __name__ == "__main__":
    main()
