"""A mass on a spring rides on a belt whose friction falls with the speed of slip: it sticks and slips in turn."""

import coal
import numpy as np
import pinocchio as pin
from common import compare, options, show

import ngalpha_pin as nga

STIFFNESS, BELT = 100.0, 0.1
FRICTION = nga.Stribeck(mu_s=0.4, mu_k=0.25, v_s=0.1)
PERIOD = 0.8441867  # [s], of the event-driven run in the tests


def main(argv=None):
    args = options(__doc__, t_end=1.3, dt=2e-3, argv=argv)
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("belt")
    scene.add_geometry("mass", coal.Sphere(0.1), parent="mass")
    scene.add_contact("mass", "belt", mu=FRICTION, surface_velocity=(BELT, 0.0, 0.0))
    spring = nga.Control(lambda t, q, v: np.array([-STIFFNESS * q[0], 0.0, 0.0]), derivatives=True)
    scene.add_force(spring)
    trajectory = nga.simulate(
        scene, np.array([0.0, 0.0, 0.1]), np.array([BELT, 0.0, 0.0]), t_end=args.t_end, dt=args.dt
    )
    show(trajectory, args)

    # with the speed of the belt it crosses a deflection just before it slips
    x, level = trajectory.q[:, 0], 0.39 * 9.81 / STIFFNESS
    up = np.flatnonzero((x[:-1] < level) & (x[1:] >= level))
    crossings = trajectory.t[up] + (level - x[up]) / BELT
    if len(crossings) > 1:
        compare("period", crossings[1] - crossings[0], PERIOD, "s")
    return trajectory


if __name__ == "__main__":
    main()
