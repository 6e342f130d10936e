"""A ball falls on the middle of a clamped beam: with a compliant contact the force has a limit in the mesh."""

import coal
import numpy as np
import pinocchio as pin
from common import options, show

import ngalpha_pin as nga

STIFFNESS, DAMPING = 5e3, 2.0
UPRIGHT = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))  # the plane of the beam is x, z of the world


def ball_on_beam(elements):
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.06])), "ball")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(0.2, 0.05), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    beam = nga.PlanarBeam(1.0, EA=1e5, EI=20.0, line_density=0.5, elements=elements, plane=UPRIGHT)
    scene.add_beam(beam, "beam")
    for name, xi in (("root", 0.0), ("middle", 0.5), ("tip", 1.0)):
        scene.add_beam_point(name, "beam", xi)
    scene.add_constraint(nga.Weld("world", "root", placement_a=UPRIGHT))
    scene.add_constraint(nga.Weld("world", "tip", placement_a=UPRIGHT * pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))))
    scene.add_geometry("ball", coal.Sphere(0.05), parent="ball")
    scene.add_contact("middle", "ball", mu=0.2, compliance=nga.KelvinVoigt(STIFFNESS, DAMPING))
    return scene


def main(argv=None):
    args = options(__doc__, t_end=0.08, dt=5e-4, argv=argv)
    for elements in (4, 8):
        scene = ball_on_beam(elements)
        trajectory = nga.simulate(scene, scene.q_ref, t_end=args.t_end, dt=args.dt)
        print(f"{elements} elements: largest force {trajectory.la_N.max(initial=0.0):.2f} N")
    show(trajectory, args)
    return trajectory


if __name__ == "__main__":
    main()
