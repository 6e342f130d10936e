"""What is read from MJCF files beside the equations of motion, and what is said of what is not."""

import builtins

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco_reference import FLAG, OWN, Reference, random_state

import ngalpha_pin as nga
from ngalpha_pin.scene.mjcf.compiler import Names
from ngalpha_pin.system.system import System

PATHS = {path.stem: path for path in OWN}


def test_coordinates_of_both_sides():
    model, rng = nga.Scene.from_mjcf(PATHS["free_bodies"]).model, np.random.default_rng(0)
    q, v = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)), rng.normal(size=model.nv)
    qpos = nga.q_to_mujoco(model, q)
    assert qpos[3] == q[6]
    np.testing.assert_array_equal(qpos[4:7], q[3:6])
    np.testing.assert_array_equal(nga.q_from_mujoco(model, qpos), q)
    qvel = nga.v_to_mujoco(model, q, v)
    np.testing.assert_allclose(qvel[:3], pin.Quaternion(q[3:7]).matrix() @ v[:3])
    np.testing.assert_allclose(nga.v_from_mujoco(model, q, qvel), v, atol=1e-15)
    with pytest.raises(nga.SceneError, match="the configuration has shape"):
        nga.q_from_mujoco(model, q[1:])
    for translate in (nga.q_to_mujoco, nga.q_from_mujoco):
        with pytest.raises(nga.SceneError, match="as scene.model"):
            translate(nga.Scene(model), q)
    with pytest.raises(nga.SceneError, match="as scene.model"):
        nga.v_to_mujoco(nga.Scene(model), q, v)


def test_keyframes_are_reference_configurations():
    scene = nga.Scene.from_mjcf(PATHS["keyframes"])
    assert set(scene.keyframes) == {"home", "standing", "qpos0"}
    np.testing.assert_allclose(scene.reference("home"), [0.1, 0.2, 0.5, 0.5, -0.5, 0.5, 0.5, 0, 0, 0, 1, 0.3])
    np.testing.assert_allclose(scene.reference(), scene.reference("standing"))
    with pytest.raises(nga.UnknownName, match="no reference configuration named 'hom'; did you mean 'home'"):
        scene.reference("hom")


def test_what_is_left_out_is_named_once():
    with pytest.warns(UserWarning) as caught:
        scene = nga.Scene.from_mjcf(PATHS["left_out"])
    assert len(caught) == 1
    kinds = {entry.what for entry in scene.contents if entry.fate in ("left out", "approximated")}
    words = str(caught[0].message)
    assert all(kind in words for kind in kinds)
    for kind, name in (
        ("gravcomp", "a"), ("mocap", "hand"), ("margin", "ga"), ("wind", ""),
        ("rolling friction", "ga"),
        ("spatial tendons", "cable"), ("tendon frictionloss", "bound"),
        ("actuators with a state of its own", "slow"), ("actuators on a ball or free joint", "twist"),
        ("actuators neither on a joint nor on a fixed tendon", "winch"), ("density of the medium", "1000"),
        ("viscosity of the medium", "0.1"),
    ):  # fmt: skip
        assert any(entry.what == kind and name in entry.reason for entry in scene.contents), kind
    assert {entry.what for entry in scene.contents if entry.fate == "no effect"} >= {"sensors", "solver options"}


@pytest.mark.parametrize("name", sorted(set(PATHS) - {"left_out"}))
def test_files_that_are_taken_whole_are_read_without_a_word(name):
    nga.Scene.from_mjcf(PATHS[name])


def test_actuators_follow_their_control():
    scene = nga.Scene.from_mjcf(PATHS["actuators"])
    assert list(scene.actuators) == ["motor", "servo", "speed", "any", "brake"]
    q, v = np.array([0.2, 0.1]), np.array([0.3, -0.4])
    scene.forces = [scene.actuators["motor"]]
    scene.actuators["motor"].ctrl = lambda t, q, v: 10.0 * q[0]  # clipped to 1
    bound = nga.Simulator(scene, 1e-3).system.controls[0]
    tau, K, D = np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2))
    bound.add_to(0.0, q, v, tau, K, D)
    np.testing.assert_allclose(tau, [3.0, 0.0])


