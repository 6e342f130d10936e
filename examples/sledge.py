"""A sledge that is pushed askew: its runners let it slide along, and hardly across, until it stands."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

ALONG, ACROSS, SPEED = 0.05, 0.4, 1.5


def main(argv=None):
    args = options(__doc__, t_end=3.5, dt=5e-3, argv=argv)
    scene = nga.Scene()
    scene.add_plane("ice")
    placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
    scene.add_body("sledge", coal.Box(1.0, 0.4, 0.2), mass=10.0, placement=placement)
    # the axes of the ellipse turn with the sledge; those of skis on a slope of combed snow would stay with the slope
    scene.add_contact("sledge", "ice", mu=nga.FrictionEllipse(ALONG, ACROSS, frame="sledge"))
    v0 = np.array([SPEED, 0.4, 0.0, 0.0, 0.0, 0.5])
    trajectory = nga.simulate(scene, scene.q_ref, v0, t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    # friction takes all that it began with, and lets it slide most of its way along its runners
    if np.abs(trajectory.v[-1]).max() < 1e-9:
        inertia = scene.model.inertias[1]
        energy = trajectory.energy.total
        compare("energy lost", energy[0] - energy[-1], inertia.vtiv(pin.Motion(v0)) / 2, "J")
    return trajectory


if __name__ == "__main__":
    main()
