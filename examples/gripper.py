"""A gripper lifts a cube by friction, is welded to it, opens, carries it and lets it fall."""

import coal
import numpy as np
import pinocchio as pin
from common import options, show
from scipy.interpolate import PchipInterpolator

import ngalpha_pin as nga


def main(argv=None):
    args = options(__doc__, t_end=1.3, dt=2e-3, argv=argv)
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("palm", coal.Box(0.3, 0.1, 0.04), mass=0.5, joint=pin.JointModelPZ())
    for name, x in (("left", -0.1), ("right", 0.1)):
        at = pin.SE3(np.eye(3), np.array([x, 0, -0.1]))
        scene.add_body(name, coal.Sphere(0.01), mass=0.5, placement=at, joint=pin.JointModelPX(), parent="palm")
    scene.add_body("cube", coal.Box(0.1, 0.1, 0.1), mass=0.4)
    scene.add_contact("cube", "ground", mu=0.5)
    scene.add_contact("[lr]*t", "cube", mu=0.8, contact_radius=0.02)
    q0 = scene.place_on("ground", np.append([0.15, 0, 0], scene.reference()[3:]), root="cube")
    phases = ((0.15, 0), (0.15, 0.05), (0.35, 0.05), (0.35, 0), (0.45, 0), (0.45, 0))  # height, way of the fingers [m]
    path = PchipInterpolator((0, 0.2, 0.6, 0.7, 1, 9), [[z, x, -x, *q0[3:]] for z, x in phases])
    scene.add_force(nga.JointPD(path, kp=2000.0, kd=60.0))
    simulator = nga.Simulator(scene, args.dt, record=True)
    state = simulator.initial_state(q0)
    for step in range(round(args.t_end / args.dt)):
        if step == round(0.6 / args.dt):
            state = simulator.weld("palm", "cube", name="grasp")
        if step == round(1.0 / args.dt):
            state = simulator.release("grasp")
        state = simulator.step(state)
    return show(simulator.trajectory(), args)


if __name__ == "__main__":
    main()