def test_equalities_are_as_far_off_as_in_mujoco():
    """Translations of connect and weld, coordinates of joints and tendons, at random states."""
    path, rng = PATHS["equalities"], np.random.default_rng(4)
    scene = nga.Scene.from_mjcf(path)
    assert [c.name for c in scene.constraints] == ["pin", "pins", "glue", "gear", "lock", "ropes", "rope"]
    reference, system = Reference(path, scene.model), System(scene)
    reference.m.opt.disableflags &= ~int(FLAG.mjDSBL_CONSTRAINT)
    still = np.zeros(system.nv)
    for _ in range(20):
        q, v = random_state(scene.model, rng)
        reference.place(q, v)
        d = reference.d
        rows, names = np.flatnonzero(d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY), Names(reference.m).equalities
        system.dynamics(0.0, q, still, still)
        g, _ = system.constraint_rows(0.0, q, still, still).whole(system.motion(still, still))
        for name in dict.fromkeys(system.constraints.names_of_every_g):
            own = [x for x, other in zip(g, system.constraints.names_of_every_g, strict=True) if other == name][:3]
            theirs = [d.efc_pos[i] for i in rows if names[d.efc_id[i]] == name][:3]
            assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(theirs), rel=1e-10, abs=1e-12)


def test_contacts_of_the_file_act():
    """A ball of the file lands on the floor of the file, with the friction of the file."""
    scene = nga.Scene.from_mjcf(PATHS["contact_masks"])
    laws = {tuple(sorted(pair.key)): pair.law for pair in scene.contacts}
    assert laws["floor", "gd2"].mu == 0.9
    assert laws["ga", "gb"].mu == 0.7
    assert laws["gb", "gd"].mu == 0.0
    q = scene.reference("qpos0")
    run = nga.simulate(scene, q, t_end=0.6, dt=2e-3)
    assert run.audit().ok
    assert run.q[-1][2] == pytest.approx(0.1, abs=1e-9)
    assert scene.add_contact("*", "*") == scene.contacts
    with pytest.raises(nga.SceneError, match="is declared already"):
        scene.add_contact("*", "*", mu=0.3)


def test_without_mujoco_the_extra_is_named(monkeypatch):
    original = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "mujoco":
            raise ImportError(name)
        return original(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(nga.SceneError, match=r"pip install 'ngalpha-pin\[mjcf\]'"):
        nga.Scene.from_mjcf(PATHS["moon"])


def test_visual_geometries_are_those_of_the_first_groups_on_their_bodies():
    scene = nga.Scene.from_mjcf(PATHS["terrain"])
    visual = scene.visual_model
    stone = visual.geometryObjects[visual.getGeometryId("stone")]
    assert stone.geometry.num_tris > 3
    assert stone.parentJoint == scene.geometry("stone").parentJoint
    np.testing.assert_allclose(stone.placement.homogeneous, scene.geometry("stone").placement.homogeneous)


def test_the_flag_of_constraints_switches_off_all_kinds():
    scene = nga.Scene.from_mjcf(PATHS["no_constraints"])
    assert (scene.contacts, scene.constraints) == ([], [])
    assert not scene.model.upperDryFrictionLimit.any()
    assert np.isinf(scene.model.upperPositionLimit).all()
    assert len(scene.forces) == 1  # its spring stays


def test_a_part_that_other_files_include_is_said_to_be_one(tmp_path):
    path = tmp_path / "part.xml"
    path.write_text("<mujocoinclude><worldbody/></mujocoinclude>")
    with pytest.raises(nga.SceneError, match="part.xml is a part of MJCF files, which include it"):
        nga.Scene.from_mjcf(path)
