"""Boxes that rest and tumble on faces, edges and corners: they come to rest, energy never rises, nothing penetrates."""

from collections import Counter

import numpy as np
import pinocchio as pin
import pytest
from box_scenes import GRAVITY, SIZE, boxes, dropped, on_incline, stack, table

import ngalpha_pin as nga

SIDES = ("flat", "edge", "corner")


def rise_of_energy(run):
    """Largest rise of the energy in a step, in parts of what the error of the method can be there.

    The velocities are those of a frame that turns with the body, in which a free flight has the rate of acceleration
    |da/dt| <= |omega| (2 g + |omega| |v|) of the centre and |omega|^3 of the rotation. Each smooth part of a step
    starts with a_bar = a, which should be a at (alpha_m - alpha_f) dt = -dt / 3 from there; with 1 - gamma = 1/6 that
    is an error of dt^2 / 18 |da/dt| of the velocity. What a step without a start leaves is smaller by |omega| dt.
    Positions are off by ((alpha_m - alpha_f) / 2 + beta - 1/6) dt^3 |da/dt| = dt^3 / 9 |da/dt|, which gravity turns
    into energy.
    Where slip ends within a step, the percussion of the whole step, most of which comes when nothing slips any more,
    does the work P_F . gamma_F / 2 on the slip at its start, which may be positive.
    """
    dt, inertia = np.diff(run.t), 0.5 * run.scene.model.inertias[1].inertia.trace()
    v, omega = (np.linalg.norm(run.v[:, part], axis=1) for part in (slice(0, 3), slice(3, 6)))
    v, omega = (np.maximum(x[1:], x[:-1]) for x in (v, omega))
    parts = 1 + np.bincount(np.searchsorted(run.t, run.impacts.t), minlength=len(run.t))[1:]
    rate = omega * (2 * GRAVITY + omega * v)
    error = dt**2 * ((v * rate + inertia * omega**4) * (parts / 18 + omega * dt) + GRAVITY * dt / 9 * rate)
    work = (run.P_F[1:] * run.gamma_F[:-1]).reshape(len(dt), -1, 2).sum(axis=2) / 2
    error += np.maximum(work, 0.0).sum(axis=1)
    return float((np.diff(run.energy.total) / (error + 1e-12)).max())


def gain_of_impacts(run):
    """Largest change of the kinetic energy at a located impact [J]."""
    before, after, q = run.impacts.v_before, run.impacts.v_after, run.impacts.q
    M = [run.system.mass_matrix(x) for x in q]
    return max(0.5 * (b @ m @ b - a @ m @ a) for m, a, b in zip(M, before, after, strict=True))


def check_fall(ground, side, e_N, dt, seed):
    run = nga.simulate(boxes([SIZE], ground, mu=0.5, e_N=e_N), *dropped(side, seed), t_end=3.0, dt=dt)
    assert run.audit().ok, str(run.audit())
    assert run.audit().penetration <= 1e-9
    assert rise_of_energy(run) <= 1.0
    # Newton's law with friction could add energy where several contacts close: here none of the impacts does
    assert gain_of_impacts(run) <= 1e-12
    assert np.abs(run.v[-1]).max() < 1e-9
    return Counter(str(rung) for rung in run.solver_path[1:])


CASES = [("plane", side, e_N) for side in SIDES for e_N in (0.0, 0.5)] + [("slab", "edge", 0.0)]


@pytest.mark.parametrize(("ground", "side", "e_N"), CASES)
def test_dropped_box_comes_to_rest(ground, side, e_N):
    rungs = check_fall(ground, side, e_N, 1e-2, 1)
    assert rungs["newton"] > 200


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("dt", [1e-2, 1e-3])
@pytest.mark.parametrize("e_N", [0.0, 0.5])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("ground", ["plane", "slab"])
def test_dropped_box_comes_to_rest_at_many_seeds(ground, side, e_N, dt, seed):
    print(check_fall(ground, side, e_N, dt, seed))


