"""One pass over a run: rows of many times at once are those of one time, and what is left of the equations vanishes."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots


def box():
    """A box that tumbles on the ground: features that change, in places of pairs of solids."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.1, 0.2, 0.3), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("ground", coal.Box(2.0, 2.0, 0.1), placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05])))
    scene.add_geometry("box", coal.Box(0.1, 0.2, 0.3), parent="box")
    scene.add_contact("box", "ground", mu=0.5, e_N=0.2)
    q0 = pin.neutral(model)
    q0[2] = 0.25
    q0[3:] = pin.Quaternion(pin.rpy.rpyToMatrix(0.4, 0.3, 0.0)).coeffs()
    return scene, q0, np.array([0.3, 0.0, 0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize("name", ["box", "ball_in_corner", "ball_in_cylinder", "tippe_top", "quadruped", "cantilever"])
def test_rows_of_many_times_are_those_of_one(name):
    scene, q0, v0 = box() if name == "box" else robots.load(name)
    t_end, dt = (0.005, 1e-4) if name == "cantilever" else (0.3, 2e-3)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt)
    system, replay = run.system, run.replay
    sub = system.contacts.subset(run.contact_columns)
    for i in range(0, len(run.t), 7):
        t, q, v, a = float(run.t[i]), run.q[i], run.v[i], run.a[i]
        dynamics = system.dynamics(t, q, v, a)
        kinetic = 0.5 * v @ (dynamics.M @ v)
        assert replay.kinetic[i] == pytest.approx(kinetic, rel=1e-12)
        assert replay.potential[i] == pytest.approx(system.potential_energy(q), rel=1e-12, abs=1e-12)
        if sub.k == 0:
            continue
        for features, rate in ((i, replay.rate[i]), (min(i + 1, len(run.t) - 1), replay.start_rate[i + 1 : i + 2])):
            system.slots.restore_one(run.slots, run.slot_ends, features)
            rows = system.contact_rows(sub, q, v, a)
            if len(rate):
                assert np.ravel(rate) == pytest.approx(rows.rate, rel=1e-9, abs=1e-12)
            if features == i:
                assert replay.g_N[i] == pytest.approx(rows.g_N, rel=1e-9, abs=1e-12)
                assert replay.acceleration[i] == pytest.approx(rows.acceleration, rel=1e-9, abs=1e-8)


def test_what_is_left_of_the_equations_is_the_tolerance_of_the_method():
    left = nga.simulate(*robots.load("quadruped"), t_end=0.3, dt=2e-3).replay.unbalance
    assert left.force_ratio().max() < 1e-8
    assert left.step_ratio().max() < 0.5


def test_momentum_over_a_step_is_of_the_order_of_the_method():
    left = [
        nga.simulate(*robots.load("arm"), t_end=0.4, dt=dt).replay.unbalance.impulse[2:].max() for dt in (4e-3, 2e-3)
    ]
    assert left[1] < left[0] / 6.0  # the third order in a single step
