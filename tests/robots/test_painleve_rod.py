"""Painleve rod, section 10.4: through the blow-up of the contact force, which shows as an impact without collision."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots

DT = 8e-4
BLOW_UP = 0.8145497


def run(dt=DT, t_end=1.5, rho_inf=0.9, **options):
    scene, q0, v0 = robots.load("painleve_rod")
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf, **options))


@pytest.fixture(scope="module", params=["second-order", "paper"])
def rod(request):
    return run(laws=request.param)


def test_runs_through_the_singular_time(rod):
    assert rod.success
    assert np.isfinite(rod.v).all()
    assert rod.g_N.min() > -1e-10
    assert rod.audit().ok, str(rod.audit())


def test_slides_as_the_reference_until_shortly_before(rod):
    q, v = references.painleve_rod(rod.t)
    before = rod.t < 0.7
    # dt^2 times the accelerations: la_N has grown to some ten N
    assert np.abs(rod.q - q)[before].max() < 100 * DT**2
    assert np.abs(rod.v - v)[before].max() < 100 * DT**2
    # and it keeps on the ground all the time
    assert np.abs(rod.g_N[before]).max() < 1e-12


@pytest.mark.parametrize("rho_inf", [0.5, 0.9])
def test_second_order_until_shortly_before(rho_inf):
    errors = []
    for dt in (1.6e-3, 8e-4):
        rod = run(dt, 0.72, rho_inf)
        q, v = references.painleve_rod(rod.t)
        errors.append((np.abs(rod.q - q)[50:].max(), np.abs(rod.v - v)[50:].max()))
    for coarse, fine in zip(*errors, strict=True):
        assert fine < coarse / 3.5


def test_impact_without_collision_is_reported(rod):
    impacts = [event for event in rod.events if event.kind == "impact"]
    assert impacts
    assert impacts[0].t == pytest.approx(BLOW_UP, abs=2e-3)
    assert impacts[0].contact == "tip/ground"


def test_percussion_of_the_blow_up_stands_out(rod):
    largest = np.argmax(rod.P_N[:, 0])
    assert rod.t[largest] == pytest.approx(BLOW_UP, abs=2 * DT)
    # sliding all the while, on the edge of the cone
    sliding = rod.t < BLOW_UP
    assert rod.la_F[sliding, 0] == pytest.approx(-5 / 3 * rod.la_N[sliding, 0], rel=1e-9)


def test_tip_lifts_off_and_the_rod_falls_back(rod):
    kinds = [event.kind for event in rod.events]
    assert "lift-off" in kinds
    assert rod.g_N.max() > 1e-3


@pytest.mark.parametrize("dt", [8e-4, 4e-4, 2e-4])
@pytest.mark.parametrize("rho_inf", [0.0, 0.5, 0.9])
def test_the_blow_up_is_passed_at_any_step(dt, rho_inf):
    """The solution at t_c lies on index sets that prox functions do not find; the ladder's last rung tries them all."""
    rod = run(dt, 0.83, rho_inf)
    assert rod.success
    assert rod.audit().ok
    # what follows is one of a family of solutions; where it is impulsive, the impact is told
    jumps = rod.t[rod.La_N[:, 0] > 1.0]
    told = np.array([e.t for e in rod.events if e.kind == "impact"])
    assert all(((t - dt < told) & (told <= t + 1e-12)).any() for t in jumps)
    # one that lets go there falls back by 7 ms later
    assert all(BLOW_UP - 2 * dt < t < BLOW_UP + 0.007 for t in jumps)


def test_energy_only_falls_while_it_slides():
    total = run(t_end=0.8).energy.total
    assert np.diff(total).max() < 1e-6 * np.ptp(total)
