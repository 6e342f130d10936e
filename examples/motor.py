"""A motor with its current drives a wheel: the current is a state of the first order beside the motion."""

import numpy as np
import pinocchio as pin
from common import compare, options, show
from scipy.linalg import expm

import ngalpha_pin as nga

INERTIA, INDUCTANCE, RESISTANCE, CONSTANT, VOLTAGE = 0.02, 0.05, 0.8, 0.3, 6.0


def main(argv=None):
    args = options(__doc__, t_end=0.5, dt=2e-3, argv=argv)
    model = pin.Model()
    wheel = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(wheel, pin.Inertia(1.0, np.zeros(3), INERTIA * np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_state(
        "current",
        lambda t, q, v, i: (VOLTAGE - RESISTANCE * i - CONSTANT * v[0]) / INDUCTANCE,
        force=lambda t, q, v, i: CONSTANT * i,
    )
    trajectory = nga.simulate(scene, [0.0], t_end=args.t_end, dt=args.dt)
    show(trajectory, args)

    A = [[0.0, CONSTANT / INERTIA], [-CONSTANT / INDUCTANCE, -RESISTANCE / INDUCTANCE]]
    steady = np.array([VOLTAGE / CONSTANT, 0.0])
    speed, current = steady - expm(np.array(A) * trajectory.t[-1]) @ steady
    compare("speed at the end", trajectory.v[-1, 0], speed, "rad/s")
    compare("current at the end", trajectory.states["current"][-1], current, "A")
    return trajectory


if __name__ == "__main__":
    main()
