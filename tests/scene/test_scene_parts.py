"""Scenes from parts, where they start, and their way to another process."""

import pickle
import subprocess
import sys

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import random_inertia

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.system.system import System

ARM = robots.__path__[0] + "/urdf/arm.urdf"


def at(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def random_tree(n, seed):
    """A tree of n joints with everything that a model says of them."""
    rng, model = np.random.default_rng(seed), pin.Model()
    kinds = (pin.JointModelRX, pin.JointModelPY, pin.JointModelFreeFlyer, pin.JointModelRUBZ, pin.JointModelSpherical)
    on = 0
    for i in range(n):
        placement = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        on = model.addJoint(on, kinds[i % len(kinds)](), placement, f"j{i}")
        model.appendBodyToJoint(on, random_inertia(rng), pin.SE3.Identity())
        model.addJointFrame(on)
        model.addFrame(pin.Frame(f"l{i}", on, placement, pin.FrameType.BODY), False)
        on = on if i % 3 else 0
    for name in ("armature", "damping", "upperDryFrictionLimit", "upperEffortLimit", "rotorGearRatio"):
        setattr(model, name, rng.uniform(1, 2, model.nv))
    model.lowerPositionLimit, model.upperPositionLimit = -rng.uniform(1, 2, model.nq), rng.uniform(1, 2, model.nq)
    model.referenceConfigurations["start"] = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    return model


@pytest.mark.parametrize("parent", [None, "l1"])
def test_a_model_in_another_one_moves_as_alone(parent):
    """In the world both have their own equations; on a link, positions are those of a frame carried along."""
    scene, part, rng = nga.Scene(random_tree(4, 0)), random_tree(5, 1), np.random.default_rng(2)
    alone = scene.model
    place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    assert scene.add_model(part, "right", place, parent=parent) == "right/"
    model = scene.model
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))

    def own(of, prefix):
        ids = [(of.idx_qs[j], of.nqs[j], model.getJointId(prefix + of.names[j])) for j in range(1, of.njoints)]
        return np.concatenate([q[model.idx_qs[k] : model.idx_qs[k] + n] for _, n, k in ids])

    data, data_a, data_b = model.createData(), alone.createData(), part.createData()
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(alone, data_a, own(alone, ""))
    pin.framesForwardKinematics(part, data_b, own(part, "right/"))
    carried = place if parent is None else data_a.oMf[alone.getFrameId(parent)] * place
    for frame in list(part.frames)[1:]:
        found = data.oMf[model.getFrameId("right/" + frame.name, frame.type)]
        right = carried * data_b.oMf[part.getFrameId(frame.name, frame.type)]
        np.testing.assert_allclose(found.homogeneous, right.homogeneous, atol=1e-12)
    for of, prefix in ((alone, ""), (part, "right/")):
        for j in range(1, of.njoints):
            k = model.getJointId(prefix + of.names[j])
            assert model.inertias[k] == of.inertias[j]
            for name in ("armature", "damping", "upperDryFrictionLimit", "upperEffortLimit", "rotorGearRatio"):
                i, n = model.idx_vs[k], of.nvs[j]
                given = getattr(of, name)[of.idx_vs[j] : of.idx_vs[j] + n]
                np.testing.assert_array_equal(getattr(model, name)[i : i + n], given)
    assert set(scene.keyframes) == {"start", "right/start"}
    for subtree in model.subtrees:
        assert len(subtree) == 0 or subtree[-1] - subtree[0] == len(subtree) - 1
    if parent is None:
        M = System(scene).mass_matrix(q)
        assert np.abs(M[: alone.nv, alone.nv :]).max() == 0.0


