"""Constraints and joint friction take part in located impacts."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.integrators import impact_law

E_N, HEIGHT, OFFSET = 0.6, 0.5, 0.2


def two_halves(welded):
    """A body of two spheres side by side: of one piece, or of two pieces with a weld between them."""
    model = pin.Model()
    scene = nga.Scene(model)
    side = pin.SE3(np.eye(3), np.array([OFFSET, 0.0, 0.0]))
    ball = pin.Inertia.FromSphere(1.0, 0.1)
    first = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "first")
    model.appendBodyToJoint(first, ball, pin.SE3.Identity())
    model.addJointFrame(first)
    if welded:
        second = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "second")
        model.appendBodyToJoint(second, ball, pin.SE3.Identity())
        model.addJointFrame(second)
        model.addFrame(pin.Frame("seam", first, model.getFrameId("first"), side, pin.FrameType.OP_FRAME))
    else:
        model.appendBodyToJoint(first, ball, side)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="first")
    scene.add_contact("ball", "ground", mu=0.3, e_N=E_N)
    q0 = pin.neutral(model)
    q0[2] = HEIGHT
    if welded:
        q0[7], q0[9] = OFFSET, HEIGHT
        scene.add_constraint(nga.Weld("seam", "second"))
    return scene, q0


@pytest.fixture(scope="module")
def runs():
    return [nga.simulate(*two_halves(welded), t_end=0.4, dt=2e-3) for welded in (False, True)]


def test_body_with_a_weld_bounces_as_one_piece(runs):
    whole, pieces = runs
    assert len(whole.impacts.t) == len(pieces.impacts.t) >= 1
    assert pieces.impacts.t == pytest.approx(whole.impacts.t, abs=1e-7)
    assert pieces.impacts.P_N == pytest.approx(whole.impacts.P_N, rel=1e-6)
    assert pieces.impacts.v_after[:, :6] == pytest.approx(whole.impacts.v_after, abs=1e-5)
    assert np.abs(pieces.q[:, :3] - whole.q[:, :3]).max() < 1e-5
    assert pieces.audit().ok, str(pieces.audit())
    assert pieces.audit().impact_law < 1e-12
    # the percussion of the weld stops the other half
    assert np.abs(pieces.impacts.P_b[0]).max() > 0.1
    assert np.abs(pieces.La_g).max() >= np.abs(pieces.impacts.P_b[0]).max() * (1 - 1e-9)


def test_constraints_hold_after_the_impact(runs):
    pieces = runs[1]
    assert pieces.audit().drift_g < 1e-12
    assert pieces.audit().drift_rate < 1e-10


def test_audit_finds_a_wrong_percussion_of_a_constraint(runs):
    pieces = runs[1]
    P_b = pieces.impacts.P_b.copy()
    P_b[0] *= 1.001
    changed = dataclasses.replace(pieces, impacts=pieces.impacts._replace(P_b=P_b))
    assert changed.audit().impact_law > 1e-6
    assert not changed.audit().ok
    assert pieces.audit().ok


def test_impact_turns_the_joint_friction_round():
    """The torque of dry friction is finite: no percussion, but its sign follows the velocity after the impact."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(j)
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-2.0]), np.array([2.0])
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="slide")
    scene.add_contact("ball", "ground", e_N=1.0)
    run = nga.simulate(scene, np.array([0.6]), t_end=0.5, dt=1e-2)
    fall = np.sqrt(2 * 0.5 / (9.81 - 2.0))
    speed = (9.81 - 2.0) * fall
    assert run.impacts.t == pytest.approx([fall], abs=1e-9)
    after = run.t > fall
    s = run.t[after] - fall
    assert run.q[after, 0] == pytest.approx(0.1 + speed * s - (9.81 + 2.0) * s**2 / 2, abs=1e-8)


@pytest.mark.parametrize(("off", "found"), [(1e-9, True), (1e-5, False)])
def test_percussions_that_miss_the_law_are_none(off, found, monkeypatch):
    """What sweeps say that they have found is judged by the laws, in parts of the velocity of approach."""
    scene, q0 = two_halves(False)
    simulator = nga.Simulator(scene, 1e-3)
    q0[2], v = 0.1, np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    solve = impact_law.solve_contact_problem

    def missed(*given, **options):
        P, converged, sweeps = solve(*given, **options)
        return P * (1.0 + off), converged, sweeps

    monkeypatch.setattr(impact_law, "solve_contact_problem", missed)
    simulator.initial_state(q0)
    assert (impact_law.impact(simulator.system, 0.0, q0, v) is not None) == found
