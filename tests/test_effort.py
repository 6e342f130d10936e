"""Stiff servos on light joints: effort limits that are reached, dry friction that starts to slip."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.effort import motors_at_limits
from ngalpha_pin.step_equations import StepEquations

KP, KD, EFFORT, INERTIA = 200.0, 10.0, 0.3, 1e-4


def light_joint(inertia, friction=0.0, damping=0.0, effort=1e300):
    """One hinge "hinge" without gravity."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia(0.01, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    model.upperDryFrictionLimit[:], model.lowerDryFrictionLimit[:] = friction, -friction
    model.damping[:] = damping
    model.upperEffortLimit[:], model.lowerEffortLimit[:] = effort, -effort
    return nga.Scene(model)


@pytest.mark.parametrize("v0", [0.5, 5.0, 20.0])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_servo_at_its_effort_limit(v0, friction):
    """Braked by the limit and by friction at first; then the motor is on its slope, |kp q + kd v| <= effort."""
    scene = light_joint(INERTIA, friction, effort=EFFORT)
    scene.add_force(nga.JointPD(np.zeros(1), KP, KD))
    run = nga.simulate(scene, np.zeros(1), np.array([v0]), t_end=0.02, dt=1e-3)
    q, v = run.q[:, 0], run.v[:, 0]
    braking = (EFFORT + friction) / INERTIA
    brakes = run.t < v0 / braking - 1e-3
    assert v[brakes] == pytest.approx(v0 - braking * run.t[brakes], rel=1e-9)
    assert abs(KP * q[-1] + KD * v[-1]) <= EFFORT
    assert run.audit().finite


@pytest.mark.parametrize("damping", [1.0, 10.0])
def test_friction_of_a_damped_light_joint_starts_to_slip(damping):
    """A torque that rises through the bound: v = (tau - bound) / damping, later by the time constant of the damper."""
    bound, rise, inertia = 1e-3, 9e-3, 3e-5
    scene = light_joint(inertia, bound, damping)
    scene.joints = nga.JointLaws(effort=False)
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.9965 * bound + rise * t])))
    run = nga.simulate(scene, np.zeros(1), t_end=0.01, dt=1e-3)
    excess = rise * (run.t - inertia / damping) - 3.5e-3 * bound
    assert run.v[5:, 0] == pytest.approx(excess[5:] / damping, rel=1e-3)
    assert not run.v[0, 0]


@pytest.mark.parametrize("friction", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(3))
def test_contact_problem_tells_which_motors_are_at_their_limits(seed, friction):
    """An arm of light links whose motors brake it: the sides are those of the step's solution."""
    rng, model, parent = np.random.default_rng(seed), pin.Model(), 0
    for i in range(4):
        placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1 * (i > 0)]))
        parent = model.addJoint(parent, (pin.JointModelRX, pin.JointModelRY)[i % 2](), placement, f"hinge_{i}")
        model.appendBodyToJoint(
            parent, pin.Inertia(0.02, np.array([0.0, 0.0, 0.05]), 1e-5 * np.eye(3)), pin.SE3.Identity()
        )
    model.upperDryFrictionLimit[:], model.lowerDryFrictionLimit[:] = friction, -friction
    model.upperEffortLimit[:], model.lowerEffortLimit[:] = EFFORT, -EFFORT
    scene = nga.Scene(model)
    scene.add_force(nga.JointPD(np.zeros(4), KP, KD))
    simulator, dt = nga.Simulator(scene, dt=1e-3), 1e-3
    system = simulator.system
    state, found = simulator.initial_state(np.zeros(4), rng.uniform(-3.0, 3.0, 4)), 0
    for _ in range(10):
        sub, none = system.contacts.subset(state.contacts), np.zeros(0)
        sides = motors_at_limits(StepEquations(system, simulator.method, state, dt, sub, (none, none)))
        system.held = None
        state = simulator.step(state)
        passed = system.passed_limits(state.t, state.q, state.v)
        found += np.array_equal(sides, passed)
        assert not (sides * passed < 0).any()
    assert found >= 8
