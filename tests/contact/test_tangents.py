"""In which directions a mechanism can move a contact point: found from random configurations, known in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.contact.tangents import plane_tangents
from ngalpha_pin.system.system import System


def test_tangents_complete_a_normal_to_a_right_handed_frame():
    n = np.random.default_rng(0).normal(size=(50, 3))
    n = np.vstack((n / np.linalg.norm(n, axis=1, keepdims=True), np.eye(3), -np.eye(3)))
    t = plane_tangents(n)
    frames = np.concatenate((t, n[:, None]), axis=1)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(n), 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-14)
    np.testing.assert_allclose(plane_tangents(np.array([[0.0, 0.0, 1.0]]))[0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def kinds_of(joint, radius=0.0, surface="plane"):
    """Rows of friction of a ball on one joint against a surface."""
    model = pin.Model()
    j = model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry(
        "ball", coal.Sphere(0.1), parent="joint", placement=pin.SE3(np.eye(3), np.array([0.0, 0.2, 0.0]))
    )
    if surface == "plane":
        scene.add_plane("other", point=(0.0, 0.0, -1.0))
    else:
        scene.add_geometry("other", nga.Hollow(coal.Cylinder(2.0, 10.0)))
    scene.add_contact("ball", "other", mu=0.5, contact_radius=radius)
    table = System(scene).contacts
    return table.kind_F[: table.n_F[0]].tolist(), table.tangents[0]


@pytest.mark.parametrize(
    "joint, radius, kinds",
    [
        (pin.JointModelFreeFlyer(), 0.0, [0, 1]),
        (pin.JointModelFreeFlyer(), 0.1, [0, 1, 2]),
        (pin.JointModelPX(), 0.0, [0]),
        (pin.JointModelPY(), 0.1, [0]),
        (pin.JointModelPZ(), 0.0, []),
        (pin.JointModelRZ(), 0.1, [0, 1, 2]),  # the point runs around the axis
        (pin.JointModelRX(), 0.1, [0]),
        (pin.JointModelTranslation(), 0.1, [0, 1]),
    ],
)
def test_rows_where_the_point_can_move(joint, radius, kinds):
    found, tangents = kinds_of(joint, radius)
    assert found == kinds
    if kinds == [0]:  # the one tangent lies along the motion
        along = {"JointModelPX": [1.0, 0.0, 0.0]}.get(joint.shortname(), [0.0, 1.0, 0.0])
        np.testing.assert_allclose(np.abs(tangents[0]), along, atol=1e-9)


def test_round_surface_of_a_planar_motion_has_one_tangent():
    found, tangents = kinds_of(pin.JointModelPlanar(), surface="cylinder")
    assert found == [0]
    np.testing.assert_allclose(np.abs(tangents[0]), [0.0, 0.0, 1.0], atol=1e-12)


def test_no_friction_no_rows():
    assert System(robots.load("rotating_ball", mu=0.0)[0]).contacts.n_F.tolist() == [0]
