"""A step that fails because a force of the user's own jumps says which, and what to use in its place."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.integrators.jumping_force import _jumps


def slider():
    """A body of 1 kg that moves along x."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
    return model


def coulomb(t, q, v):
    """Friction as one first writes it down: 50 N against the motion."""
    return -50.0 * np.sign(v)


class Rubbing:
    """The same as a class, beside a spring that does not jump."""

    energy, actuated, curve, breakpoints = None, False, None, ()

    def check(self, scene):
        """Nothing to check."""

    def bind(self, kinematics):
        """It needs no bodies."""
        return self

    def add_to(self, t, q, v, tau, K, D):
        """Add the force."""
        tau += coulomb(t, q, v) - 10.0 * q
        K -= 10.0 * np.eye(1)


@pytest.mark.parametrize("dt", (1e-3, 1e-4))
@pytest.mark.parametrize(("force", "name"), ((nga.Control(coulomb), "Control coulomb"), (Rubbing(), "Rubbing")))
def test_a_force_that_jumps_is_named_with_what_takes_its_place(force, name, dt):
    scene = nga.Scene(slider())
    scene.add_force(nga.JointSpring("x", stiffness=100.0))
    scene.add_force(force)
    with pytest.raises(nga.NotConverged, match=f"; {name} jumps with q or v there.*lowerDryFrictionLimit"):
        nga.simulate(scene, np.zeros(1), np.array([1.0]), t_end=0.1, dt=dt)


def test_what_the_message_names_does_it():
    """Dry friction of 50 N stops 1 kg at 1 m/s after 0.01 m."""
    model = slider()
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-50.0]), np.array([50.0])
    run = nga.simulate(nga.Scene(model), np.zeros(1), np.array([1.0]), t_end=0.1, dt=1e-3)
    assert run.q[-1, 0] == pytest.approx(0.01, abs=1e-12)


def test_a_steep_force_that_fails_otherwise_is_not_accused():
    """A stiff brake whose derivatives are not told fails, and does not jump."""
    scene = nga.Scene(slider())
    scene.add_force(nga.Control(lambda t, q, v: -1e12 * v * np.abs(v)))
    with pytest.raises(nga.NotConverged) as failed:
        nga.simulate(scene, np.zeros(1), np.array([1.0]), t_end=0.01, dt=1e-3)
    assert "jumps" not in str(failed.value)


def test_a_jump_is_found_beside_a_change_that_is_larger():
    """A slope of thirty on the whole way hides neither a jump of two, nor is a steep bend one."""
    assert _jumps(lambda s: np.array([10.0 * s + np.sign(s - 0.3)]))
    assert not _jumps(lambda s: np.array([10.0 * s + np.tanh(1e4 * (s - 0.3))]))
