"""The same scene in millimetres, grams and milliseconds takes the same iterations and gives the same motion."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

LENGTH, MASS, TIME = 1e3, 1e3, 1e3
"""Small units in one of SI: mm in m, g in kg, ms in s."""
FORCE = MASS * LENGTH / TIME**2
CASES = {
    "rotating_ball": (2e-3, 1.0),
    "tippe_top": (1e-3, 0.3),
    "quadruped": (2e-3, 0.3),
    "ball_in_cylinder": (1e-2, 1.0),
}
"""dt and t_end in s."""


def scaled_model(model):
    """The same tree with lengths in mm, masses in g and time in ms."""
    small = model.copy()
    small.gravity.linear = model.gravity.linear * LENGTH / TIME**2
    for j in range(model.njoints):
        X, Y = model.jointPlacements[j], model.inertias[j]
        small.jointPlacements[j] = pin.SE3(X.rotation, X.translation * LENGTH)
        small.inertias[j] = pin.Inertia(Y.mass * MASS, Y.lever * LENGTH, Y.inertia * MASS * LENGTH**2)
    torque = MASS * LENGTH**2 / TIME**2
    for joint in list(model.joints)[1:]:
        if joint.nv == 1 and model.upperEffortLimit[joint.idx_v] < 1e300:
            for bound in (small.lowerEffortLimit, small.upperEffortLimit):
                bound[joint.idx_v] *= torque
    return small


def scaled_shape(shape):
    if isinstance(shape, coal.Sphere):
        return coal.Sphere(shape.radius * LENGTH)
    if isinstance(shape, coal.Cylinder):
        return coal.Cylinder(shape.radius * LENGTH, 2 * shape.halfLength * LENGTH)
    return coal.Halfspace(np.array(shape.n), shape.d * LENGTH)


def is_linear(model):
    """Where a velocity coordinate is a length per time, shape (nv,)."""
    data = model.createData()
    S = pin.computeJointJacobians(model, data, pin.neutral(model))
    own = np.zeros(model.nv, dtype=bool)
    for joint in list(model.joints)[1:]:
        for i in range(joint.idx_v, joint.idx_v + joint.nv):
            own[i] = not np.abs(S[3:, i]).any()
    return own


def scaled(scene, q0, v0):
    """The scene and its initial values in small units, and the factors of q and v."""
    model = scene.model
    small = nga.Scene(scaled_model(model))
    used = {name for p in scene.contacts for name in (p.geometry_a, p.geometry_b)}
    for g in scene.collision_model.geometryObjects:
        if g.name in used:
            shape = scaled_shape(g.geometry)
            X = g.placement
            copy = pin.GeometryObject(g.name, g.parentJoint, pin.SE3(X.rotation, X.translation * LENGTH), shape)
            small.collision_model.addGeometryObject(copy)
    small.hollow = set(scene.hollow)
    for p in scene.contacts:
        law = p.law
        small.add_contact(
            p.geometry_a, p.geometry_b, law.mu, law.e_N, law.e_F, contact_radius=law.contact_radius * LENGTH
        )
    linear = is_linear(model)
    by_v = np.where(linear, LENGTH, 1.0) / TIME
    by_q = np.ones(model.nq)
    for joint in list(model.joints)[1:]:
        # positions come first in the joints that have them
        by_q[joint.idx_q : joint.idx_q + int(linear[joint.idx_v : joint.idx_v + joint.nv].sum())] = LENGTH
    for force in scene.forces:
        # the torques of revolute joints
        kp, kd = force.kp * FORCE * LENGTH, force.kd * FORCE * LENGTH * TIME
        small.add_force(nga.JointPD(force.q_ref * by_q, kp, kd))
    return small, q0 * by_q, v0 * by_v, by_q, by_v


@pytest.mark.parametrize("laws", ["second-order", "paper"])
@pytest.mark.parametrize("name", CASES)
def test_same_iterations_and_same_motion_in_other_units(name, laws):
    dt, t_end = CASES[name]
    parameters = {"quadruped": {"height": 0.05}}.get(name, {})
    scene, q0, v0 = robots.load(name, **parameters)
    method = nga.GeneralizedAlpha(rho_inf=0.5, laws=laws)
    large = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method)
    small_scene, q0, v0, by_q, by_v = scaled(scene, q0, v0)
    small = nga.simulate(small_scene, q0, v0, t_end=t_end * TIME, dt=dt * TIME, method=method)
    # where Newton's index sets run in circles, rounding decides how long
    direct = ~np.isin(large.solver_path, ("fixed-point", "minimum-norm"))
    assert direct.sum() >= len(direct) - 2
    assert np.array_equal(small.n_iter[direct], large.n_iter[direct])
    assert np.array_equal(small.solver_path, large.solver_path)
    q, v = small.q / by_q, small.v / by_v
    assert np.abs(q - large.q).max() < 1e-9 * np.abs(large.q).max()
    assert np.abs(v - large.v).max() < 1e-9 * np.abs(large.v).max()
    assert np.abs(small.P_N / (FORCE * TIME) - large.P_N).max() < 1e-9 * np.abs(large.P_N).max()
    assert (large.P_N > 0).any()


@pytest.mark.parametrize("name", CASES)
def test_same_events_in_other_units(name):
    dt, t_end = CASES[name]
    scene, q0, v0 = robots.load(name, **{"quadruped": {"height": 0.05}}.get(name, {}))
    large = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt)
    small_scene, q0, v0, _, _ = scaled(scene, q0, v0)
    small = nga.simulate(small_scene, q0, v0, t_end=t_end * TIME, dt=dt * TIME)
    assert [(e.kind, e.contact) for e in small.events] == [(e.kind, e.contact) for e in large.events]


def test_audit_in_other_units_says_the_same():
    scene, q0, v0 = robots.load("rotating_ball")
    large = nga.simulate(scene, q0, v0, t_end=1.0, dt=2e-3).audit()
    small_scene, q0, v0, _, _ = scaled(scene, q0, v0)
    small = nga.simulate(small_scene, q0, v0, t_end=1.0 * TIME, dt=2e-3 * TIME).audit()
    assert [row.ok for row in small.rows()] == [row.ok for row in large.rows()]
    assert small.energy_change == pytest.approx(large.energy_change * FORCE * LENGTH, rel=1e-9)