def test_impacts_of_features_are_those_of_points():
    """The corners of the box on a half-space and the features of the box on a slab are the same contacts."""
    q0, v0 = dropped("edge", 2)
    runs = [
        nga.simulate(boxes([SIZE], ground, mu=0.5, e_N=0.5), q0, v0, t_end=0.6, dt=1e-2) for ground in ("plane", "slab")
    ]
    assert len(runs[0].impacts.t) >= 8
    assert runs[1].impacts.t == pytest.approx(runs[0].impacts.t, abs=1e-10)
    assert np.abs(runs[1].q - runs[0].q).max() < 1e-9
    assert np.sort(runs[1].impacts.P_N)[:, -4:] == pytest.approx(np.sort(runs[0].impacts.P_N)[:, -4:], abs=1e-8)


def test_impacts_of_features_are_saved(tmp_path):
    run = nga.simulate(boxes([SIZE], "slab", mu=0.5), *dropped("edge", 2), t_end=0.2, dt=1e-2)
    assert run.audit().impact_law < 1e-10
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert len(loaded.impacts.slots) == loaded.impacts.slot_ends[-1] > 0
    assert loaded.audit().impact_law == run.audit().impact_law


@pytest.mark.parametrize("excess", [0.01, -0.01])
def test_box_on_an_incline_at_the_angle_of_friction(excess):
    """With features: sticks without creep above mu = tan(theta), slides with g (sin - mu cos) below it."""
    tilt = 0.3
    mu = np.tan(tilt) + excess
    scene, q0 = on_incline(tilt, mu)
    run = nga.simulate(scene, q0, t_end=0.5, dt=1e-2)
    slide = max(0.0, GRAVITY * (np.sin(tilt) - mu * np.cos(tilt)))
    down = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    assert (run.q[:, :3] - q0[:3]) @ down == pytest.approx(0.5 * slide * run.t**2, abs=1e-12)
    assert np.abs(run.v @ np.eye(6)[0] - slide * run.t).max() < 1e-9
    assert np.abs(run.v[:, 1:]).max() < 1e-9
    assert run.audit().ok


def check_stack(n, t_end):
    scene, q0 = stack(n)
    run = nga.simulate(scene, q0, t_end=t_end, dt=1e-2)
    assert np.abs(run.v).max() < 1e-9
    assert np.abs(run.q - q0).max() < 1e-9
    bottom = [name.endswith("/ground") for name in run.contact_names]
    assert run.la_N[:, bottom].sum(axis=1) == pytest.approx(n * GRAVITY, rel=1e-9)
    assert run.audit().ok


def test_stack_stands():
    check_stack(4, 0.5)


@pytest.mark.long
def test_stack_of_ten_stands_for_ten_seconds():
    check_stack(10, 10.0)


def check_table(feet, height):
    scene, centre, points = table(feet)
    q0 = pin.neutral(scene.model)
    q0[2] = height
    run = nga.simulate(scene, q0, t_end=0.2, dt=1e-2)
    stands = run.t > (0.01 + np.sqrt(2 * height / GRAVITY) if height else 0.0)
    weight = 12.0 * GRAVITY
    assert run.la_N[stands].sum(axis=1) == pytest.approx(weight, rel=1e-9)
    assert run.la_N[stands] @ points[:, :2] == pytest.approx(np.tile(weight * centre[:2], (stands.sum(), 1)), rel=1e-9)
    assert run.P_N[1:].sum() == pytest.approx(weight * 0.2, rel=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-9
    assert run.audit().ok


@pytest.mark.parametrize("height", [0.0, 0.02])
@pytest.mark.parametrize("feet", [4, 8])
def test_feet_of_a_table_share_its_weight(feet, height):
    check_table(feet, height)


@pytest.mark.long
@pytest.mark.parametrize("height", [0.0, 0.02])
def test_hundred_feet_of_a_table_share_its_weight(height):
    check_table(100, height)
