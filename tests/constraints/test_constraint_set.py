"""Rows of every kind of constraint against finite differences along motions and in all coordinates."""

import numpy as np
import pinocchio as pin
import pytest
from constraint_scenes import KINDS, motion_of, tree, with_geometries

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

T = 0.3


def system_with(*names):
    scene = nga.Scene(tree())
    with_geometries(scene)
    for name in names:
        scene.add_constraint(KINDS[name]())
    return System(scene)


def rows_at(system, t, q, v, a):
    system.dynamics(t, q, v, a)
    return system.constraint_rows(t, q, v, a)


def assert_rows(system, q, v, a):
    model, kb = system.model, system.constraints.kb
    rows = rows_at(system, T, q, v, a)
    h = 1e-5

    def along(s):
        return rows_at(system, T + s, pin.integrate(model, q, s * v + s * s / 2 * a), v + s * a, a)

    g_dot = (along(h).g - along(-h).g) / (2 * h)
    np.testing.assert_allclose(rows.rate[:kb], g_dot, atol=2e-8 * max(1, abs(g_dot).max(initial=0)))
    change = (along(h).rate - along(-h).rate) / (2 * h)
    np.testing.assert_allclose(rows.acceleration, change, atol=1e-7 * max(1, abs(change).max()))

    def by_q(i, name):
        e = h * np.eye(model.nv)[i]
        plus, minus = (rows_at(system, T, pin.integrate(model, q, s * e), v, a) for s in (1, -1))
        return (getattr(plus, name) - getattr(minus, name)) / (2 * h)

    def by_v(i, name):
        e = np.eye(model.nv)[i]
        plus, minus = (rows_at(system, T, q, v + s * e, a) for s in (1, -1))
        return (getattr(plus, name) - getattr(minus, name)) / 2

    rows = rows_at(system, T, q, v, a)
    motion = system.motion(v, a)
    X, Y = rows.derivatives(motion)
    columns = range(model.nv)
    W_g = np.stack([by_q(i, "g") for i in columns], axis=1)
    W = np.stack([by_v(i, "rate") for i in columns], axis=1)
    size = max(1, abs(W).max())
    np.testing.assert_allclose(rows.W[:kb], W_g, atol=2e-8 * size)
    np.testing.assert_allclose(rows.W, W, atol=1e-9 * size)
    assert_close(X, np.stack([by_q(i, "rate") for i in columns], axis=1), 1e-6)
    assert_close(Y, np.stack([by_v(i, "acceleration") for i in columns], axis=1), 1e-6)


def assert_close(found, expected, tol):
    np.testing.assert_allclose(found, expected, atol=tol * max(1, abs(expected).max()))


@pytest.mark.parametrize("kind", KINDS)
def test_rows_agree_with_finite_differences(kind):
    system = system_with(kind)
    q, v, a = motion_of(system)
    if kind == "sphere in shell":  # its tangents are carried along in parallel: gamma_dot is meant where gamma vanishes
        rows = rows_at(system, T, q, v, a)
        v = v - np.linalg.lstsq(rows.W[1:], rows.rate[1:])[0]
    assert_rows(system, q, v, a)


def test_rows_of_several_kinds_stand_in_one_order():
    """All g before all gamma, whoever made them."""
    names = ("knife", "disc on plane", "weld", "joint trajectory", "sphere on turntable")
    system = system_with(*names)
    constraints = system.constraints
    assert (constraints.kb, constraints.mb) == (1 + 6 + 1 + 1, 1 + 2 + 2)
    assert [n.split()[0] for n in constraints.names[constraints.kb :]] == ["KnifeEdge"] + 2 * ["RollingSphere"] + 2 * [
        "RollingDisc"
    ]
    assert_rows(system, *motion_of(system))


@pytest.mark.parametrize(
    ("kind", "g", "gamma"),
    [("point", 3, 0), ("weld", 6, 0), ("revolute", 5, 0), ("universal", 4, 0), ("prismatic", 5, 0),
     ("cylindrical", 4, 0), ("planar", 3, 0), ("distance", 1, 0), ("knife", 0, 1), ("disc on plane", 1, 2),
     ("sphere on plane", 1, 2), ("frame trajectory", 6, 0), ("coupling", 1, 0), ("own g", 2, 0), ("own gamma", 0, 1)],
)  # fmt: skip
def test_number_of_rows(kind, g, gamma):
    constraints = system_with(kind).constraints
    assert (constraints.kb, constraints.mb) == (g, gamma)


def test_a_constraint_that_no_motion_changes_but_for_rounding_is_refused():
    """The distance across a spherical joint, along an axis that is not exact."""
    model = pin.Model()
    for i, joint in enumerate((pin.JointModelFreeFlyer(), pin.JointModelSpherical())):
        model.addJoint(i, joint, pin.SE3(np.eye(3), i * np.array([0.1, 0.7, 0.3])), f"body{i}")
        model.appendBodyToJoint(i + 1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(i + 1)
    scene, q0 = nga.Scene(model), pin.neutral(model)
    q0[3:7] = np.array([0.1, 0.2, 0.3, 0.9]) / np.linalg.norm([0.1, 0.2, 0.3, 0.9])
    scene.add_constraint(nga.Distance("body0", "body1", float(np.linalg.norm([0.1, 0.7, 0.3]))))
    with pytest.raises(nga.SceneError, match="no motion at q0 changes the constraint"):
        nga.simulate(scene, q0, t_end=0.01, dt=1e-3)
