"""A floor that shakes throws a mass up: a unilateral constraint of one's own, z >= A sin(w t)."""

import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

GRAVITY, AMPLITUDE, RATE = 9.81, 0.05, 20.0


def main(argv=None):
    args = options(__doc__, t_end=0.1, dt=1e-3, argv=argv)
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[2] - AMPLITUDE * np.sin(RATE * t), name="floor"))
    v0 = [0.0, 0.0, AMPLITUDE * RATE]  # that of the floor
    trajectory = nga.simulate(scene, [0.0, 0.0, 0.0], v0, t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    leaves = np.arcsin(GRAVITY / (AMPLITUDE * RATE**2)) / RATE  # where the floor falls away faster than the mass
    if trajectory.t[-1] > leaves:
        s, phase = trajectory.t[-1] - leaves, RATE * leaves
        z = AMPLITUDE * np.sin(phase) + AMPLITUDE * RATE * np.cos(phase) * s - GRAVITY * s**2 / 2
        compare("height of the mass at the end", trajectory.q[-1, 2], z, "m")
    return trajectory


if __name__ == "__main__":
    main()