@pytest.mark.parametrize("parent", [None, "base"])
def test_what_ties_a_part_to_its_world_is_placed_with_it(parent):
    """A pendulum on a pin of its world, pulled by a spring that is fixed there, swings where it is placed as alone."""
    part = nga.Scene()
    part.add_body("rod", coal.Box(0.4, 0.05, 0.05), mass=1.0)
    part.add_constraint(nga.PointJoint("rod", "world", placement_a=at(-0.2, 0, 0), placement_b=at(0, 0, 1)))
    part.add_force(nga.Spring("world", "rod", 30.0, 0.1, placement_a=at(0.3, 0.2, 0.5)))
    q0, v0 = np.array([0.2, 0, 1, 0, 0, 0, 1.0]), np.zeros(6)
    alone = nga.simulate(part, q0, v0, t_end=0.1, dt=5e-3)
    scene, place = nga.Scene(), pin.SE3(pin.utils.rotate("z", 0.7), np.array([1.0, -2.0, 0.5]))
    if parent is not None:
        model = pin.Model()
        model.addFrame(pin.Frame("base", 0, at(0, 3, 0), pin.FrameType.OP_FRAME))
        scene = nga.Scene(model)
    scene.add_model(part, "left", place, parent=parent)
    placed = nga.simulate(scene, q0, v0, t_end=0.1, dt=5e-3)
    np.testing.assert_allclose(placed.q, alone.q, atol=1e-10)


def test_a_given_motion_is_placed_with_its_part():
    part = nga.Scene()
    part.add_body("cart", coal.Box(0.2, 0.2, 0.2), mass=1.0)
    part.add_constraint(nga.FrameTrajectory("cart", lambda t: at(t, 0.0, 0.0)))
    scene, place = nga.Scene(), pin.SE3(pin.utils.rotate("z", np.pi / 2), np.array([1.0, 0.0, 0.0]))
    scene.add_model(part, "left", place)
    start = nga.assemble(scene, pin.neutral(scene.model))
    run = nga.simulate(scene, start.q, start.v, t_end=0.1, dt=1e-2)
    np.testing.assert_allclose(run.frame("left/cart").position[-1], [1.0, 0.1, 0.0], atol=1e-9)
    model = pin.Model()
    model.addJointFrame(model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "base"))
    with pytest.raises(nga.SceneError, match="its poses are in the world; add it after the parts are together"):
        nga.Scene(model).add_model(part, "left", place, parent="base")


def test_a_removed_body_leaves_the_model_of_before():
    scene = nga.Scene(random_tree(4, 0))
    before = scene.model
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=2.0)
    scene.add_body("box", coal.Box(0.1, 0.2, 0.3), density=1000.0, placement=at(1, 0, 0))
    scene.add_contact("ball", "ground")
    scene.add_constraint(nga.PointJoint("ball", "box", name="pin"))
    with pytest.raises(
        nga.SceneError, match="'ball' cannot be removed: PointJoint pin needs it: no frame named 'ball'"
    ):
        scene.remove("ball")
    scene.remove("pin")
    scene.remove("ball")
    assert scene.contacts == []
    scene.remove("box")
    scene.remove("ground")
    assert scene.collision_model.ngeoms == 0
    model = scene.model
    assert list(model.names) == list(before.names)
    assert list(model.parents) == list(before.parents)
    assert list(model.jointPlacements) == list(before.jointPlacements)
    assert list(model.inertias) == list(before.inertias)
    assert [(f.name, f.parentJoint) for f in model.frames] == [(f.name, f.parentJoint) for f in before.frames]
    for name in ("armature", "lowerPositionLimit", "upperDryFrictionLimit", "upperEffortLimit"):
        np.testing.assert_array_equal(getattr(model, name), getattr(before, name))
    with pytest.raises(nga.UnknownName, match="no constraint, force, body or geometry named 'ball'"):
        scene.remove("ball")


def test_bodies_on_joints_make_the_model_that_pin_makes():
    """A cart with a pendulum on it, and a lamp that is fixed to the pendulum."""
    scene = nga.Scene()
    scene.add_body("cart", coal.Box(0.4, 0.2, 0.1), mass=2.0, placement=at(0, 0, 1), joint=pin.JointModelPX())
    arm = {"joint": pin.JointModelRY(), "parent": "cart"}
    scene.add_body("arm", coal.Capsule(0.05, 0.4), mass=1.0, placement=at(0, 0.3, 0), **arm)
    scene.add_body("lamp", coal.Sphere(0.1), placement=at(0, 0, -0.3), free=False, parent="arm")
    model = pin.Model()
    cart = model.addJoint(0, pin.JointModelPX(), at(0, 0, 1), "cart")
    model.appendBodyToJoint(cart, pin.Inertia.FromBox(2.0, 0.4, 0.2, 0.1), pin.SE3.Identity())
    hung = model.addJoint(cart, pin.JointModelRY(), at(0, 0.3, 0), "arm")
    model.appendBodyToJoint(hung, pin.Inertia.FromCapsule(1.0, 0.05, 0.4), pin.SE3.Identity())
    q, v, a = (np.array(x) for x in ([0.3, 0.7], [0.5, -2.0], [1.0, 3.0]))
    expected = pin.rnea(model, model.createData(), q, v, a)
    np.testing.assert_allclose(pin.rnea(scene.model, scene.model.createData(), q, v, a), expected, atol=1e-13)
    geometry = scene.collision_model.geometryObjects[scene.collision_model.getGeometryId("lamp")]
    assert scene.model.names[geometry.parentJoint] == "arm"
    np.testing.assert_allclose(geometry.placement.translation, [0, 0, -0.3])


