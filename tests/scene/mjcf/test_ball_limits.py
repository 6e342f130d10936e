"""Ranges of ball joints: distances are MuJoCo's, an arm falls onto its range, and they go along with their model."""

import pickle

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco_reference import OWN

import ngalpha_pin as nga
from ngalpha_pin.scene.length_limits import BallLimit
from ngalpha_pin.scene.mjcf.ball_limits import ball_limits
from ngalpha_pin.scene.mjcf.compiler import Names, compiled

STEP = 1e-6  # of differences [rad]
PATH = next(path for path in OWN if path.stem == "ball_ranges")


def test_distances_and_their_directions_are_those_of_mujoco():
    """MuJoCo has a row for those that are beyond their end: its distance and its derivative by the velocity."""
    scene, rng = nga.Scene.from_mjcf(PATH), np.random.default_rng(0)
    assert [own.name for own in scene.unilaterals] == ["shoulder_range", "wrist_range"]
    m, _ = compiled(PATH)
    d, model, seen = mujoco.MjData(m), scene.model, 0
    for _ in range(40):
        q = pin.integrate(model, pin.neutral(model), 2.5 * rng.normal(size=6))
        d.qpos[:] = nga.q_to_mujoco(model, q)
        mujoco.mj_forward(m, d)
        beyond = [own for own in scene.unilaterals if own.gap.function(0.0, q) < 0.0]
        rows = [i for i in range(d.nefc) if d.efc_type[i] == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT]
        assert len(rows) == len(beyond)
        for i, own in zip(rows, beyond, strict=True):
            seen += 1
            assert own.gap.function(0.0, q) == pytest.approx(d.efc_pos[i], abs=1e-12)
            ways = [[own.gap.function(0.0, pin.integrate(model, q, s * STEP * e)) for s in (1, -1)] for e in np.eye(6)]
            slope = np.array([(ahead - behind) / (2 * STEP) for ahead, behind in ways])
            np.testing.assert_allclose(slope, d.efc_J.reshape(d.nefc, 6)[i], atol=1e-8)
    assert seen > 20


def test_an_arm_falls_onto_its_range_and_stays_there():
    """In the plane of the drawing, from 20 degrees by 50 more: the moment of the weight is what the limit has."""
    scene = nga.Scene.from_mjcf(PATH)
    scene.forces.clear()
    scene.remove("wrist_range")
    scene.remove("wrist")
    run = nga.simulate(scene, pin.neutral(scene.model), t_end=0.6, dt=5e-3)
    assert run.audit().ok and any(event.kind == "impact" for event in run.events)
    turned = float(np.linalg.norm(pin.difference(scene.model, pin.neutral(scene.model), run.q[-1][:4])))
    assert turned == pytest.approx(np.radians(50.0), abs=1e-9) and run.g_N.min() > -1e-9
    assert np.abs(run.v[-1][:3]).max() < 1e-9
    assert run.la_N[-1, 0] == pytest.approx(9.81 * 0.3 * np.cos(np.radians(70.0)), rel=1e-6)


def test_it_goes_along_with_its_model_and_through_pickle():
    part = nga.Scene.from_mjcf(PATH)
    scene = nga.Scene()
    scene.add_model(part, "left")
    scene.add_model(part, "right")
    scene = pickle.loads(pickle.dumps(scene))
    q = pin.integrate(scene.model, pin.neutral(scene.model), np.linspace(-1.0, 1.5, 12))
    gaps = {own.name: own.gap.function(0.0, q) for own in scene.unilaterals}
    for side, own_q in (("left", q[:8]), ("right", q[8:])):
        for own in part.unilaterals:
            assert gaps[f"{side}/{own.name}"] == own.gap.function(0.0, own_q)


def test_none_where_limits_are_switched_off(tmp_path):
    file = tmp_path / "off.xml"
    file.write_text(PATH.read_text().replace("<worldbody>", '<option><flag limit="disable"/></option><worldbody>', 1))
    m, _ = compiled(file)
    assert ball_limits(m, Names(m)) == []


def test_an_unknown_joint_is_refused():
    with pytest.raises(nga.UnknownName, match="did you mean 'shoulder'"):
        nga.Scene.from_mjcf(PATH).add_unilateral(BallLimit("shoulde", "own", 1.0))
