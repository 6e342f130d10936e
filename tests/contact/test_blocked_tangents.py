"""Tangents along which a closed contact can only move together with its normal."""

from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.contact.blocked_tangents import immovable
from ngalpha_pin.contact.cones import Cones

TILT, LENGTH, RADIUS, MU = 0.4, 0.3, 0.05, 0.5


def arm_above_slope(misaligned):
    """Two hinges along x whose last link ends in a ball, above a box that is turned about y, across their plane.

    Seen along the hinges the ball moves in the plane of y and z: one tangent of the box is y, and the other one moves
    only with the normal, but for the angle by which the second axis is off.
    """
    model, geometry = pin.Model(), pin.GeometryModel()
    first = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "shoulder")
    off = pin.SE3(pin.utils.rotate("z", misaligned), np.array([0.0, LENGTH, 0.0]))
    second = model.addJoint(first, pin.JointModelRX(), off, "elbow")
    for joint in (first, second):
        middle = pin.SE3(np.eye(3), np.array([0.0, LENGTH / 2, 0.0]))
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3)), middle)
    end = pin.SE3(np.eye(3), np.array([0.0, LENGTH, 0.0]))
    geometry.addGeometryObject(pin.GeometryObject("ball", second, end, coal.Sphere(RADIUS)))
    R = pin.utils.rotate("y", TILT)
    centre = np.array([0.0, 2 * LENGTH, -0.1 - RADIUS]) - 0.1 * R[:, 2]
    geometry.addGeometryObject(pin.GeometryObject("box", 0, pin.SE3(R, centre), coal.Box(2.0, 2.0, 0.2)))
    scene = nga.Scene(model, geometry)
    scene.set_surface("*", mu=MU)
    scene.add_contact("ball", "box")
    return scene


def test_axes_that_are_nearly_parallel():
    """The arm falls, slides and moves on as with axes that are parallel, and friction acts along y alone."""
    exact, run = [nga.simulate(arm_above_slope(angle), np.zeros(2), t_end=0.3, dt=2e-3) for angle in (0.0, 3e-8)]
    assert run.audit().success
    assert (run.P_N > 0.0).any()
    assert run.q == pytest.approx(exact.q, abs=1e-6)
    assert run.n_iter.mean() < 1.5 * exact.n_iter.mean() + 1.0


def one_cone(m):
    """The cone of one contact with m tangents."""
    rows = np.zeros(m, dtype=int)
    return Cones(rows, rows, np.ones(1), np.zeros(1), [None], np.zeros(1, dtype=int), 1)


@pytest.mark.parametrize(("slope", "lever", "e_N", "still"), [
    (0.4, 1e-8, 0.0, True), (0.0, 1e-8, 0.0, True), (0.4, 1e-4, 0.0, False), (0.4, 1e-8, 0.5, False),
])  # fmt: skip
def test_direction_that_moves_only_with_the_normal(slope, lever, e_N, still):
    """Of the tangents (slope n + lever c, b) of a normal n, with n, b and c free to move, the first is still."""
    c, s = np.cos(0.3), np.sin(0.3)
    n, b, first = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([slope, 0.0, lever])
    W = np.array([n, c * first + s * b, c * b - s * first])  # with tangents turned by 0.3 rad
    sub = SimpleNamespace(k=1, m=2, cones=one_cone(2), e=np.array([e_N, 0.0, 0.0]), surfaces=None)
    found = immovable(W, W.T, 3, sub)
    assert (found is not None) == still
    if found is not None:
        t = np.array([c, -s])
        assert found.projector == pytest.approx(np.eye(2) - np.outer(t, t), abs=1e-7)
        assert found.compliance @ t == pytest.approx(max(1.0, (W @ W.T)[1:, 1:].diagonal().max()) * t, rel=1e-7)


def test_constraints_are_held():
    """A tangent that moves freely, but not with a constraint in its way."""
    sub = SimpleNamespace(k=1, m=1, cones=one_cone(1), e=np.zeros(2), surfaces=None)
    W = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 2.0, 2.0]])
    assert immovable(W[:2], W[:2].T, 2, sub) is None
    found = immovable(W, W.T, 2, sub)
    assert found is not None
    assert found.projector == pytest.approx(np.zeros((1, 1)), abs=1e-12)
