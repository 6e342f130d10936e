"""A wall of boxes stands; with `robots.load("wall", speed=5.0)` a ball flies at it."""

from common import compare, options, show

import ngalpha_pin as nga
from ngalpha_pin import robots


def main(argv=None):
    args = options(__doc__, t_end=0.5, dt=2e-3, argv=argv)
    scene, q0, v0 = robots.load("wall", rows=3, columns=3)
    trajectory = nga.simulate(scene, q0, v0, t_end=args.t_end, dt=args.dt, method=nga.GeneralizedAlpha(rho_inf=0.5))
    show(trajectory, args)

    on_floor = [i for i, name in enumerate(trajectory.contact_names) if "floor" in name]
    weight = 9.81 * sum(inertia.mass for inertia in scene.model.inertias)
    compare("force on the floor", float(trajectory.la_N[-1][on_floor].sum()), weight, "N")
    return trajectory


if __name__ == "__main__":
    main()
