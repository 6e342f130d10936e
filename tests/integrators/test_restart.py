"""A stiffness of 1e9 in series with a mass of 1 g: no special option, and the slow motion is exact to order 2."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from verdicts import only_energy_of_unresolved_motion

import ngalpha_pin as nga
from ngalpha_pin.common.tolerances import GRAVITY
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.restart import begin, without_unresolved
from ngalpha_pin.report.stability.scenes import spring_hopper

STIFF, SMALL, SOFT, MASS = 1e9, 1e-3, 40.0, 1.0
WAVERS = 0.03  # of its energy, by which that of an oscillator wavers with rho_inf = 0.5


def chain(big_first):
    """Two masses on a line: the small one on the stiff spring, the big one behind it on a soft one; or reversed."""
    model = pin.Model()
    masses = (SMALL, MASS) if big_first is False else (MASS, SMALL)
    for name, mass in zip(("one", "two"), masses, strict=True):
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.01), pin.SE3.Identity())
        model.addJointFrame(joint)
    model.gravity.linear = np.zeros(3)
    scene = nga.Scene(model)
    first, second = (STIFF, SOFT) if big_first is False else (SOFT, STIFF)
    scene.add_force(nga.Spring("world", "one", first, 1.0))
    scene.add_force(nga.Spring("one", "two", second, 1.0))
    return scene


@pytest.mark.parametrize("rho_inf", [0.0, 0.9])
@pytest.mark.parametrize("big_first", [False, True])
def test_spring_between_frames(big_first, rho_inf):
    """The stiff spring is as good as rigid: 1e9 N/m against 40 N/m, with a period of 6 microseconds."""
    stretch, errors = 0.05, []
    slow = MASS if big_first is False else MASS + SMALL
    omega = np.sqrt(SOFT / slow)
    for dt in (4e-3, 2e-3):
        q0 = np.array([1.0, 0, 0, 2.0, 0, 0])
        q0[3] += stretch
        if big_first:
            q0[0] += stretch
        run = nga.simulate(chain(big_first), q0, t_end=0.4, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
        x = stretch * np.cos(omega * run.t)
        errors.append(np.abs(run.q[:, 3] - 2.0 - x).max())
        gap = run.q[:, 0] - 1.0 if big_first is False else run.q[:, 3] - run.q[:, 0] - 1.0
        assert np.abs(gap).max() < 1e-7  # the stiff spring carries at most 2 N, which is 2e-9 m
        assert run.n_iter.max() <= 4
    assert errors[1] < 3e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_joint_springs_in_series():
    """The same with springs of joints, one behind the other."""
    stretch, errors = 0.05, []
    for dt in (4e-3, 2e-3):
        model = pin.Model()
        one = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "one")
        two = model.addJoint(one, pin.JointModelPX(), pin.SE3.Identity(), "two")
        for joint, mass in ((one, SMALL), (two, MASS)):
            model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.01), pin.SE3.Identity())
        scene = nga.Scene(model)
        scene.add_force(nga.JointSpring("one", STIFF))
        scene.add_force(nga.JointSpring("two", SOFT))
        run = nga.simulate(scene, np.array([0.0, stretch]), t_end=1.0, dt=dt)
        errors.append(np.abs(run.q[:, 1] - stretch * np.cos(np.sqrt(SOFT / MASS) * run.t)).max())
        assert np.abs(run.q[:, 0]).max() < 1e-7
        assert run.n_iter.max() <= 2
    assert errors[1] < 3e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_stiff_start_out_of_equilibrium_is_damped_away():
    """What cannot be resolved does not grow, and does not disturb the slow motion."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(SMALL, 0.01), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("mass", STIFF))
    run = nga.simulate(scene, np.array([1e-6]), t_end=0.1, dt=1e-3)
    assert np.abs(run.q).max() <= 2e-6
    assert np.abs(run.q[-1]).max() < 1e-12
    assert run.audit().energy_rise is not None


