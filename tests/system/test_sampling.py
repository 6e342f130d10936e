"""Controls that are sampled: what they hold between their samples, in both modes, and what they remember."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.sampled_control import SampledControl

SPRING, KP, KD, RATE, LIMIT, T_END = 400.0, 300.0, 8.0, 100.0, 60.0, 0.2


def law(t, q, v, forces):
    return -KP * q - KD * v


def slide(effort=np.inf, gravity=0.0):
    """One kilogram on a slide."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(joint)
    if np.isfinite(effort):
        model.upperEffortLimit[:], model.lowerEffortLimit[:] = effort, -effort
    return nga.Scene(model)


def oscillator(effort=np.inf, sampled=law, **memory):
    scene = slide(effort)
    scene.add_force(nga.JointSpring("z", SPRING))
    scene.add_force(SampledControl(sampled, RATE, **memory))
    return scene


def exact(times, effort=np.inf):
    """The oscillator from x = 1 under a force that is held from sample to sample, at increasing times."""
    x, v, n, found, omega = 1.0, 0.0, 0, [], np.sqrt(SPRING)

    def later(h):
        rest = force / SPRING
        c, s = np.cos(omega * h), np.sin(omega * h)
        return rest + (x - rest) * c + v / omega * s, -(x - rest) * omega * s + v * c

    while len(found) < len(times):
        force = np.clip(-KP * x - KD * v, -effort, effort)
        while len(found) < len(times) and times[len(found)] < (n + 1) / RATE - 1e-12:
            found.append(later(times[len(found)] - n / RATE))
        (x, v), n = later(1.0 / RATE), n + 1
    return np.array(found)


def errors(effort, **accuracy):
    run = nga.simulate(oscillator(effort), np.ones(1), np.zeros(1), t_end=T_END, **accuracy)
    assert run.audit().ok is True, str(run.audit())
    return np.abs(np.column_stack((run.q, run.v)) - exact(run.t, effort)).max(axis=0)


@pytest.mark.parametrize("effort", [np.inf, LIMIT])
@pytest.mark.parametrize("dt", [1e-2, 1e-3, 3e-3])
def test_held_force_is_of_second_order(effort, dt):
    """Steps of a sample, of a tenth of it, and steps that samples divide."""
    coarse, fine = errors(effort, dt=dt), errors(effort, dt=dt / 4)
    assert (np.log(coarse / fine) / np.log(4.0) > 1.9).all()
    assert (fine < [6e2 * dt**2 / 16, 1e4 * dt**2 / 16]).all()


@pytest.mark.parametrize("effort", [np.inf, LIMIT])
def test_held_force_with_rtol(effort):
    assert errors(effort, rtol=1e-6).max() < 1e-6


def counted(t, q, v, forces, state):
    """An integral and the number of calls."""
    return -KP * q - KD * v - 10.0 * state[:1], state + np.array([q[0], 1.0])


@pytest.mark.parametrize(("dt", "calls"), [(1e-3, 21), (1e-2, 21), (7e-3, 21), (None, 21)])
def test_law_is_called_once_a_sample_in_the_order_of_time(dt, calls):
    times = []

    def seen(t, *arguments):
        times.append(t)
        return counted(t, *arguments)

    accuracy = {"rtol": 1e-6} if dt is None else {"dt": dt}
    scene = oscillator(sampled=seen, state=np.zeros(2))
    run = nga.simulate(scene, np.ones(1), t_end=T_END, **accuracy)
    assert times == pytest.approx(np.arange(calls) / RATE, abs=1e-12)
    assert run.final_state.sampled[0, 0] == calls and run.final_state.sampled[0, 3] == calls


@pytest.mark.parametrize("dt", [1e-3, 7e-3, None])
def test_memory_goes_on_to_the_same_bits(dt, tmp_path):
    accuracy, t_half = ({"rtol": 1e-6}, 0.2) if dt is None else ({"dt": dt}, 20 * dt)
    scene = oscillator(LIMIT, counted, state=np.zeros(2))
    whole = nga.simulate(scene, np.ones(1), t_end=2 * t_half, **accuracy)
    nga.simulate(scene, np.ones(1), t_end=t_half, **accuracy).save(tmp_path / "half.npz")
    half = nga.Trajectory.load(tmp_path / "half.npz")
    rest = nga.simulate(scene, state=half.final_state, t_end=2 * t_half, **accuracy)
    assert np.array_equal(whole.q[-1], rest.q[-1]) and np.array_equal(whole.v[-1], rest.v[-1])
    assert np.array_equal(whole.final_state.sampled, rest.final_state.sampled)
    assert np.array_equal(half.tau, whole.tau[: len(half.t)])


