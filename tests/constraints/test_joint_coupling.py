"""Gears: the follower goes where the polynomial of the leader says, and the forces do no work."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.joint_coupling import couplings
from ngalpha_pin.engine.kernel import binding as kernel


def two_hinges():
    model = pin.Model()
    for name in ("leader", "follower"):
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(
            joint, pin.Inertia(1.0, np.array([0.1, 0.0, 0.0]), 0.01 * np.eye(3)), pin.SE3.Identity()
        )
    return nga.Scene(model)


def test_gear_moves_as_one_body():
    """Follower = 2 leader: one coordinate with the inertia I1 + 4 I2 and the torque tau1 + 2 tau2."""
    scene = two_hinges()
    scene.model.gravity.linear = np.zeros(3)
    scene.add_constraint(nga.JointCoupling("follower", "leader", (0.0, 2.0)))
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.3, 0.1])))
    run = nga.simulate(scene, np.zeros(2), t_end=0.5, dt=5e-3)
    inertia = 0.01 + 1.0 * 0.1**2
    assert run.q[-1, 1] == pytest.approx(2 * run.q[-1, 0], abs=1e-10)
    assert run.q[-1, 0] == pytest.approx(0.5 * 0.5**2 * 0.5 / (5 * inertia), rel=1e-9)


def test_energy_stays_on_a_curved_gear():
    scene = two_hinges()
    scene.add_constraint(nga.JointCoupling("follower", "leader", (0.2, 1.0, -0.4)))
    method, off = nga.GeneralizedAlpha(rho_inf=1.0), []
    for dt in (2e-3, 1e-3):
        run = nga.simulate(scene, np.array([0.0, 0.2]), t_end=0.5, dt=dt, method=method)
        follower = 0.2 + run.q[:, 0] - 0.4 * run.q[:, 0] ** 2
        np.testing.assert_allclose(run.q[:, 1], follower, atol=1e-9)
        off.append(np.ptp(run.energy.total) / run.energy.kinetic.max())
    assert off[1] < 1e-4 and 3.5 < off[0] / off[1] < 4.5


def test_none_where_there_are_none():
    scene = two_hinges()
    assert couplings(scene, scene.model) is None


def test_steps_with_gears_are_plain():
    """They run in the engine, and are those of numpy."""
    scene = two_hinges()
    scene.add_constraint(nga.JointCoupling("follower", "leader", (0.2, 1.0, -0.4)))
    scene.add_force(nga.JointSpring("leader", stiffness=2.0, damping=0.1))
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(np.array([0.0, 0.2]))
    simulator.steps(state, 100)
    plain = simulator.system.plain
    assert (plain.engine.steps if plain else 0) >= 98 * (kernel.library is not None)


def test_runs_with_gears_are_those_of_numpy(monkeypatch):
    scene = two_hinges()
    scene.add_constraint(nga.JointCoupling("follower", "leader", (0.2, 1.0, -0.4)))
    run = nga.simulate(scene, np.array([0.0, 0.2]), t_end=0.2, dt=1e-3)
    monkeypatch.setattr(kernel, "library", None)
    wanted = nga.simulate(scene, np.array([0.0, 0.2]), t_end=0.2, dt=1e-3)
    for name in ("q", "v", "a", "la_g"):
        found = getattr(run, name)
        assert np.abs(found - getattr(wanted, name)).max() <= 1e-10 * max(1.0, np.abs(found).max())
