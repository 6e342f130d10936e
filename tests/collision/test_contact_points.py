"""Which pairs are points fixed in a body, and what distance they have: against coal, and in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.collision.contact_points import contact_points, pair_points, surface_of
from ngalpha_pin.system.system import System


def convex(points):
    corners = coal.StdVec_Vec3s()
    for point in points:
        corners.append(point)
    return coal.Convex.convexHull(corners, True, "Qt")


def prism(sides):
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.array([[0.1 * np.cos(x), 0.1 * np.sin(x), z] for x in angles for z in (-0.05, 0.05)])


def ball(rings, sides):
    """Corners of a round foot: rings of corners that lie in planes, each with a small part of them."""
    heights = 0.1 * np.sin(np.linspace(-1.2, 1.2, rings))
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.array(
        [[r * np.cos(x), r * np.sin(x), z] for z in heights for r in [np.sqrt(0.01 - z**2)] for x in angles]
    )


def on_plane(shape, **options):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    geometries = pin.GeometryModel()
    at = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.01, 0.02, -0.03]))
    geometries.addGeometryObject(pin.GeometryObject("shape", joint, at, shape))
    scene = nga.Scene(model, geometries)
    scene.add_plane("ground", **options)
    scene.add_contact("shape", "ground", mu=0.3)
    return scene


@pytest.mark.parametrize(
    "shape, count",
    [
        (coal.Sphere(0.1), 1),
        (coal.Capsule(0.05, 0.2), 2),
        (coal.Box(0.1, 0.2, 0.3), 8),
        (convex(prism(8)), 16),
        (convex(prism(16)), 32),
        (convex(ball(21, 30)), 630),  # a round foot, whatever its number of corners
    ],
)
def test_corners_are_points_with_the_distance_of_coal(shape, count):
    scene = on_plane(shape, normal=(0.1, 0.2, 1.0), point=(0.0, 0.0, -0.2))
    points, others = contact_points(scene)
    assert ([len(part.names) for part in points], others) == ([count], [])
    system, rng = System(scene), np.random.default_rng(1)
    plane, body = scene.geometry("ground"), scene.geometry("shape")
    for _ in range(10):
        q = pin.integrate(scene.model, pin.neutral(scene.model), rng.normal(size=6))
        q[2] += 5.0  # far away coal's distance is exact
        system.place(q)
        poses = [system.data.oMi[g.parentJoint] * g.placement for g in (body, plane)]
        placed = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        exact = coal.distance(body.geometry, placed[0], plane.geometry, placed[1], request, result)
        gaps = system.gaps(system.contacts.subset(np.arange(count)), q)
        assert gaps.min() == pytest.approx(exact, abs=1e-10)  # an iteration of coal may end 1e-11 before it


@pytest.mark.parametrize("sides", [17, 40])
def test_wide_faces_are_no_points(sides):
    """A face of many corners rests on four of them: all as unknowns would be dependent."""
    scene = on_plane(convex(prism(sides)))
    assert len(pair_points(scene, scene.contacts[0]).points) == 2 * sides
    points, others = contact_points(scene)
    assert points == [] and others == scene.contacts


def test_surfaces_in_the_frame_of_their_joint():
    scene = on_plane(coal.Sphere(0.1), normal=(0.0, 0.6, 0.8), point=(1.0, 2.0, 3.0))
    plane = surface_of(scene.geometry("ground"), False)
    assert plane.is_plane and plane.joint == 0
    assert plane.normal == pytest.approx([0.0, 0.6, 0.8]) and plane.offset == pytest.approx(0.6 * 2 + 0.8 * 3)
    pose = pin.SE3(pin.exp3(np.array([0.5, 0.0, 0.0])), np.array([1.0, 2.0, 3.0]))
    cylinder = pin.GeometryObject("cylinder", 3, pose, coal.Cylinder(0.2, 0.8))
    outside, inside = surface_of(cylinder, False), surface_of(cylinder, True)
    assert (outside.side, inside.side, outside.joint) == (1.0, -1.0, 3)
    assert outside.axis == pytest.approx([0.0, -np.sin(0.5), np.cos(0.5)])
    assert (outside.radius, outside.half_length) == pytest.approx((0.2, 0.4))
    assert surface_of(pin.GeometryObject("box", 3, pose, coal.Box(1.0, 1.0, 1.0)), False) is None


def test_a_body_too_large_for_a_hollow_shape_is_refused():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("ball", coal.Sphere(0.3), parent="body")
    scene.add_geometry("drum", nga.Hollow(coal.Cylinder(0.2, 1.0)))
    scene.add_contact("ball", "drum")
    with pytest.raises(nga.SceneError, match="does not fit into the hollow 'drum'"):
        contact_points(scene)
