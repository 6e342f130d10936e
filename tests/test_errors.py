"""Errors say what is wrong and what to do, and can be caught as one family."""

import pickle
from multiprocessing import get_context

import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.errors import Interrupted, NgalphaError, NotConverged, NotWritten, Penetration, SceneError, UnknownName


def test_one_family():
    assert issubclass(SceneError, ValueError)
    assert all(issubclass(error, NgalphaError) for error in (SceneError, UnknownName, Penetration, NotConverged))
    assert NotConverged("no", 0.5, ("a/b",)).contacts == ("a/b",)
    assert NotConverged("no", 0.5).trajectory is None


@pytest.mark.parametrize(
    "known, hint",
    [
        (["left_foot", "right_foot"], "did you mean 'left_foot'"),
        ([f"link{i}" for i in range(20)], "known: link0, .*link11 and 8 more$"),
        ([], "known: none"),
    ],
)
def test_unknown_names_suggest_others(known, hint):
    with pytest.raises(SceneError, match=f"no geometry named 'left_fot'; {hint}"):
        raise UnknownName("geometry", "left_fot", iter(known))


@pytest.mark.parametrize(
    "error",
    [
        NotConverged("no", 0.5, ("a/b",)), Penetration("in"), SceneError("bad"), UnknownName("joint", "a", ["b"]),
        NotWritten("full"), Interrupted("^C"), NgalphaError("other"),
    ],
)  # fmt: skip
def test_every_error_goes_from_process_to_process(error):
    error.trajectory = "up to there"
    other = pickle.loads(pickle.dumps(error))
    assert type(other) is type(error) and str(other) == str(error) and vars(other) == vars(error)


def _of_a_failing_run():
    scene, q0, v0 = robots.load("ball_in_corner")
    nga.simulate(scene, q0, v0, t_end=2.0, dt=1e-3, method=nga.GeneralizedAlpha(solver="newton", max_iter=1))


def _of_a_sunken_start():
    scene, q0, v0 = robots.load("ball_in_corner")
    nga.simulate(scene, q0 - 1.0, v0, t_end=0.1, dt=1e-3)


def test_a_run_that_fails_in_a_process_of_a_pool_is_told_in_this_one():
    with pytest.raises(NotConverged) as here:
        _of_a_failing_run()
    with get_context("fork").Pool(1) as pool:
        with pytest.raises(NotConverged, match=r"did not converge with ball_0/") as failed:
            pool.apply_async(_of_a_failing_run).get(60.0)
        with pytest.raises(Penetration):
            pool.apply_async(_of_a_sunken_start).get(60.0)
    error = failed.value
    assert (str(error), error.t, error.contacts) == (str(here.value), here.value.t, here.value.contacts)
    assert error.trajectory.q.tobytes() == here.value.trajectory.q.tobytes()
