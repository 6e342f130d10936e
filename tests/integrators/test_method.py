"""What the error of a failed step says: what turns too far in it or lies too far away, and what resolves it."""

import re
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.method import failure, lies_far, turns_around, turns_far
from ngalpha_pin.system.state import SolvedBy, StepResult
from ngalpha_pin.system.system import System

PLAY, PIN = 1e-3, 0.01


def pin_in_hole():
    """A pin with a play of 1 mm in its hole, which lies at its bottom."""
    model, j = pin.Model(), 0
    for name, joint in (("x", pin.JointModelPX()), ("z", pin.JointModelPZ())):
        j = model.addJoint(j, joint, pin.SE3.Identity(), name)
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(j)
    scene = nga.Scene(model)
    lying = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    scene.add_geometry("hole", nga.Hollow(coal.Cylinder(PIN + PLAY, 0.1)), placement=lying)
    scene.add_geometry("pin", coal.Sphere(PIN), "z")
    scene.add_contact("pin", "hole")
    return System(scene)


def test_contact_that_turns_too_far_is_named_with_the_step_that_resolves_it():
    """At 0.5 m/s around 1 mm it turns with 500 rad/s: by 0.5 rad in 1 ms, by 0.1 rad in 0.2 ms."""
    system, v = pin_in_hole(), np.array([0.5, 0.0])
    state = initial_state(system, np.array([0.0, -PLAY]), v)
    words = "pin/hole turns by 0.5 rad in a step: .* dt = 2.0e-04 s"
    failed = StepResult(state, False, 30, SolvedBy.NEWTON, 1e9)
    assert failure(nga.GeneralizedAlpha(), system, state, 1e-3, failed).args[0].count("turns by 0.5 rad") == 1
    assert re.search(words, turns_around(system, state, 1e-3))
    assert turns_around(system, state, 1.9e-4) == ""
    assert turns_around(system, initial_state(system, np.array([0.0, -PLAY])), 1e-3) == ""


def test_joint_that_turns_too_far_is_named_with_the_step_that_resolves_it():
    """Half a radian in a step is resolved."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "fan")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    system = System(nga.Scene(model))
    fast, slow = (initial_state(system, np.zeros(1), np.array([speed])) for speed in (600.0, 400.0))
    assert "'fan' turns by 0.6 rad in a step, dt = 8.3e-04 s" in turns_far(system, fast, 1e-3)
    assert turns_far(system, slow, 1e-3) == ""


def test_bodies_that_lie_too_far_away_are_named_with_what_is_rounded():
    """A pin of a centimetre, 10 km from the origin and 100 m from it: positions are rounded to 2e-12 m and 2e-14 m."""
    system, length = pin_in_hole(), pin_in_hole().contacts.length
    there = [initial_state(system, np.array([0.0, -PLAY])) for _ in range(2)]
    far, near = (replace(state, q=np.array([x * length, 0.0])) for state, x in zip(there, (1e6, 1e4), strict=True))
    assert "positions are rounded" in lies_far(system, far)
    assert lies_far(system, near) == ""
