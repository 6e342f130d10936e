"""Many runs on threads: each has the bits that it has alone."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.simulation.batches import in_threads

DT = 2e-3
ARRAYS = ("q", "v", "a", "la_N", "P_N", "la_F", "P_F", "t")


def same_bits(found, wanted):
    for name in ARRAYS:
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name


@pytest.fixture(scope="module")
def quadruped():
    return robots.load("quadruped", height=0.005)


def test_initial_values_of_each_run(quadruped):
    scene, q0, v0 = quadruped
    v = np.array([v0, v0, v0])
    v[:, 0] = [0.0, 0.1, 0.2]
    runs = nga.simulate_many(scene, q0, v, t_end=0.1, dt=DT, threads=3)
    for found, start in zip(runs, v, strict=True):
        same_bits(found, nga.simulate(scene, q0, start, t_end=0.1, dt=DT))


def test_parameters_of_each_run(quadruped):
    scene, q0, v0 = quadruped
    given = {
        "mu": [0.2, 0.8],
        "e_N": {"FL*": [0.0, 0.5]},
        "mass": {"root_joint": [6.0, 12.0]},
        "kp": [80.0, 120.0],
        "kd": 2.0,
    }
    pushes = [nga.Control(lambda t, q, v, x=x: np.eye(18)[0] * x) for x in (5.0, 10.0)]
    runs = nga.simulate_many(scene, q0, v0, **given, forces=pushes, t_end=0.1, dt=DT, threads=2)
    for i, found in enumerate(runs):
        one = scene.varied(
            mu=given["mu"][i], e_N={"FL*": given["e_N"]["FL*"][i]}, mass={"root_joint": [6.0, 12.0][i]},
            kp=given["kp"][i], kd=2.0, forces=[pushes[i]],
        )  # fmt: skip
        same_bits(found, nga.simulate(one, q0, v0, t_end=0.1, dt=DT))
    assert not np.array_equal(runs[0].q, runs[1].q)


def test_gains_of_each_joint(quadruped):
    scene, q0, v0 = quadruped
    kp = np.array([np.full(18, 50.0), np.full(18, 150.0)])
    runs = nga.simulate_many(scene, q0, v0, kp=kp, t_end=0.02, dt=DT)
    same_bits(runs[1], nga.simulate(scene.varied(kp=kp[1]), q0, v0, t_end=0.02, dt=DT))


def test_states_go_on(quadruped):
    scene, q0, v0 = quadruped
    first = nga.simulate(scene, q0, v0, t_end=0.04, dt=DT)
    runs = nga.simulate_many(scene, states=[first.final_state] * 2, mu=[0.8, 0.1], t_end=0.08, dt=DT)
    same_bits(runs[0], nga.simulate(scene, state=first.final_state, t_end=0.08, dt=DT))


def test_runs_that_end_early_do_not_end_the_others(quadruped):
    scene, q0, v0 = quadruped

    none = [None, nga.SampledControl(lambda t, q, v, f: np.full(18, np.nan if t > 0.01 else 0.0), rate=100.0)]
    runs = nga.simulate_many(scene, q0, v0, forces=none, t_end=0.04, dt=DT)
    assert [run.success for run in runs] == [True, False]
    with pytest.raises(nga.NgalphaError):
        nga.simulate_many(scene, q0, v0, forces=none, t_end=0.04, dt=DT, on_failure="raise")


def test_first_error_ends_what_has_not_begun():
    begun = []

    def work(i):
        begun.append(i)
        if i == 1:
            raise nga.NgalphaError("one")
        return i

    with pytest.raises(nga.NgalphaError, match="one"):
        in_threads(work, range(1000), 2)
    assert len(begun) < 1000
    assert in_threads(lambda i: i * i, range(10), 3) == [i * i for i in range(10)]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "nothing is given for each run"),
        ({"mu": 0.1}, "nothing is given for each run"),
        ({"mu": [0.1, 0.2], "kp": [1.0]}, "kp is given for 1 runs, mu for 2"),
        ({"mu": []}, "mu is given for no run"),
        ({"mu": [-1.0]}, "mu"),
        ({"forces": nga.Control(lambda t, q, v: v)}, "forces"),
        ({"mu": [0.1], "threads": 0}, "threads"),
        ({"mu": [0.1], "save_to": "x"}, "has no save_to"),
        ({"mu": [0.1], "state": 1}, "give states"),
        ({"q0": np.zeros((2, 3))}, "q0"),
    ],
)
def test_bad_input(quadruped, given, message):
    scene, q0, v0 = quadruped
    with pytest.raises(nga.SceneError, match=message):
        nga.simulate_many(scene, **({"q0": q0, "v0": v0, "t_end": 0.01, "dt": DT} | given))
