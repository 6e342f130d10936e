"""Shapes, meshes and bodies that cannot be are refused by name; flat ones are plates; coal gets nothing it dies of."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.convex_hull import FLAT, hull

nan, inf = float("nan"), float("inf")
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def mesh(points, triangles):
    shape = coal.BVHModelOBBRSS()
    shape.beginModel(len(triangles), len(points))
    for triangle in triangles:
        shape.addTriangle(*(np.asarray(points[i], dtype=float) for i in triangle))
    shape.endModel()
    return shape


def scene(inertia=None):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, inertia or pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    return nga.Scene(model)


IMPOSSIBLE = {
    "sphere": lambda: coal.Sphere(nan),
    "negative": lambda: coal.Sphere(-0.1),
    "box": lambda: coal.Box(inf, 1, 1),
    "capsule": lambda: coal.Capsule(0.1, nan),
    "cylinder": lambda: coal.Cylinder(-1.0, 1.0),
    "cone": lambda: coal.Cone(1.0, 1e200),
    "ellipsoid": lambda: coal.Ellipsoid(1.0, 0.0, 1.0),
    "plane": lambda: coal.Plane(np.array([0.0, 0, 1]), nan),
    "mesh with NaN": lambda: mesh([*SQUARE[:3], [0, 0, nan]], [(0, 1, 2), (0, 1, 3)]),
    "mesh on a line": lambda: mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1, 2)]),
    "mesh in a point": lambda: mesh(np.zeros((3, 3)), [(0, 1, 2)]),
    "mesh far away": lambda: mesh(SQUARE + 1e13, [(0, 1, 2), (0, 2, 3)]),
    "triangle on a line": lambda: coal.TriangleP(*np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])),
    "no shape": lambda: "a box",
    "None": lambda: None,
    "class": lambda: coal.Box,
}


@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_impossible_shapes_are_refused_by_name(kind):
    with pytest.raises(nga.SceneError, match="geometry 'odd_one'"):
        scene().add_geometry("odd_one", IMPOSSIBLE[kind](), parent="free")


def test_impossible_shapes_of_a_collision_model_are_refused_by_name():
    for shape in (coal.Sphere(nan), mesh([*SQUARE[:3], [0, 0, nan]], [(0, 1, 2), (0, 1, 3)])):
        geometries = pin.GeometryModel()
        geometries.addGeometryObject(pin.GeometryObject("odd_one", 0, pin.SE3.Identity(), shape))
        with pytest.raises(nga.SceneError, match="geometry 'odd_one'"):
            nga.Scene(pin.Model(), geometries)


@pytest.mark.parametrize("ground", ["plane", "box"])
def test_flat_mesh_is_a_thin_plate_that_comes_to_rest(ground):
    s = scene(pin.Inertia.FromBox(1.0, 2.0, 2.0, 0.1))
    s.add_geometry("plate", mesh(SQUARE, [(0, 1, 2), (0, 2, 3)]), parent="free")
    if ground == "plane":
        s.add_plane("ground")
    else:
        s.add_geometry("ground", coal.Box(6, 6, 1), placement=pin.SE3(np.eye(3), np.array([0, 0, -0.5])))
    s.add_contact("plate", "ground", mu=0.5)
    run = nga.simulate(s, np.array([0, 0, 1e-3, 0, 0, 0, 1.0]), t_end=0.1, dt=1e-3)
    assert run.q[-1, 2] == pytest.approx(0.5 * FLAT * 2.0, abs=1e-9)
    assert run.audit().ok


def test_flat_mesh_comes_back_from_a_file(tmp_path):
    s = scene()
    s.add_geometry("plate", mesh(SQUARE, [(0, 1, 2), (0, 2, 3)]), parent="free")
    s.add_plane("ground")
    s.add_contact("plate", "ground")
    run = nga.simulate(s, np.array([0, 0, 1.0, 0, 0, 0, 1.0]), t_end=0.01, dt=1e-3)
    run.save(tmp_path / "run.npz")
    again = nga.Trajectory.load(tmp_path / "run.npz")
    assert np.array_equal(again.g_N, run.g_N)


@pytest.mark.parametrize("seed", range(8))
def test_hull_of_any_points_is_one_or_an_error(seed):
    """Of slabs and needles from thickness 1 to 1e-18, 1e-9 to 1e9 m large, up to 1e9 sizes away from the origin."""
    rng = np.random.default_rng(seed)
    for _ in range(150):
        n = int(rng.integers(3, 60))
        points = rng.normal(size=(n, 3)) if rng.random() < 0.5 else rng.integers(0, 3, size=(n, 3)).astype(float)
        points[:, (1 if rng.random() < 0.3 else 2) :] *= 10 ** rng.uniform(-18, 0)
        R = pin.exp3(rng.normal(size=3)) if rng.random() < 0.7 else np.eye(3)
        points = 10 ** rng.uniform(-9, 9) * (points @ R.T + rng.normal(size=3) * 10 ** rng.uniform(-3, 9))
        try:
            corners = np.array(hull("points", points).points())
        except nga.SceneError:
            continue
        size = np.ptp(points, axis=0).max()
        assert (corners.min(axis=0) <= points.min(axis=0) + FLAT * size).all()
        assert (corners.max(axis=0) >= points.max(axis=0) - FLAT * size).all()


@pytest.mark.parametrize(
    ("heights", "size", "depth"),
    [
        (np.zeros((3, 3)), (1.0, 1.0), 1e-9),
        (np.array([[0, 1e8, 0], [0, 0, 0], [0, 0, 0.0]]), (1.0, 1.0), None),
        (np.zeros((3, 3)), (1e-9, 1e-9), 1.0),
        (np.full((3, 3), nan), (1.0, 1.0), None),
        (np.zeros((1, 3)), (1.0, 1.0), None),
        (np.zeros((3, 3)), (1.0, -1.0), None),
        ("hill", (1.0, 1.0), None),
        (np.zeros((3, 3)), 1.0, None),
        (np.zeros((3, 3)), (1.0, 1.0), "deep"),
    ],
)
def test_height_fields_that_are_none(heights, size, depth):
    s = scene()
    with pytest.raises(nga.SceneError, match="height field"):
        s.add_height_field("hill", heights, size, depth=depth)
    assert s.collision_model.ngeoms == 0


def body(mass=1.0, lever=(0, 0, 0), moments=(0.1, 0.1, 0.1)):
    found = pin.Inertia.Identity()
    found.mass, found.lever, found.inertia = mass, np.array(lever, dtype=float), np.diag(moments)
    return found


IMPOSSIBLE_BODIES = (
    {"mass": -1.0}, {"mass": nan}, {"lever": (0, inf, 0)}, {"moments": (-0.1, 0.1, 0.1)},
)  # fmt: skip


@pytest.mark.parametrize("numbers", IMPOSSIBLE_BODIES, ids=str)
def test_inertia_that_no_body_has_names_the_body(numbers):
    with pytest.raises(nga.SceneError, match="body of joint 'free'"):
        scene(body(**numbers))


def test_inertia_that_violates_the_triangle_inequality_is_an_error_and_a_rounded_one_is_said():
    with pytest.raises(nga.SceneError, match="body of joint 'free'.*exceeds the sum of the others by 0.99 of itself"):
        scene(body(moments=(0.001, 0.002, 0.5)))
    with pytest.raises(nga.SceneError, match="exceeds the sum"):
        scene(body(moments=(0.1, 0.1, 0.2 / 0.989)))
    with pytest.warns(UserWarning, match="body of joint 'free'.*exceeds the sum.*rounded in the file"):
        scene(body(moments=(0.1, 0.1, 0.2 / 0.991)))


def test_thin_bodies_and_points_are_right():
    for moments in ((0, 0, 0), (0, 0.1, 0.1), (0.1, 0.1, 0.2)):
        scene(body(moments=moments))


@pytest.mark.parametrize(
    ("attribute", "value"),
    [("damping", -1.0), ("armature", nan), ("lowerPositionLimit", nan), ("upperEffortLimit", nan)],
)
def test_numbers_of_joints_that_cannot_be(attribute, value):
    model = pin.Model()
    for name in ("first", "second"):
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, body(), pin.SE3.Identity())
    values = np.array(getattr(model, attribute))
    values[1] = value
    setattr(model, attribute, values)
    with pytest.raises(nga.SceneError, match=rf"model\.{attribute}\[1\] = .* of joint 'second'"):
        nga.Scene(model)


@pytest.mark.parametrize("joint, planar", [(pin.JointModelPlanar(), True), (pin.JointModelSpherical(), False)])
def test_body_that_turns_about_one_axis_needs_only_the_moment_that_acts(joint, planar):
    """A planar model may leave out the moments about the axes in its plane: nothing turns about them."""
    model = pin.Model()
    first = model.addJoint(0, joint, pin.SE3.Identity(), "first")
    second = model.addJoint(first, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), "second")
    model.appendBodyToJoint(second, pin.Inertia(1.0, np.zeros(3), np.diag([0.0, 0.0, 0.01])), pin.SE3.Identity())
    if planar:
        nga.Scene(model)
        return
    with pytest.raises(nga.SceneError, match="body of joint 'second'.* which no body has"):
        nga.Scene(model)