@pytest.mark.parametrize(
    ("shape", "right"),
    [
        (coal.Sphere(0.1), pin.Inertia.FromSphere(2.0, 0.1)),
        (coal.Box(0.1, 0.2, 0.3), pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)),
        (coal.Capsule(0.1, 0.4), pin.Inertia.FromCapsule(2.0, 0.1, 0.4)),
        (coal.Ellipsoid(0.1, 0.2, 0.3), pin.Inertia.FromEllipsoid(2.0, 0.1, 0.2, 0.3)),
        (coal.Cylinder(0.1, 0.4), pin.Inertia.FromCylinder(2.0, 0.1, 0.4)),
        (coal.Cone(0.1, 0.4), pin.Inertia(2.0, np.array([0, 0, -0.1]), np.diag([0.015, 0.015, 0.006]))),
    ],
)
def test_a_body_has_the_inertia_of_its_shape(shape, right):
    scene = nga.Scene()
    scene.add_body("body", shape, mass=2.0)
    scene.add_body("other", shape, density=2.0 / shape.computeVolume())
    for inertia in list(scene.model.inertias)[1:]:
        np.testing.assert_allclose(inertia.toDynamicParameters(), right.toDynamicParameters(), atol=1e-12)


def test_bodies_that_cannot_be():
    scene = nga.Scene()
    for message, call in (
        ("takes either its mass", lambda: scene.add_body("b", coal.Sphere(0.1))),
        ("fixed has no joint", lambda: scene.add_body("b", coal.Sphere(0.1), free=False, joint=pin.JointModelPX())),
        ("must be a joint of pin", lambda: scene.add_body("b", coal.Sphere(0.1), mass=1.0, joint="PX")),
        ("mass = -1.0: expected a positive number", lambda: scene.add_body("b", coal.Sphere(0.1), mass=-1.0)),
        ("a Halfspace has no volume", lambda: scene.add_body("b", coal.Halfspace(np.array([0, 0, 1.0]), 0.0), mass=1)),
        ("takes the path of a URDF or MJCF file", lambda: scene.add_model(3)),
        ("has something named", lambda: [scene.add_model(random_tree(3, 0)) for _ in range(2)]),
    ):
        with pytest.raises(nga.SceneError, match=message):
            call()


def bench():
    """Two arms, a table, a box and a ball."""
    scene = nga.Scene()
    scene.add_model(ARM, "left", at(-0.8, 0, 0.8))
    scene.add_model(ARM, "right", at(0.8, 0, 0.8))
    scene.add_body("table", coal.Box(1.2, 0.8, 0.05), placement=at(0, 0, 0.775), free=False)
    scene.add_body("box", coal.Box(0.1, 0.1, 0.1), mass=0.5, placement=at(0, 0.2, 1.0))
    scene.add_body("ball", coal.Sphere(0.05), density=500.0, placement=at(0.3, 0.2, 1.0))
    for body in ("box", "ball"):
        scene.add_contact(body, "table", mu=0.5)
    q0 = scene.place_on("table", scene.reference(), root="box")
    q0 = scene.place_on("table", q0, clearance=0.1, root="ball")
    scene.add_force(nga.JointPD(q0, kp=200.0, kd=20.0))
    return scene, q0


def test_two_arms_a_table_a_box_and_a_ball():
    scene, q0 = bench()
    run = nga.simulate(scene, q0, t_end=0.3, dt=2e-3)
    assert run.audit().ok
    box, ball = (scene.model.idx_qs[scene.model.getJointId(name)] for name in ("box", "ball"))
    np.testing.assert_allclose(np.ptp(run.q[:, box : box + 3], axis=0), 0.0, atol=1e-10)
    assert 1.0 + run.q[0, ball + 2] == pytest.approx(0.95, abs=1e-12)
    assert 1.0 + run.q[-1, ball + 2] == pytest.approx(0.85, abs=1e-9)


