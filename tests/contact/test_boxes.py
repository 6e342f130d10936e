"""Boxes that rest and tumble on faces, edges and corners: they come to rest, energy never rises, nothing penetrates."""

from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from box_scenes import falls, on_incline, stack, table

import ngalpha_pin as nga


def check_fall(case):
    row = falls.fall(*case)
    assert row["ok"] and row["rests"]
    assert row["penetration"] <= 1e-9
    assert row["speed"] < 1e-9
    # in a step the energy rises by no more than the error of the method, at an impact by no more than the laws allow
    assert row["rise"] <= 1.0
    assert row["above"] <= 1e-12
    # Newton's law with friction could add energy where e_N > 0: here none of the impacts does
    assert row["gain"] <= 1e-12
    assert falls.good(row)
    return row


CASES = [("plane", side, e_N) for side in falls.SIDES for e_N in (0.0, 0.5)] + [("slab", "edge", 0.0)]


@pytest.mark.parametrize(("ground", "side", "e_N"), CASES)
def test_dropped_box_comes_to_rest(ground, side, e_N):
    row = check_fall((ground, side, e_N, 1e-2, 1))
    assert row["rungs"]["newton"] > 0.5 * sum(row["rungs"].values())
    assert row["rungs"]["impact"] > 0


@pytest.mark.long
@pytest.mark.parametrize("case", falls.cases(), ids=lambda case: "-".join(map(str, case)))
def test_dropped_box_comes_to_rest_at_many_seeds(case):
    check_fall(case)


def test_energy_of_impacts_keeps_its_bound_which_is_sharp_without_friction():
    for mu, e_N in product((0.0, 0.5, 3.0), (0.0, 0.5, 0.9)):
        run = nga.simulate(
            falls.boxes([falls.SIZE], "plane", mu=mu, e_N=e_N), *falls.dropped("edge", 3), t_end=0.2, dt=1e-2
        )
        gain, above = falls.gain_of_impacts(run)
        assert len(run.impacts.t) > 0 and gain < 0.0
        assert above <= 1e-12
        if mu == 0.0:
            assert above == pytest.approx(0.0, abs=1e-12)


def test_newton_and_coulomb_may_add_energy_up_to_the_bound_and_not_with_one_coefficient():
    """A rod whose end is about to slip back: friction drives on the slip that was there before."""
    q, v = np.array([0, 0, 0.2536, 0, 0.5051, 0, 0.8630]), np.array([-0.913, 0, -1.738, 0, -13.53, 0])
    gains = []
    for e_F in (0.0, 0.95):
        scene = falls.boxes([np.array([0.02, 0.02, 1.0])], "plane", mu=1.0, e_N=0.95, e_F=e_F)
        q0 = pin.integrate(scene.model, pin.normalize(scene.model, q), -2e-3 * v)
        run = nga.simulate(scene, q0, v, t_end=5e-3, dt=5e-3)
        assert len(run.impacts.t) == 1
        gain, above = falls.gain_of_impacts(run)
        gains.append(gain)
        # every law holds, and the audit says that they have added energy
        accused = {row.name for row in run.audit().rows() if row.ok is False}
        assert accused == (set() if e_F else {"rise of energy", "energy that an impact adds"})
        assert e_F or "Newton's law" in run.audit().energy.cause
        assert e_F > 0.0 or above <= 1e-12
    assert gains[0] > 0.1 * run.energy.kinetic[0]
    assert gains[1] < 0.0


def test_table_of_falls_counts_what_went_wrong():
    row = falls.fall("plane", "flat", 0.0, 1e-2, 0)
    case = tuple(row[name] for name in falls.NAMES)
    rows = {case: row, (*case[:4], 1): row | {"rests": False}, (*case[:4], 2): {"stopped": "why"}}
    assert "| 1 of 3 |" in falls.lines_of(rows)[2]
    bad = row | {"e_N": 0.5}
    text = falls.summary(rows | {(*case[:2], 0.5, *case[3:]): bad})
    assert text.startswith("Of 4 runs 3 converged in every step, and in 2 everything is as it should be.")
    assert text.endswith(" 476 runs are missing.")


@pytest.mark.parametrize(("seed", "half"), [(1, 25), (2, 30), (3, 19)])
def test_run_continued_after_a_divided_step_gives_the_same_bits(seed, half, tmp_path):
    """The step goes on with its whole length, and the audit leaves to the first run what bounced in its last step."""
    scene, (q0, v0) = falls.boxes([falls.SIZE], "plane", mu=0.5, e_N=0.5), falls.dropped("edge", seed)
    whole = nga.simulate(scene, q0, v0, t_end=0.4, dt=1e-2)
    nga.simulate(scene, q0, v0, t_end=half * 1e-2, dt=1e-2).save(tmp_path / "half.npz")
    state = nga.Trajectory.load(tmp_path / "half.npz").final_state
    run = nga.simulate(scene, state=state, t_end=0.4)
    assert whole.solver_path[half] == "impact" and state.dt < 0.9e-2
    assert ((run.g_N[0] > 1e-6) & (run.P_N[0] > 1e-3)).any()
    for array in ("t", "q", "v", "a", "P_N", "P_F", "la_N", "la_F"):
        assert np.array_equal(getattr(run, array), getattr(whole, array)[half:]), array
    assert run.audit().ok


def test_impacts_of_features_are_those_of_points():
    """The corners of the box on a half-space and the features of the box on a slab are the same contacts."""
    q0, v0 = falls.dropped("edge", 2)
    runs = [
        nga.simulate(falls.boxes([falls.SIZE], ground, mu=0.5, e_N=0.5), q0, v0, t_end=0.6, dt=1e-2)
        for ground in ("plane", "slab")
    ]
    assert len(runs[0].impacts.t) >= 8
    assert runs[1].impacts.t == pytest.approx(runs[0].impacts.t, abs=1e-10)
    assert np.abs(runs[1].q - runs[0].q).max() < 1e-9
    assert np.sort(runs[1].impacts.P_N)[:, -4:] == pytest.approx(np.sort(runs[0].impacts.P_N)[:, -4:], abs=1e-8)


def test_impacts_of_features_are_saved(tmp_path):
    run = nga.simulate(falls.boxes([falls.SIZE], "slab", mu=0.5), *falls.dropped("edge", 2), t_end=0.2, dt=1e-2)
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
    slide = max(0.0, falls.GRAVITY * (np.sin(tilt) - mu * np.cos(tilt)))
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
    assert run.la_N[:, bottom].sum(axis=1) == pytest.approx(n * falls.GRAVITY, rel=1e-9)
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
    stands = run.t > (0.01 + np.sqrt(2 * height / falls.GRAVITY) if height else 0.0)
    weight = 12.0 * falls.GRAVITY
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
