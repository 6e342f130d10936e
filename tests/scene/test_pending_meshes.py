"""Meshes of contact are loaded when something asks for them, each file once."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene import pending_meshes
from ngalpha_pin.scene.meshes import is_pending
from ngalpha_pin.sensitivities.parameters import parameters_of

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
SHAPE = '<collision><origin xyz="0 0 {z}"/><geometry>{shape}</geometry></collision>'
BOX = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n" + "".join(
    f"f {a} {b} {d}\nf {a} {d} {c}\n"
    for a, b, c, d in ((1, 3, 2, 4), (5, 6, 7, 8), (1, 2, 5, 6), (3, 7, 4, 8), (1, 5, 3, 7), (2, 4, 6, 8))
)


@pytest.fixture
def robot(tmp_path):
    """A body of four shapes, three of them meshes of two files."""
    (tmp_path / "foot.obj").write_text(BOX)
    (tmp_path / "trunk.obj").write_text(BOX.replace("1\n", "2\n"))
    shapes = (
        '<mesh filename="foot.obj" scale="1 1 0.5"/>', '<mesh filename="trunk.obj"/>', '<sphere radius="0.1"/>',
        '<mesh filename="foot.obj" scale="1 1 0.5"/>',
    )  # fmt: skip
    body = "".join(SHAPE.format(z=i, shape=shape) for i, shape in enumerate(shapes))
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="a">{INERTIAL}{body}</link></robot>')
    return path


@pytest.fixture
def loads(monkeypatch):
    """Names of the files in the order in which they are loaded."""
    found, load = [], pending_meshes.load_mesh
    monkeypatch.setattr(
        pending_meshes, "load_mesh", lambda path, scale: found.append(path.rpartition("/")[2]) or load(path, scale)
    )
    return found


def read(path):
    scene = nga.Scene.from_urdf(path, pin.JointModelFreeFlyer())
    scene.add_plane("ground")
    return scene


def test_a_mesh_is_loaded_by_the_first_contact_that_uses_it_and_once(robot, loads):
    scene = read(robot)
    assert scene.within_limits(scene.reference()).shape == (7,)
    assert [g.name for g in scene.declared_shapes.geometryObjects] == ["a_0", "a_1", "a_2", "a_3", "ground"]
    assert loads == []
    scene.add_contact("a_0", "ground", mu=0.5)
    q0 = scene.place_on("ground", scene.reference())
    nga.simulate(scene, q0, t_end=1e-3, dt=1e-3)
    scene.varied(mu=0.2)
    assert loads == ["foot.obj"]
    assert [is_pending(g) for g in scene.declared_shapes.geometryObjects] == [False, True, False, False, False]
    assert scene.collision_model.ngeoms == 5 and loads == ["foot.obj", "trunk.obj"]


def test_shapes_are_those_that_pinocchio_reads(robot):
    model = pin.buildModelFromUrdf(str(robot), pin.JointModelFreeFlyer())
    theirs = pin.buildGeomFromUrdf(model, str(robot), pin.GeometryType.COLLISION, package_dirs=[str(robot.parent)])
    for ours, other in zip(read(robot).collision_model.geometryObjects, theirs.geometryObjects, strict=False):
        assert (ours.name, ours.parentJoint, ours.parentFrame) == (other.name, other.parentJoint, other.parentFrame)
        np.testing.assert_array_equal(ours.placement.homogeneous, other.placement.homogeneous)
        np.testing.assert_array_equal(ours.meshScale, other.meshScale)
        assert type(ours.geometry) is type(other.geometry)
        if isinstance(ours.geometry, coal.BVHModelBase):
            np.testing.assert_array_equal(ours.geometry.vertices(), other.geometry.vertices())


def test_parts_and_pickles_take_the_declaration_along(robot, loads):
    scene = nga.Scene()
    scene.add_model(read(robot), "left")
    again = pickle.loads(pickle.dumps(scene))
    assert loads == []
    assert again.geometry("left/a_1").geometry.num_vertices == 8
    assert loads == ["trunk.obj"]


def test_a_mesh_that_cannot_be_read_is_named_where_it_is_used(robot):
    (robot.parent / "trunk.obj").write_text("not a mesh")
    scene = read(robot)
    scene.add_contact("a_0", "ground")
    with pytest.raises(nga.SceneError, match=r"geometry 'a_1': its mesh .*trunk.obj cannot be read"):
        scene.add_contact("a_1", "ground")


def test_a_scale_that_is_no_three_numbers_is_told_with_its_link(robot):
    robot.write_text(robot.read_text().replace("1 1 0.5", "1 1"))
    with pytest.raises(nga.SceneError, match=r"robot.urdf: link 'a': the scale '1 1' of its mesh"):
        read(robot)


def test_a_flat_mesh_becomes_a_plate(robot):
    (robot.parent / "trunk.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n")
    plate = read(robot).geometry("a_1")
    assert isinstance(plate.geometry, coal.ConvexBase) and plate.meshPath == ""


def distance_to_a_ball(geometry):
    """Of a mesh from a ball of radius 0.5 m about (0, 0, 3) [m]."""
    at = coal.Transform3s(np.eye(3), np.array([0.0, 0.0, 3.0])), coal.Transform3s.Identity()
    ask, answer = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(coal.Sphere(0.5), at[0], geometry.geometry, at[1], ask, answer)


@pytest.mark.parametrize("asked", ["geometry", "model"])
def test_a_mesh_of_contact_gets_its_tree_of_what_is_loaded_when_it_is_asked_for(robot, asked):
    theirs = coal.MeshLoader().load(str(robot.parent / "foot.obj"), np.array([1.0, 1.0, 0.5]))
    scene = read(robot)
    scene.add_contact("a_0", "ground")
    (robot.parent / "foot.obj").unlink()
    shapes = scene.declared_shapes.geometryObjects
    assert [g.geometry.getNodeType() == coal.NODE_TYPE.BV_AABB for g in shapes] == [True, False, False, True, False]
    found = scene.geometry("a_0") if asked == "geometry" else scene.collision_model.geometryObjects[0]
    assert found.geometry == theirs
    assert distance_to_a_ball(found) == pytest.approx(2.0, abs=1e-12)
    assert distance_to_a_ball(shapes[3]) == pytest.approx(2.0, abs=1e-12)


def test_a_tree_does_not_change_the_contacts(robot):
    scene = read(robot)
    scene.add_contact("a_0", "ground", mu=0.5)
    q0 = scene.place_on("ground", scene.reference())
    before = nga.simulate(scene, q0, t_end=5e-3, dt=1e-3)
    assert scene.collision_model.ngeoms == 5
    after = nga.simulate(scene, q0, t_end=5e-3, dt=1e-3)
    np.testing.assert_array_equal(before.q, after.q)
    assert after.contact_names == before.contact_names


def test_the_place_of_a_geometry_is_a_parameter_without_its_mesh(robot, loads):
    scene = read(robot)
    scene.add_contact("a_2", "ground")
    assert parameters_of(scene, ["placement[a_1]"])[0].values.tolist() == [0.0, 0.0, 1.0]
    assert loads == []
