"""Two arms, a table, a box and a ball in one scene, from parts: the ball drops, the box rests, the arms hold still."""

import os

import coal
import numpy as np
import pinocchio as pin
from common import options, show

import ngalpha_pin as nga
from ngalpha_pin import robots

ARM = os.path.join(os.path.dirname(robots.__file__), "urdf", "arm.urdf")


def at(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def bench():
    scene = nga.Scene()
    scene.add_model(ARM, "left", at(-0.8, 0, 0.8))
    scene.add_model(ARM, "right", at(0.8, 0, 0.8))
    scene.add_body("table", coal.Box(1.2, 0.8, 0.05), placement=at(0, 0, 0.775), free=False)
    scene.add_body("box", coal.Box(0.1, 0.1, 0.1), mass=0.5, placement=at(0, 0.2, 1.0))
    scene.add_body("ball", coal.Sphere(0.05), density=500.0, placement=at(0.3, 0.2, 1.0))
    scene.add_contact("box", "table", mu=0.5)
    scene.add_contact("ball", "table", mu=0.5)
    q0 = scene.place_on("table", scene.reference(), root="box")
    q0 = scene.place_on("table", q0, clearance=0.1, root="ball")
    scene.add_force(nga.JointPD(q0, kp=200.0, kd=20.0))
    return scene, q0


def main(argv=None):
    args = options(__doc__, t_end=1.0, dt=2e-3, argv=argv)
    scene, q0 = bench()
    trajectory = nga.simulate(scene, q0, t_end=args.t_end, dt=args.dt)
    show(trajectory, args)
    return trajectory


if __name__ == "__main__":
    main()
