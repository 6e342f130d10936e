"""Loops whose constraints are dependent, always (Bricard) or in single positions (N-four-bar), and very stiff ones."""

import numpy as np
import pinocchio as pin
import pytest
from loops import assert_no_drift, slope
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin import robots


def bricard_angles(x):
    """Joint angles and their derivatives by x, the angle of the even-numbered joints P0, P2, P4; 0 is the cube."""
    y = np.arcsin(np.sin(x) / (1 + np.sin(x)))
    dy = np.cos(x) / (1 + np.sin(x)) ** 2 / np.cos(y)
    return np.array([x, -y, x, -y, x]), np.array([1.0, -dy, 1.0, -dy, 1.0])


def bricard_period(model):
    """From the energy of the mechanism with one coordinate: it starts at rest and comes back."""
    data = model.createData()

    def fallen(x):
        return pin.computePotentialEnergy(model, data, np.zeros(5)) - pin.computePotentialEnergy(
            model, data, bricard_angles(x)[0]
        )

    def speed(x):
        q, rate = bricard_angles(x)
        return np.sqrt(fallen(x) / pin.computeKineticEnergy(model, data, q, rate))

    end = brentq(fallen, 2.0, 3.6, xtol=1e-14)
    # x = end / 2 (1 - cos s) takes the singularities at both ends away
    half, _ = quad(lambda s: end / 2 * np.sin(s) / speed(end / 2 * (1 - np.cos(s))), 0, np.pi, epsabs=1e-9)
    return 2 * half


def test_bricard_mechanism_keeps_its_period_and_its_shape():
    scene, q0, v0 = robots.load("bricard")
    run = nga.simulate(scene, q0, v0, t_end=10.0, dt=1e-2, method=nga.GeneralizedAlpha(rho_inf=0.9))
    assert_no_drift(run)
    assert np.abs(run.constraint_motion.g).max() <= 1e-10
    # in the closed form all even joints turn alike, and so do the odd ones
    shape = np.array([bricard_angles(x)[0] for x in run.q[:, 0]])
    np.testing.assert_allclose(run.q, shape, atol=1e-9)
    # at rest again where the velocity goes from negative to positive
    back = np.flatnonzero((run.v[:-1, 0] < 0) & (run.v[1:, 0] >= 0))
    v = run.v[:, 0]
    times = run.t[back] - v[back] * run.dt / (v[back + 1] - v[back])
    period = bricard_period(scene.model)
    assert times / np.arange(1, len(times) + 1) == pytest.approx(period, rel=5e-5)
    audit = run.audit()
    assert audit.ok
    assert audit.rank == (4, 5)
    assert "independent constraint rows 4 of 5" in " ".join(str(audit).split())
    assert set(run.solver_path[1:]) == {"minimum-norm"}


def chain_reference(windows, t):
    """Angle of the upright rods and its rate, from the vertical with 1 rad/s."""
    inertia, weight = (4 * windows + 1) / 3, (3 * windows + 1) / 2 * 9.81
    y = solve_ivp(
        lambda _, y: (y[1], weight / inertia * np.sin(y[0])), (0, t[-1]), (0.0, 1.0), "DOP853", t, rtol=1e-12
    ).y
    return y[0], y[1]


def swing_of_chain(windows, dt, t_end, rho_inf=0.9):
    """Run of the chain; its flat positions, the error of the angle, and that of the energy relative to its exchange."""
    scene, q0, v0 = robots.load("n_four_bar", windows=windows)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
    assert_no_drift(run)
    upright = [scene.model.idx_qs[scene.model.getJointId(f"up{i}")] for i in range(windows + 1)]
    # every window stays a parallelogram, also behind the flat positions where it could fold over
    np.testing.assert_allclose(run.q[:, upright], run.q[:, upright[:1]].repeat(windows + 1, 1), atol=1e-8)
    angle = run.q[:, upright[0]]
    flat = int(np.diff(np.floor(angle / np.pi - 0.5)).sum())
    energy = np.abs(run.energy.total - run.energy.total[0]).max() / np.ptp(run.energy.kinetic)
    return run, flat, np.abs(angle - chain_reference(windows, run.t)[0]).max(), energy


def test_chain_of_four_bars_passes_its_flat_positions():
    sizes, found = [1e-2, 5e-3], []
    for dt in sizes:
        run, flat, error, energy = swing_of_chain(2, dt, 3.2)
        assert flat >= 3
        found.append((error, energy))
    angle, energy = np.transpose(found)
    assert 1.9 <= slope(sizes, angle) <= 2.1, angle
    assert energy[1] < 1e-4
    assert energy[0] > 3.5 * energy[1]


@pytest.mark.long
def test_forty_windows_for_ten_seconds():
    """As in the library, which asks for an error of the energy below 0.1 J."""
    run, flat, error, _ = swing_of_chain(40, 5e-3, 10.0)
    assert flat >= 8
    assert np.abs(run.energy.total - run.energy.total[0]).max() < 0.1


def test_chain_starts_from_its_flat_position():
    """The rows along the chain vanish there: no forces that are none, and the motion goes on."""
    scene, _, v0 = robots.load("n_four_bar", speed=5.0)
    q0 = np.pi / 2 * v0 / 5.0
    run = nga.simulate(scene, q0, v0, t_end=0.5, dt=5e-3, method=nga.GeneralizedAlpha(rho_inf=0.9))
    assert_no_drift(run)
    assert run.constraint_motion.rank[0] == 2
    assert np.abs(run.la_g[0]).max() < 100.0  # the rods weigh 50 N
    assert np.ptp(run.energy.total) < 1e-3 * np.ptp(run.energy.kinetic)


def governor(dt, t_end=1.0, rho_inf=0.5):
    scene, q0, v0 = robots.load("governor")
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))


def test_governor_is_stable_at_coarse_steps():
    run = governor(1e-2, t_end=3.0)
    scene = run.scene
    slider = run.q[:, scene.model.idx_qs[scene.model.getJointId("slider")]]
    assert run.success
    assert (0.2 < slider).all() and (slider < 0.8).all()
    # angular momentum about the shaft stays, energy goes into the dampers
    data = scene.model.createData()
    states = zip(run.q, run.v, strict=True)
    spin = np.array([pin.computeCentroidalMomentum(scene.model, data, q, v).angular[2] for q, v in states])
    assert np.ptp(spin) < 2e-3 * spin[0]
    assert run.energy.total[-1] < run.energy.total[0]


def test_governor_converges_with_second_order():
    """Against a much finer run; the stiff motion of the springs has died out in the second half."""
    fine = governor(5e-4, t_end=0.6)
    sizes, found = [8e-3, 4e-3, 2e-3], []
    for dt in sizes:
        run = governor(dt, t_end=0.6)
        every = round(dt / fine.dt)
        half = len(run.t) // 2
        found.append([np.abs(getattr(run, x)[half:] - getattr(fine, x)[::every][half:]).max() for x in ("q", "v")])
    for quantity, error in zip("qv", np.transpose(found), strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.2, f"{quantity}: {error}"
