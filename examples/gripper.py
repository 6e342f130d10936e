"""A gripper lifts a cube by friction, is welded to it, opens, carries it and lets it fall."""

import coal
import numpy as np
import pinocchio as pin
from common import options, show
from scipy.interpolate import PchipInterpolator

import ngalpha_pin as nga

PARTS = (
    ("palm", 0, pin.JointModelPZ(), 0.0),
    ("left", 1, pin.JointModelPX(), -0.1),
    ("right", 1, pin.JointModelPX(), 0.1),
)
# ends of the phases [s], with heights of the palm and ways of the fingers [m] there
TIMES, HEIGHT, CLOSED = (0, 0.2, 0.6, 0.7, 1, 9), (0.15, 0.15, 0.35, 0.35, 0.45, 0.45), (0, 0.05, 0.05, 0, 0, 0)


def gripper():
    scene = nga.Scene(pin.Model())
    for name, parent, joint, x in PARTS:
        number = scene.model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([x, 0, 0])), name)
        scene.model.appendBodyToJoint(number, pin.Inertia.FromBox(0.5, 0.1, 0.1, 0.1), pin.SE3.Identity())
        shape, z = (coal.Box(0.3, 0.1, 0.04), 0.0) if parent == 0 else (coal.Sphere(0.01), -0.1)
        scene.add_geometry(name, shape, name, pin.SE3(np.eye(3), np.array([0, 0, z])))
    scene.add_plane("ground")
    scene.add_body("cube", coal.Box(0.1, 0.1, 0.1), mass=0.4)
    scene.add_contact("cube", "ground", mu=0.5)
    scene.add_contact("[lr]*t", "cube", mu=0.8, contact_radius=0.02)
    q0 = scene.place_on("ground", np.append([0.15, 0, 0], pin.neutral(scene.model)[3:]), root="cube")
    path = PchipInterpolator(TIMES, np.column_stack((HEIGHT, CLOSED, np.negative(CLOSED))))
    q_ref, v_ref = (lambda t: np.append(path(t), q0[3:])), (lambda t: np.append(path(t, 1), np.zeros(6)))
    scene.add_force(nga.JointPD(q_ref, kp=2000.0, kd=60.0, v_ref=v_ref))
    return scene, q0


def main(argv=None):
    args = options(__doc__, t_end=1.3, dt=2e-3, argv=argv)
    scene, q0 = gripper()
    simulator = nga.Simulator(scene, args.dt, record=True)
    state = simulator.initial_state(q0)
    while state.t < args.t_end - args.dt / 2:
        if abs(state.t - 0.6) < args.dt / 2:
            state = simulator.weld("palm", "cube")
        if abs(state.t - 1.0) < args.dt / 2:
            state = simulator.release("Weld palm-cube")
        state = simulator.step(state)
    trajectory = simulator.trajectory()
    show(trajectory, args)
    return trajectory


if __name__ == "__main__":
    main()
