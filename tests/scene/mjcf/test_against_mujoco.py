"""A scene of an MJCF file is what MuJoCo makes of the file: energies, mass matrix, forces, limits, pairs, motion."""

import sys
import warnings
from pathlib import Path

import coal
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco_reference import FLAG, GYMNASIUM, OWN, Reference, quantities, random_state

import ngalpha_pin as nga
from ngalpha_pin.scene.mjcf.compiler import compiled

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
import mjcf_motion

sys.path.pop(0)

FILES = [*OWN, *GYMNASIUM]
COMPARED = [path for path in FILES if path.stem != "left_out"]
STATES = 20
by_name = pytest.mark.parametrize("path", COMPARED, ids=lambda path: path.stem)


def read(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is left out is tested by its words
        return nga.Scene.from_mjcf(path)


@by_name
def test_energies_mass_matrix_and_forces(path):
    scene, rng = read(path), np.random.default_rng(0)
    reference = Reference(path, scene.model)
    for i, actuator in enumerate(scene.actuators.values()):
        actuator.ctrl = reference.d.ctrl[i] = rng.normal()
    scene.constraints.clear()
    scene.unilaterals.clear()
    for _ in range(STATES):
        q, v = random_state(scene.model, rng)
        reference.place(q, v)
        for found, right in zip(quantities(scene, q, v), reference.quantities(), strict=True):
            assert np.abs(found - right).max() <= 1e-12 * max(1.0, np.abs(right).max())


@by_name
def test_frames_are_where_the_bodies_and_sites_are(path):
    scene, rng = read(path), np.random.default_rng(1)
    reference, data = Reference(path, scene.model), scene.model.createData()
    q, v = random_state(scene.model, rng)
    reference.place(q, v)
    pin.framesForwardKinematics(scene.model, data, q)
    bodies = [f for f in scene.model.frames if f.type == pin.FrameType.BODY]
    assert len(bodies) == reference.m.nbody - 1
    for i, frame in enumerate(bodies, start=1):
        pose = data.oMf[scene.model.getFrameId(frame.name, frame.type)]
        np.testing.assert_allclose(pose.translation, reference.d.xpos[i], atol=1e-12)
        np.testing.assert_allclose(pose.rotation, reference.d.xmat[i].reshape(3, 3), atol=1e-12)
    sites = [f for f in scene.model.frames if f.type == pin.FrameType.OP_FRAME]
    for i, frame in enumerate(sites):
        pose = data.oMf[scene.model.getFrameId(frame.name, frame.type)]
        np.testing.assert_allclose(pose.translation, reference.d.site_xpos[i], atol=1e-12)


@by_name
def test_joint_properties(path):
    model = read(path).model
    m, _ = compiled(path)
    on = {flag: not m.opt.disableflags & getattr(FLAG, f"mjDSBL_{flag}") for flag in ("GRAVITY", "LIMIT", "DAMPER")}
    on["LIMIT"] &= not m.opt.disableflags & FLAG.mjDSBL_CONSTRAINT
    np.testing.assert_array_equal(model.gravity.linear, m.opt.gravity * on["GRAVITY"])
    np.testing.assert_array_equal(model.damping, m.dof_damping * on["DAMPER"])
    np.testing.assert_array_equal(model.armature, m.dof_armature)
    for j in range(m.njnt):
        name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_JOINT, j)
        if m.jnt_type[j] >= 2 and name:
            i = model.idx_qs[model.getJointId(name)]
            limited = m.jnt_limited[j] and on["LIMIT"]
            found = model.lowerPositionLimit[i], model.upperPositionLimit[i]
            assert found == (tuple(m.jnt_range[j]) if limited else (-np.inf, np.inf))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_pairs_that_may_touch_and_their_friction(path):
    scene = read(path)
    geoms = {g.name for g in scene.collision_model.geometryObjects}

    def geom(name):
        return "ground" if path.stem == "terrain" and name.startswith("ground_") else name

    limits = {f"{name}_end" for name in Reference(path, scene.model).names.tendons}
    found = {frozenset(map(geom, pair.key)): pair.law.mu for pair in scene.contacts if not pair.key & limits}
    assert found == Reference(path, scene.model).pairs(path)
    assert {name for pair in scene.contacts for name in pair.key} <= geoms


@pytest.mark.parametrize("path", mjcf_motion.files(), ids=lambda path: path.stem)
def test_smooth_motion(path):
    """A fifth of a second without contact against Runge-Kutta steps of 5e-5 s; the benchmark runs it for a second."""
    model, q, v, end = mjcf_motion.own(path, 0.2, 1e-11, seed=2)
    assert mjcf_motion.distance(model, end, mjcf_motion.reference(path, model, q, v, 0.2, 5e-5)) < 1e-8


def test_terrain_has_the_surface_that_rays_of_mujoco_meet():
    path = next(p for p in OWN if p.stem == "terrain")
    scene, rng = read(path), np.random.default_rng(3)
    m, _ = compiled(path)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    pieces = [g for g in scene.collision_model.geometryObjects if g.name.startswith("ground")]
    ball, geom = coal.Sphere(1e-3), np.zeros(1, dtype=np.int32)
    for _ in range(50):
        start = np.array([*rng.uniform(-1, 1, 2) * (1.9, 1.4) + (0.1, 0.2), 5.0])
        z = 5.0 - mujoco.mj_ray(m, d, start, np.array([0.0, 0.0, -1.0]), None, 1, -1, geom)
        if geom[0] != 0:
            continue  # a body above the terrain
        at = coal.Transform3s(np.eye(3), np.array([start[0], start[1], z]))
        distances = []
        for piece in pieces:
            pose = coal.Transform3s(piece.placement.rotation, piece.placement.translation)
            distances.append(
                coal.distance(ball, at, piece.geometry, pose, coal.DistanceRequest(), coal.DistanceResult())
            )
        assert min(distances) == pytest.approx(-1e-3, abs=1e-6)
