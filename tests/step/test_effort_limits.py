"""Stiff servos on light joints: effort limits that are reached, dry friction that starts to slip."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.contact.joint_friction import FrictionResidual, JointFriction
from ngalpha_pin.step import effort_limits
from ngalpha_pin.step.effort_limits import motors_at_limits, motors_held, newton_within_efforts
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.options import LawOptions

MONOTONE = LawOptions(paper=False, monotone=True)
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
        sides = motors_at_limits(
            StepEquations(system, simulator.method.parameters, state, dt, sub, (none, none)), MONOTONE
        )
        state = simulator.step(state)
        passed = system.passed_limits(state.t, state.q, state.v)
        found += np.array_equal(sides, passed)
        assert not (sides * passed < 0).any()
    assert found >= 8


@pytest.mark.parametrize("side", [-1, 1])
def test_motor_between_its_limits_is_found_from_either(side):
    """At one limit a stiff servo is driven past the other one within the step; its solution is on the slope."""
    scene = light_joint(INERTIA, effort=EFFORT)
    scene.add_force(nga.JointPD(np.zeros(1), KP, KD))
    simulator, none = nga.Simulator(scene, dt=1e-3), np.zeros(0)
    state, sub = simulator.initial_state(np.zeros(1), np.zeros(1)), simulator.system.contacts.subset(np.zeros(0, int))
    equations = StepEquations(simulator.system, simulator.method.parameters, state, 1e-3, sub, (none, none))
    found, _, _ = motors_held(equations, MONOTONE, np.array([side]), 30)
    assert found.error <= 1.0
    assert found.v == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("v", [-1e-9, 1e-9])
@pytest.mark.parametrize("before", [-0.2, 0.2])
def test_slow_slip_with_the_percussion_of_its_torque(v, before):
    """With the monotone law it is a solution at any speed, although a joint that sticks may have this percussion."""
    model = light_joint(INERTIA, 0.1).model
    table, dt, gamma_c = JointFriction(model, 1, True), 1e-3, 0.55e-3
    tau = -np.copysign(0.1, v)
    y, x, known = np.array([v, 0.0]), np.array([0.0, tau]), np.array([before * 0.1 * dt])
    of = [FrictionResidual(table, y, x, np.ones(2), known, dt, gamma_c, False, monotone) for monotone in (False, True)]
    assert abs(of[1].P[0]) < 0.1 * dt
    assert of[0].kinematic[0]
    assert not of[1].kinematic.any()
    assert of[1].R == pytest.approx(0.0, abs=1e-18)


@pytest.mark.parametrize(("passed", "held"), [(False, 0), (True, 1)])
def test_motors_are_held_only_where_one_has_passed_its_limit(passed, held, monkeypatch):
    """Newton's method fails for other reasons as well, in an impact of a beam for one."""
    scene = light_joint(INERTIA, effort=EFFORT)
    scene.add_force(nga.JointPD(np.zeros(1), KP, KD))
    simulator, calls = nga.Simulator(scene, 1e-3), []
    system = simulator.system
    state = simulator.initial_state(np.zeros(1), np.array([20.0 if passed else 0.0]))
    nothing = np.zeros(0)
    sub = system.contacts.subset(np.zeros(0, dtype=int))
    equations = StepEquations(system, simulator.method.parameters, state, 1e-3, sub, (nothing, nothing))
    ev = equations.evaluate(equations.start())
    monkeypatch.setattr(effort_limits, "semi_smooth_newton", lambda equations, ev, *rest: (ev, False, 1, False))
    monkeypatch.setattr(effort_limits, "motors_held", lambda *args: calls.append(args) or (ev, 0, False))
    newton_within_efforts(equations, ev, 1)
    assert min(len(calls), 1) == held