def test_simulator_samples_as_simulate_does():
    scene = oscillator(LIMIT, counted, state=np.zeros(2))
    run = nga.simulate(scene, np.ones(1), t_end=0.1, dt=3e-3)
    simulator = nga.Simulator(scene, 3e-3)
    state = simulator.initial_state(np.ones(1))
    for i in range(1, len(run.t)):
        state = simulator.step(state)
        assert np.array_equal(state.q, run.q[i]) and np.array_equal(state.v, run.v[i])
    pushed = simulator.step(state, tau=np.ones(1))  # beside what is sampled
    assert pushed.tau == pytest.approx(pushed.sampled[:, 1] + 1.0, abs=1e-15)
    assert simulator.step(pushed).tau == pytest.approx(simulator.step(pushed).sampled[:, 1], abs=0.0)


@pytest.mark.parametrize("accuracy", [{"dt": 1e-3}, {"rtol": 1e-6}], ids=["dt", "rtol"])
def test_law_sees_the_contact_forces_just_before(accuracy):
    """A law that takes half of the weight off the ground from its second sample on."""
    scene, seen = slide(gravity=9.81), []
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), "z")
    (pair,) = scene.add_contact("ball", "ground")

    def lift(t, q, v, forces):
        seen.append(forces)
        return np.array([0.5 * 9.81 if t > 0.0 else 0.0])

    scene.add_force(SampledControl(lift, RATE))
    run = nga.simulate(scene, np.array([0.1]), t_end=0.035, **accuracy)
    assert [list(f) for f in seen] == 4 * [list(run.contact_names)]
    found = np.array([next(iter(f.values())) for f in seen])
    assert found == pytest.approx(np.outer([1.0, 1.0, 0.5, 0.5], [0.0, 0.0, 9.81]), abs=1e-8)
    assert run.audit().ok is True


def test_two_rates_and_an_impact():
    """Two laws beside each other on a ball that bounces: 1 N up for 25 ms, 2 N up for the rest; e = 1/2."""
    scene = slide()
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), "z")
    scene.add_contact("ball", "ground", e_N=0.5)
    scene.add_force(SampledControl(lambda t, q, v, f: np.array([1.0 if t < 0.024 else 2.0]), 40.0))
    scene.add_force(SampledControl(lambda t, q, v, f: np.zeros(1), 30.0))
    for accuracy in ({"dt": 7e-3}, {"rtol": 1e-8}):
        run = nga.simulate(scene, np.array([0.11]), np.array([-1.0]), t_end=0.07, **accuracy)
        hit = 1.0 - np.sqrt(0.98)
        v = 0.5 * np.sqrt(0.98) + (0.025 - hit) + 2.0 * (0.07 - 0.025)
        assert run.v[-1, 0] == pytest.approx(v, abs=1e-9)


def test_bad_laws():
    for bad, words in (
        (lambda t, q, v, forces: np.zeros(2), "shape"),
        (lambda t, q, v: np.zeros(1), "failed at t = 0"),
        (lambda t, q, v, forces: np.array([np.nan]), "finite"),
    ):
        with pytest.raises(nga.SceneError, match=f"SampledControl <lambda>.*{words}"):
            nga.simulate(oscillator(sampled=bad), np.ones(1), t_end=0.1, dt=1e-3)
    with pytest.raises(nga.SceneError, match="force, next state"):
        nga.simulate(oscillator(sampled=lambda *given: np.zeros(1), state=0.0), np.ones(1), t_end=0.1, dt=1e-3)
    with pytest.raises(nga.SceneError, match="rate"):
        SampledControl(law, 0.0)
    state = nga.simulate(slide(), np.ones(1), t_end=0.1, dt=1e-2).final_state
    with pytest.raises(nga.SceneError, match="0 sampled controls"):
        nga.simulate(oscillator(), state=state, t_end=0.2)


@pytest.mark.parametrize("accuracy", [{"dt": 1e-3}, {"rtol": 1e-6}], ids=["dt", "rtol"])
def test_control_that_remembers_its_calls_is_refused(accuracy):
    calls = []
    scene = slide()
    scene.add_force(nga.Control(lambda t, q, v: calls.append(t) or np.full(1, float(len(calls)))))
    with pytest.raises(nga.SceneError, match="Control <lambda>: two calls .* SampledControl"):
        nga.simulate(scene, np.zeros(1), t_end=0.1, **accuracy)
    with pytest.raises(nga.SceneError, match="SampledControl"):
        nga.Simulator(scene, 1e-3)


def test_a_control_that_does_nothing_changes_nothing():
    """Times of samples are rounded: a step that is longer by that alone does not begin anew."""
    runs = []
    for control in ([], [SampledControl(lambda t, q, v, f: np.zeros(1), 200.0)]):
        scene = slide(gravity=9.81)
        for force in (nga.JointPD([0.1], 1e4, 1e3), *control):
            scene.add_force(force)
        runs.append(nga.simulate(scene, [0.1], [1.0], t_end=0.1, dt=2.5e-3))
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-15)
    np.testing.assert_allclose(runs[1].v, runs[0].v, atol=1e-14)
