"""A rod falls on its tip, whose slip turns back within the impact: Newton's law adds energy, the others do not."""

import coal
import numpy as np
import pinocchio as pin
from common import options, show

import ngalpha_pin as nga

ANGLE, MU, E_N = 0.6, 0.5, 0.95
INERTIA = np.array([1.0, 1.0, 1 / 12])


def falls(speed):
    """A restitution that falls with the speed of approach [m/s]."""
    return E_N / (1 + 0.2 * speed)


def rod(law, e=E_N):
    model = pin.Model()
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    model.addJoint(0, pin.JointModelPlanar(), upright, "rod")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.diag([0.05, 0.05, 1 / 12])), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    tip = pin.SE3(np.eye(3), np.array([-0.5, 0.0, 0.0]))
    scene.add_geometry("tip", coal.Sphere(0.01), parent="rod", placement=tip)
    scene.add_contact("tip", "ground", mu=MU, e_N=nga.Restitution(e, law))
    return scene


def main(argv=None):
    args = options(__doc__, t_end=0.1, dt=2e-3, argv=argv)
    q0 = np.array([0.0, 0.5 * np.sin(ANGLE) + 0.06, np.cos(ANGLE), np.sin(ANGLE)])
    v0 = np.array([0.1, -1.0, -0.3])
    for law, e in (("newton", E_N), ("poisson", E_N), ("stronge", falls), ("stronge", E_N)):
        trajectory = nga.simulate(rod(law, e), q0, v0, t_end=args.t_end, dt=args.dt)
        for before, after in zip(trajectory.impacts.v_before, trajectory.impacts.v_after, strict=True):
            gained = 0.5 * INERTIA @ (after**2 - before**2)
            print(f"{law}{' of the speed' if e is falls else ''}: energy gained by the impact: {gained:+.4f} J")
    show(trajectory, args)
    return trajectory


if __name__ == "__main__":
    main()
