"""A ball skids over a lawn, rolls, and comes to rest where rolling resistance stops it."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

RADIUS, MU, ARM, SPEED = 0.11, 0.6, 4e-3, 1.0


def main(argv=None):
    args = options(__doc__, t_end=3.0, dt=2e-3, argv=argv)
    scene = nga.Scene()
    scene.add_plane("lawn")
    scene.add_body("ball", coal.Sphere(RADIUS), mass=0.43, placement=pin.SE3(np.eye(3), np.array([0, 0, RADIUS])))
    scene.add_contact("ball", "lawn", mu=MU, rolling_resistance=ARM)
    trajectory = nga.simulate(scene, scene.q_ref, np.array([SPEED, 0, 0, 0, 0, 0]), t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    # slip ends when friction, less the resistance, has turned the ball fast enough
    g = 9.81
    skids = SPEED / (MU * g + 2.5 * (MU - ARM / RADIUS) * g)
    rolls, brakes = SPEED - MU * g * skids, g * ARM / RADIUS / 1.4
    if trajectory.t[-1] > skids + rolls / brakes:
        way = SPEED * skids - MU * g * skids**2 / 2 + rolls**2 / 2 / brakes
        compare("way to the rest", np.linalg.norm(trajectory.q[-1, :2]), way, "m")
    return trajectory


if __name__ == "__main__":
    main()