def test_placed_on_a_slope_and_on_terrain_it_just_touches():
    for add in (
        lambda s: s.add_plane("soil", normal=(0.3, 0.1, 1.0)),
        lambda s: s.add_height_field("soil", np.array([[0, 0.1, 0], [0.2, 0.4, 0.1], [0, 0, 0.3]]), (2, 2)),
        lambda s: s.add_body("soil", coal.Sphere(1.0), free=False),
    ):
        scene = nga.Scene()
        scene.add_body(
            "box",
            coal.Box(0.1, 0.2, 0.3),
            mass=1.0,
            placement=pin.SE3(pin.exp3(np.array([0.3, 0.5, 0])), np.array([0.1, 0.2, 3.0])),
        )
        add(scene)
        scene.add_contact("box", "soil*")
        for clearance in (0.0, 0.05):
            q = scene.place_on("soil*", scene.q_ref, clearance)
            state = nga.Simulator(scene, 1e-3).initial_state(q)
            run = nga.simulate(scene, state=state, t_end=1e-4, dt=1e-4)
            assert run.contact_motion.smallest_gap[0] == pytest.approx(clearance, abs=1e-9)


def test_place_on_asks_for_the_root_where_several_move_freely():
    scene, q0 = bench()
    with pytest.raises(nga.SceneError, match="place_on: name one of the roots box, ball"):
        scene.place_on("table", q0)
    with pytest.raises(nga.UnknownName, match="no root that moves freely named 'bll'; did you mean 'ball'"):
        scene.place_on("table", q0, root="bll")
    scene.forces.clear()
    scene.add_body("tile", coal.Box(0.1, 0.1, 0.01), mass=1.0, placement=at(5, 5, 1))
    with pytest.raises(nga.SceneError, match="nothing of 'tile' comes down on 'table'"):
        scene.place_on("table", scene.q_ref, root="tile")


def test_patterns_count_upper_and_lower_case_as_the_same_and_say_so():
    scene = nga.Scene()
    for name in ("LF_FOOT", "rf_foot", "LF_CALF", "trunk"):
        scene.add_geometry(name, coal.Sphere(0.1))
    with pytest.warns(UserWarning, match=r"geometry '\*foot\*' matches LF_FOOT only without regard to case"):
        assert scene.geometries("*foot*") == ["LF_FOOT", "rf_foot"]
    assert scene.geometries("LF_*") == ["LF_FOOT", "LF_CALF"]
    with pytest.raises(nga.UnknownName, match=r"no geometry matches '\*feet_calves\*'; known"):
        scene.geometries("*feet_calves*")
    with pytest.raises(nga.UnknownName, match=r"no geometry matches '\*foots\*'; the nearest: .*'LF_FOOT'.* \(of 4\)"):
        scene.geometries("*foots*")


def test_a_scene_its_errors_and_its_runs_go_from_process_to_process():
    scene, q0 = bench()
    error = pickle.loads(pickle.dumps(nga.NotConverged("words", 0.5, ("a/b",))))
    assert (str(error), error.t, error.contacts) == ("words", 0.5, ("a/b",))
    for other in (nga.UnknownName("joint", "knee", ["hip"]), nga.Penetration("deep"), nga.SceneError("no")):
        assert str(pickle.loads(pickle.dumps(other))) == str(other)
    run = nga.simulate(scene, q0, t_end=0.05, dt=1e-3)
    run.audit()
    script = (
        "import pickle, sys, ngalpha_pin as nga\n"
        "scene, q0 = pickle.loads(sys.stdin.buffer.read())\n"
        "run = nga.simulate(scene, q0, t_end=0.05, dt=1e-3)\n"
        "sys.stdout.buffer.write(pickle.dumps(run))"
    )
    there = subprocess.run([sys.executable, "-c", script], input=pickle.dumps((scene, q0)), capture_output=True)
    back = pickle.loads(there.stdout)
    assert np.array_equal(back.q, run.q)
    assert np.array_equal(back.P_N, run.P_N)
    assert back.audit().ok
    assert [type(force).__name__ for force in back.scene.forces] == ["JointPD"]