@pytest.mark.parametrize("rho_inf", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("stiffness", [1e8, 1e9, 1e12])
def test_impact_excites_a_spring_that_the_steps_do_not_resolve(stiffness, rho_inf):
    """Wherever in the step the impact falls: the short rest of the step resolves the vibration, the next one cannot."""
    method = nga.GeneralizedAlpha(rho_inf=rho_inf)
    for part in (0.02, 0.5, 0.97):
        scene, q0, v0 = spring_hopper(stiffness)
        q0[0] = 0.1 + GRAVITY / 2 * (0.1 + part * 1e-3) ** 2
        run = nga.simulate(scene, q0, v0, t_end=0.12, dt=1e-3, method=method)
        total = run.energy.total
        assert (total - np.minimum.accumulate(total)).max() < 1e-2 * run.energy.kinetic.max()
        # half of what the impact leaves is a vibration that no step resolves: the method takes it away
        assert only_energy_of_unresolved_motion(run)


def test_nothing_is_averaged_where_the_steps_resolve_it():
    """The same state, to the bit, of a soft spring, of a method without overshoot, and without forces."""
    for stiffness, rho_inf in ((1e3, 0.5), (1e9, 1.0), (0.0, 0.0)):
        scene, q0, v0 = spring_hopper(stiffness)
        simulator = nga.Simulator(scene, 1e-3, nga.GeneralizedAlpha(rho_inf=rho_inf))
        state = simulator.initial_state(q0, v0)
        piece = Piece(simulator.method.parameters, simulator.system, state, 1e-3)
        assert without_unresolved(piece) is piece


@pytest.mark.parametrize(("longer", "averaged"), [(1.005, False), (1.5, True)])
def test_only_a_longer_step_is_averaged(longer, averaged):
    """Of a motion that its steps do not resolve; times that are rounded make no step longer."""
    scene, q0, v0 = spring_hopper(1e9)
    simulator = nga.Simulator(scene, 1e-3, nga.GeneralizedAlpha(rho_inf=0.0))
    state = simulator.initial_state(q0 + 1e-4 * (np.arange(len(q0)) == 0), v0)
    state = replace(state, dt=1e-3, a=state.a + 1.0, memory=state.auxiliary)
    begun = begin(Piece(simulator.method.parameters, simulator.system, state, longer * 1e-3)).state
    assert np.array_equal(begun.a, state.a) != averaged


def test_the_step_that_relaxes_makes_no_energy_in_any_mode():
    """Oscillators of all frequencies and retardation times, from any state; slow ones to the order of the step."""
    model, count, scene_of = pin.Model(), 0, []
    for exponent in np.arange(2.0, 10.0, 0.5):
        for tau in (0.0, 1e-6, 1e-4, 1e-3, 1e-1):
            joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"m{count}")
            model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.01), pin.SE3.Identity())
            scene_of.append((f"m{count}", 10.0**exponent, 10.0**exponent * tau))
            count += 1
    scene = nga.Scene(model)
    for name, stiffness, damping in scene_of:
        scene.add_force(nga.JointSpring(name, stiffness, damping=damping))
    omega = np.sqrt([stiffness for _, stiffness, _ in scene_of])
    for angle in np.linspace(0.0, np.pi, 7):
        q0, v0 = np.cos(angle) / omega, np.full(count, np.sin(angle))
        simulator = nga.Simulator(scene, 1e-3)
        state = simulator.initial_state(q0, v0)
        for step in range(4):
            state = simulator.step(state)
            energy = (omega * state.q) ** 2 + state.v**2  # of one at the start
            assert energy.max() <= 1 + 1e-9 if step == 0 else 1 + WAVERS
            if step == 0:
                undamped = np.array([not damping for *_, damping in scene_of])
                assert (energy < 1.5 / (1e-3 * omega) ** 2)[undamped].all()  # it leaves nothing of stiff ones


@pytest.mark.parametrize("retardation", [0.0, 1e-4, 1e-3])
def test_impact_of_a_damped_stiff_spring_makes_no_energy(retardation):
    """Material damping asks for q + tau v = 0 at the end: with coefficients of (72) that leaves (omega tau / 2)^2."""
    for stiffness in (1e8, 1e10):
        for part in (0.02, 0.5, 0.97):
            scene, q0, v0 = spring_hopper(stiffness)
            scene.add_force(nga.JointSpring("spring", 0.0, damping=retardation * stiffness))
            q0[0] = 0.1 + GRAVITY / 2 * (0.1 + part * 1e-3) ** 2
            total = nga.simulate(scene, q0, v0, t_end=0.12, dt=1e-3).energy.total
            # the method itself makes some 1e-6 of what is left of a stiff mode
            assert (total - np.minimum.accumulate(total)).max() < 1e-5 * (total.max() - total.min())
