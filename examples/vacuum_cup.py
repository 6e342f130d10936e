"""A vacuum cup lifts a box faster and faster, until it is too fast for the force that it holds, and loses it."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

MASS, FORCE, JERK = 1.0, 20.0, 25.0


def main(argv=None):
    args = options(__doc__, t_end=0.6, dt=2e-3, argv=argv)
    model = pin.Model()
    for name in ("arm", "box"):
        joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(MASS, 0.05), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("floor")
    scene.add_geometry("bottom", coal.Sphere(0.05), parent="box", placement=pin.SE3(np.eye(3), np.array([0, 0, 0.05])))
    scene.add_geometry("lid", coal.Halfspace(0, 0, 1, 0.1), parent="box")
    scene.add_geometry("cup", coal.Sphere(0.02), parent="arm", placement=pin.SE3(np.eye(3), np.array([0, 0, 0.12])))
    scene.add_contact("bottom", "floor")
    scene.add_contact("cup", "lid", adhesion=FORCE)
    scene.add_constraint(nga.JointTrajectory("arm", lambda t: (JERK * t**3 / 6, JERK * t**2 / 2, JERK * t)))
    trajectory = nga.simulate(scene, np.zeros(2), t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    lost = (FORCE / MASS - 9.81) / JERK  # weight and inertia are the force of the cup
    if trajectory.t[-1] > lost:
        flight = trajectory.t[-1] - lost
        z = JERK * lost**3 / 6 + JERK * lost**2 / 2 * flight - 9.81 * flight**2 / 2
        compare("height of the box at the end", trajectory.q[-1, 1], z, "m")
    return trajectory


if __name__ == "__main__":
    main()
