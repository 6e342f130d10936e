"""What the tests of the replay show: every kind of shape, and a body that deforms."""

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

HEIGHTS = 0.1 + 0.05 * np.add.outer(np.sin(np.arange(6.0)), np.cos(np.arange(5.0)))


def octahedron(faces):
    points = coal.StdVec_Vec3s()
    for point in np.vstack([np.eye(3), -np.eye(3)]) * 0.15:
        points.append(point)
    return coal.Convex.convexHull(points, faces, "Qt")


SHAPES = {
    "box": coal.Box(0.2, 0.3, 0.25),
    "sphere": coal.Sphere(0.1),
    "cylinder": coal.Cylinder(0.1, 0.3),
    "capsule": coal.Capsule(0.08, 0.2),
    "cone": coal.Cone(0.12, 0.3),
    "ellipsoid": coal.Ellipsoid(0.1, 0.15, 0.2),
    "convex": octahedron(faces=True),
    "hull without faces": octahedron(faces=False),
    "triangle": coal.TriangleP(np.array([-0.1, 0, -0.1]), np.array([0.1, 0, -0.1]), np.array([0.0, 0, 0.2])),
    "terrain": coal.HeightFieldOBBRSS(1.0, 1.5, HEIGHTS, -0.1),
    "fine terrain": coal.HeightFieldAABB(1.0, 1.5, HEIGHTS, -0.1),
}
FIELDS = ("terrain", "fine terrain")
HOLLOW = {"tube": coal.Cylinder(0.25, 0.4), "shell": coal.Sphere(0.3)}


def free_ball():
    model = pin.Model()
    model.name = "ball"
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addBodyFrame("body", joint, pin.SE3.Identity(), 0)
    return model


def fixed_shapes():
    """Every shape in a row along x, beside a ball that flies for 0.1 s."""
    scene = nga.Scene(free_ball())
    for n, (name, shape) in enumerate((SHAPES | HOLLOW).items()):
        placement = pin.SE3(pin.utils.rotate("y", 0.1 * n), np.array([0.7 * n, 0.5, 0.5]))
        if name in FIELDS:  # drawn as a whole, as that of a visual model; for contacts it would be cut in pieces
            scene.collision_model.addGeometryObject(pin.GeometryObject(name, 0, placement, shape))
            scene.added.append(name)
            continue
        scene.add_geometry(name, nga.Hollow(shape) if name in HOLLOW else shape, placement=placement)
    return nga.simulate(scene, pin.neutral(scene.model), np.zeros(6), t_end=0.1, dt=0.02)


def bent(t, n_points=20, length=0.5):
    """Centreline of a beam, straight at t = 0, a quarter of a circle at t = 0.1 s: shape (n, n_points, 3)."""
    angle = np.linspace(0, 1, n_points) * np.asarray(t)[:, None] / 0.1 * np.pi / 2
    step = length / (n_points - 1)
    middle = (angle[:, 1:] + angle[:, :-1]) / 2
    ends = np.cumsum(np.stack([np.cos(middle), 0 * middle, np.sin(middle)], axis=2) * step, axis=1)
    return np.concatenate([np.zeros((len(angle), 1, 3)), ends], axis=1)
