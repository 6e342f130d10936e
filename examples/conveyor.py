"""A box is dropped on a finite belt that carries it up a slope of 30 degrees."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

SPEED, MU, SLOPE, HEIGHT = 0.5, 0.8, np.radians(30.0), 0.02


def main(argv=None):
    args = options(__doc__, t_end=0.8, dt=5e-3, argv=argv)
    model, tilt = pin.Model(), pin.SE3(pin.utils.rotate("y", -SLOPE), np.zeros(3))
    model.addJoint(0, pin.JointModelFreeFlyer(), tilt, "box")  # its x is along the belt
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_geometry("belt", coal.Box(3.0, 0.5, 0.1), placement=tilt * pin.SE3(np.eye(3), np.array([0, 0, -0.05])))
    scene.add_geometry("box", coal.Box(0.1, 0.1, 0.1), parent="box")
    scene.add_contact("box", "belt", mu=MU, surface_velocity=(SPEED, 0.0, 0.0))
    q0 = pin.neutral(model)
    q0[2] = 0.05 + HEIGHT
    trajectory = nga.simulate(scene, q0, t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    # it falls back along the slope, is pushed by the friction of its impact, and slips until it is as fast as the belt
    down, across = 9.81 * np.sin(SLOPE), 9.81 * np.cos(SLOPE)
    lands = np.sqrt(2 * HEIGHT / across)
    start, gain = MU * across * lands - down * lands, MU * across - down
    slips = (SPEED - start) / gain
    x = -down * lands**2 / 2 + start * slips + gain * slips**2 / 2 + SPEED * (trajectory.t[-1] - lands - slips)
    if trajectory.t[-1] > lands + slips:
        compare("way along the belt", trajectory.q[-1, 0], x, "m")
    return trajectory


if __name__ == "__main__":
    main()
