"""Motion without contact: second order in q, v and a, and an energy error that stays bounded."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references

INERTIA = np.array([1.0, 2.0, 2.5])
Q_FREE = np.array([0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5])
V_FREE = np.array([1.0, -0.5, 2.0, 0.3, 2.0, 0.4])
RHO = (0.0, 0.5, 0.9, 1.0)


def pendulum():
    """A point of 2 kg at 0.5 m on a massless rod, its angle counted from the downward vertical."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pivot")
    model.appendBodyToJoint(1, pin.Inertia(2.0, np.array([0.0, 0.0, -0.5]), np.zeros((3, 3))), pin.SE3.Identity())
    return nga.Scene(model), np.array([2.0]), np.zeros(1)


def free_body():
    """A body with three different moments of inertia about its centre of mass."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(1, pin.Inertia(1.5, np.zeros(3), np.diag(INERTIA)), pin.SE3.Identity())
    return nga.Scene(model), Q_FREE, V_FREE


SYSTEMS = {
    "pendulum": (pendulum, lambda t: references.pendulum(t, 2.0, np.sqrt(9.81 / 0.5))),
    "free body": (free_body, lambda t: references.free_body(t, Q_FREE, V_FREE, INERTIA)),
}


def slope(sizes, errors):
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def errors(name, dt, rho_inf, t_end=1.0):
    """Largest error of q (as a tangent vector), v and a over the second half of the run."""
    build, reference = SYSTEMS[name]
    scene, q0, v0 = build()
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
    model, data = scene.model, scene.model.createData()
    q, v = reference(run.t)
    # the auxiliary acceleration starts with a first-order error, which rho_inf damps: judge when it has gone
    half = np.arange(len(run.t) // 2, len(run.t))
    a = [pin.aba(model, data, q[i], v[i], np.zeros(model.nv)) for i in half]
    wrong_q = [pin.difference(model, q[i], run.q[i]) for i in half]
    return [np.abs(x).max() for x in (wrong_q, run.v[half] - v[half], run.a[half] - a)]


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("rho_inf", RHO)
def test_second_order_in_position_velocity_and_acceleration(name, rho_inf):
    sizes = [8e-3, 4e-3, 2e-3]
    found = np.array([errors(name, dt, rho_inf) for dt in sizes])
    for quantity, error in zip("qva", found.T, strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.1, f"{quantity}: {error}"


@pytest.mark.parametrize("name", SYSTEMS)
def test_energy_error_stays_bounded_without_damping(name):
    scene, q0, v0 = SYSTEMS[name][0]()
    if name == "free body":  # a fall would exchange more and more energy
        scene.model.gravity.linear = np.zeros(3)
    swings = []
    for dt in (1e-2, 5e-3):
        total = nga.simulate(scene, q0, v0, t_end=20.0, dt=dt, method=nga.GeneralizedAlpha(rho_inf=1.0)).energy.total
        error = np.abs(total - total[0])
        first, last = np.array_split(error, 4)[0].max(), np.array_split(error, 4)[-1].max()
        # no drift: the last quarter is no worse than the first one
        assert last < 1.1 * first
        swings.append(error.max())
    assert swings[1] < swings[0] / 3.6


def test_damping_takes_energy_and_never_gives_it():
    scene, q0, v0 = pendulum()
    run = nga.simulate(scene, q0, v0, t_end=10.0, dt=1e-2, method=nga.GeneralizedAlpha(rho_inf=0.0))
    peaks = [part.max() for part in np.array_split(run.energy.total, 10)]
    assert run.energy.total[-1] < run.energy.total[0]
    assert (np.diff(peaks) < 1e-3 * np.ptp(run.energy.kinetic)).all()


def test_free_body_keeps_its_angular_momentum_to_second_order():
    drift = []
    for dt in (4e-3, 2e-3):
        scene, q0, v0 = free_body()
        run = nga.simulate(scene, q0, v0, t_end=2.0, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
        turns = [pin.XYZQUATToSE3(q).rotation for q in run.q]
        momentum = np.array([R @ (INERTIA * v[3:]) for R, v in zip(turns, run.v, strict=True)])
        drift.append(np.abs(momentum - momentum[0]).max())
    assert drift[0] < 1e-3
    assert drift[1] < drift[0] / 3.5


def test_centre_of_mass_flies_on_its_parabola():
    """The parabola is exact for an observer in space; the velocity is the one of the turning frame."""
    scene, q0, v0 = free_body()
    found = []
    for dt in (4e-3, 2e-3):
        run = nga.simulate(scene, q0, v0, t_end=1.0, dt=dt)
        start = pin.XYZQUATToSE3(q0).rotation @ v0[:3]
        centre = q0[:3] + run.t[:, None] * start - np.outer(run.t**2 / 2, [0, 0, 9.81])
        found.append(np.abs(run.q[:, :3] - centre).max())
    assert found[1] < found[0] / 3.6


def papers_step(model, q, v, dq, dt):
    """(125) with (123): in the coordinates, then normalised. dq = dt v + dt^2 / 2 a is the step of the package."""
    a = 2 * (dq - dt * v) / dt**2
    B, h = pin.tangentMap(model, q), 1e-4
    ahead, behind = (pin.tangentMap(model, pin.integrate(model, q, s * h * v)) for s in (1, -1))
    B_dot = (ahead - behind) / (2 * h)
    return pin.normalize(model, q + dt * B @ v + dt**2 / 2 * (B @ a + B_dot @ v))


@pytest.mark.parametrize("name", ["free body", "humanoid"])
def test_step_on_the_group_is_the_papers_step_to_third_order(name):
    if name == "humanoid":
        model = pin.buildSampleModelHumanoid()
        q0 = pin.integrate(model, pin.neutral(model), np.linspace(-0.4, 0.4, model.nv))
        scene, v0 = nga.Scene(model), np.cos(np.arange(model.nv))
    else:
        scene, q0, v0 = free_body()
    model, gaps, sizes = scene.model, [], [4e-2, 2e-2, 1e-2, 5e-3]
    for dt in sizes:
        simulator = nga.Simulator(scene, dt)
        state = simulator.step(simulator.initial_state(q0, v0))  # at the very start a_bar is a
        q1 = simulator.step(state).q
        dq = pin.difference(model, state.q, q1)
        gaps.append(np.abs(pin.difference(model, papers_step(model, state.q, state.v, dq, dt), q1)).max())
    assert slope(sizes, gaps) > 2.9, gaps
