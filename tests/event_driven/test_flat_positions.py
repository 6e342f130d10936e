"""A parallelogram of bars with rtol through the flat position, in which it could fold: it goes on or says why not."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

LENGTHS = {"crank": 1.0, "coupler": 2.0, "rocker": 1.0}


def parallelogram():
    """Two cranks of 1 m and 1 kg, coupled by a bar of 2 m and 2 kg, all of them slender, under gravity."""
    model = pin.Model()
    at = pin.SE3(np.eye(3), np.zeros(3))
    parents = {"crank": (0, 0.0), "coupler": (1, 1.0), "rocker": (0, 2.0)}
    for name, (parent, x) in parents.items():
        length = LENGTHS[name]
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        j = model.addJoint(parent, pin.JointModelRY(), place, name)
        turning = length**3 / 12
        inertia = pin.Inertia(length, np.array([length / 2, 0.0, 0.0]), np.diag([0.0, turning, turning]))
        model.appendBodyToJoint(j, inertia, at)
        tip = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
        model.addFrame(pin.Frame(f"{name}_tip", j, tip, pin.FrameType.OP_FRAME))
    scene = nga.Scene(model)
    scene.add_constraint(nga.RevoluteJoint("coupler_tip", "rocker_tip", axis=(0.0, 1.0, 0.0)))
    return scene, np.array([1.0, -1.0, 1.0]), np.array([5.0, -5.0, 5.0])


@pytest.fixture(scope="module")
def crank():
    """Angle of a parallelogram at 1 s: that of one crank with the inertia and weight of all, at rtol = 1e-11."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    # two cranks about their ends, and the coupler, whose centre runs on a circle of 1 m
    inertia = 2 * pin.Inertia(1.0, np.array([0.5, 0, 0]), np.diag([0.0, 1 / 12, 1 / 12])).matrix()
    inertia = inertia + pin.Inertia(2.0, np.array([1.0, 0, 0]), np.zeros((3, 3))).matrix()
    mass, centre = inertia[0, 0], np.array([0.75, 0.0, 0.0])
    about = inertia[4, 4] - mass * 0.75**2
    model.appendBodyToJoint(j, pin.Inertia(mass, centre, np.diag([0.0, about, about])), pin.SE3.Identity())
    return nga.simulate(nga.Scene(model), np.ones(1), np.full(1, 5.0), t_end=1.0, rtol=1e-11).q[-1, 0]


@pytest.mark.parametrize(
    "rtol", [pytest.param(10.0**-n, marks=() if n in (3, 6, 9, 10) else pytest.mark.long) for n in range(3, 11)]
)
def test_flat_position_is_passed_or_named(rtol, crank):
    """It is flat at pi, from where it could go on as an antiparallelogram."""
    run = nga.simulate(*parallelogram(), t_end=1.0, rtol=rtol, on_failure="stop")
    if run.success:
        assert run.q[-1] == pytest.approx(crank * np.array([1.0, -1.0, 1.0]), abs=100 * rtol)
        assert np.ptp(run.energy.total) <= 100 * rtol * 60.0
    else:
        assert "nearly dependent" in run.message and run.q[-1, 0] == pytest.approx(np.pi, abs=1e-3)


def test_fixed_steps_take_the_same_branch(crank):
    run = nga.simulate(*parallelogram(), t_end=1.0, dt=2e-3)
    assert run.q[-1] == pytest.approx(crank * np.array([1.0, -1.0, 1.0]), abs=3e-5)
