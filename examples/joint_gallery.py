"""Every joint between frames, side by side: a body on a post, thrown, and held by one kind of constraint each."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

JOINTS = {
    "ball": lambda post, body: nga.PointJoint(post, body),
    "weld": lambda post, body: nga.Weld(post, body),
    "hinge": lambda post, body: nga.RevoluteJoint(post, body, axis=(0, 1, 0)),
    "cross": lambda post, body: nga.UniversalJoint(post, body),
    "slider": lambda post, body: nga.PrismaticJoint(post, body, axis=(1, 0, 0)),
    "sleeve": lambda post, body: nga.CylindricalJoint(post, body, axis=(1, 0, 0)),
    "table": lambda post, body: nga.PlanarJoint(post, body),
    "rod": lambda post, body: nga.Distance(post, body, 0.2, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2]))),
    "blade": lambda post, body: nga.KnifeEdge(body, across=(0, 1, 0)),
    "hand": lambda post, body: nga.FrameTrajectory(body, hand_pose),
}
SPACING = 0.4  # [m]


def hand_pose(t):
    """Up and down beside the others, while it turns."""
    place = np.array([SPACING * list(JOINTS).index("hand"), 0.0, 1.0 + 0.1 * np.sin(3.0 * t)])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, t])), place)


def gallery():
    """One post and one body for every joint, and the constraint between them."""
    model = pin.Model()
    model.name = "joint_gallery"
    for i, name in enumerate(JOINTS):
        place = pin.SE3(np.eye(3), np.array([SPACING * i, 0.0, 1.0]))
        model.addFrame(pin.Frame(f"{name} post", 0, place, pin.FrameType.OP_FRAME))
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), place, name)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.1, 0.15, 0.2), pin.SE3.Identity())
    scene = nga.Scene(model)
    for name, joint in JOINTS.items():
        scene.add_geometry(f"{name} body", coal.Box(0.1, 0.15, 0.2), parent=name)
        scene.add_constraint(joint(f"{name} post", name))
    return scene


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=2e-3, argv=argv)
    scene = gallery()
    start = nga.assemble(scene, pin.neutral(scene.model), np.tile([0.1, 0.2, 0.0, 0.5, 1.0, 0.3], len(JOINTS)))
    method = nga.GeneralizedAlpha(rho_inf=0.9)
    trajectory = nga.simulate(scene, start.q, start.v, t_end=args.t_end, dt=args.dt, method=method)
    show(trajectory, args)

    motion = trajectory.constraint_motion
    compare("rows that are held", float(motion.rank[-1]), 3 + 6 + 5 + 4 + 5 + 4 + 3 + 1 + 1 + 6, "")
    compare("largest violation", float(np.abs(motion.g).max()), 0.0, "m")
    return trajectory


if __name__ == "__main__":
    main()
