"""Constraints from the user's own functions give what the same constraint of the package gives."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.user_defined import user_functions


def pendulum():
    """A point mass on three sliders."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("mass", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return nga.Scene(model)


def test_distance_of_ones_own():
    q0, v0, runs = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.3, 0.0]), []
    for own in (False, True):
        scene = pendulum()
        if own:
            scene.add_constraint(nga.PositionConstraint(lambda t, q: np.array([np.sqrt(q @ q) - 1.0])))
        else:
            scene.add_constraint(nga.Distance("world", "mass", 1.0))
        runs.append(nga.simulate(scene, q0, v0, t_end=0.5, dt=2e-3))
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-8)
    np.testing.assert_allclose(runs[1].la_g, runs[0].la_g, atol=1e-5)
    # and the force is that of the pendulum: m v^2 / L + m g along the string
    run, g = runs[1], 9.81
    tension = 2.0 * (run.v**2).sum(axis=1) - 2.0 * g * run.q[:, 2]
    assert np.abs(run.la_g[1:, 0]) == pytest.approx(tension[1:], abs=1e-3)


def test_velocity_constraint_of_ones_own():
    """A point that runs along x as fast as along y stays on the diagonal."""
    scene = pendulum()
    scene.add_constraint(nga.VelocityConstraint(lambda t, q, v: np.array([v[0] - v[1]])))
    scene.add_force(nga.Control(lambda t, q, v: np.array([4.0, 0.0, 2.0 * 9.81])))
    run = nga.simulate(scene, np.zeros(3), t_end=1.0, dt=1e-2)
    assert run.q[-1] == pytest.approx([0.5, 0.5, 0.0], abs=1e-9)
    assert user_functions(scene, scene.model).names_gamma == (scene.constraints[0].name,)
