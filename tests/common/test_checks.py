"""One place checks what is declared: what it takes, and what it says of the rest."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError


class Rude:
    """An object that fails however it is asked."""

    def __float__(self):
        raise RuntimeError

    def __repr__(self):
        raise RuntimeError


NO_NUMBERS = ["0.5", b"1", None, True, (0.5, 0.3), [1.0], np.ones(1), {}, 1j, len, Rude(), np.nan, np.inf, 10**400]  # type: ignore[var-annotated]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=[type(x).__name__ for x in NO_NUMBERS])
def test_what_is_no_number_is_named(value):
    with pytest.raises(SceneError, match=r"^Spring: mu = .*: expected a finite number, not negative$"):
        checks.number("Spring: mu", value, 0.0)


def test_numbers_come_as_floats():
    for value in (1, 1.0, np.float32(1.0), np.int64(1), np.array(1.0)):
        assert type(checks.number("mu", value)) is float


@pytest.mark.parametrize(
    ("bounds", "value", "words"),
    [
        ({"low": 0.0, "above": True, "unit": "metres"}, 0.0, "a positive number of metres"),
        ({"low": 0.0, "high": 1.0}, 1.1, r"a finite number in \[0, 1\]"),
        ({"low": 0.0, "high": 1.0, "above": True}, 0.0, r"a finite number in \(0, 1\]"),
        ({"low": 2.0}, 1.0, "a finite number of at least 2"),
    ],
)
def test_bounds_are_said(bounds, value, words):
    with pytest.raises(SceneError, match=words):
        checks.number("x", value, **bounds)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([1.0, 2.0], r"q0 has shape \(2,\): expected a vector of shape \(3,\)"),
        (1.0, r"q0 has shape \(\): expected"),
        ([1.0, np.nan, 2.0], r"q0\[1\] = nan is not finite"),
        ([[1.0], [2.0, 3.0]], "q0 = .*: expected finite numbers"),
        (["1", "2", "3"], "expected finite numbers"),
        ([1.0, 2.0, "3"], "expected finite numbers"),
        ((x for x in "abc"), "expected finite numbers"),
        ({1.0: 2.0}, "expected finite numbers"),
        ([1.0, 2.0, 3j], "expected finite numbers"),
        ([10**400, 1, 1], "expected finite numbers"),
    ],
)
def test_what_is_no_vector_is_named(value, words):
    with pytest.raises(SceneError, match=words):
        checks.vector("q0", value)


def test_arrays_are_copies():
    given = np.ones(3)
    checks.vector("q0", given)[0] = 2.0
    assert given[0] == 1.0


def test_directions_are_unit_vectors_whatever_their_size():
    for size in (1e-300, 1.0, 1e300):
        assert np.allclose(checks.direction("axis", [3.0 * size, 0.0, 4.0 * size]), [0.6, 0.0, 0.8], atol=1e-15)
    with pytest.raises(SceneError, match="axis = .*not zero"):
        checks.direction("axis", np.zeros(3))


@pytest.mark.parametrize("value", [3, None, "", "a\0b", "\ud800", b"name", ["name"]])
def test_what_is_no_name(value):
    with pytest.raises(SceneError, match="frame = .*: expected a name"):
        checks.name("frame", value)


@pytest.mark.parametrize("value", [3, None, "", "a\0b", b"name"])
def test_what_is_no_path(value):
    with pytest.raises(SceneError, match="expected a path"):
        checks.path("path", value)
    assert checks.path("path", "a/b") == checks.path("path", Path("a/b")) == Path("a/b")


def mirrored():
    return pin.SE3(np.diag([1.0, 1.0, -1.0]), np.zeros(3))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.eye(4), "expected a pin.SE3"),
        (pin.SE3(2 * np.eye(3), np.zeros(3)), "no rotation"),
        (mirrored(), "no rotation"),
        (pin.SE3(np.eye(3), np.array([0, np.nan, 0])), "translation"),
        (pin.SE3(np.full((3, 3), np.nan), np.zeros(3)), "no rotation"),
    ],
)
def test_what_is_no_placement(value, words):
    with pytest.raises(SceneError, match=f"^placement.*{words}"):
        checks.placement("placement", value)


def test_placements_that_are_some():
    assert checks.placement("placement", None) == pin.SE3.Identity()
    seven_digits = pin.SE3(pin.exp3(np.array([0.3, 0.4, 0.5])).round(7), np.zeros(3))
    assert checks.placement("placement", seven_digits) is seven_digits


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: checks.integer("n", 2.0), "n = 2.0: expected an integer"),
        (lambda: checks.integer("n", True), "expected an integer"),
        (lambda: checks.integer("n", 0, 1), "expected an integer of at least 1"),
        (lambda: checks.flag("progress", 1), "progress = 1: expected True or False"),
        (lambda: checks.choice("solver", "magic", ("a", "b")), "choose one of a, b"),
        (lambda: checks.choice("solver", ["a"], ("a", "b")), "choose one of a, b"),
        (lambda: checks.function("pose", 3, "of time"), "pose = 3: expected a function of time"),
        (lambda: checks.function("pose", dict, "of time"), "expected a function of time"),
        (lambda: checks.instance("model", "m", pin.Model), "model = 'm', a str: expected a Model"),
    ],
)
def test_other_types(call, words):
    with pytest.raises(SceneError, match=words):
        call()


def test_lists_of_one_type():
    assert checks.instances("run", (1, 2), int, "a number of runs") == [1, 2]
    with pytest.raises(SceneError, match=r"^run 1 = 'a', a str: expected a number of runs$"):
        checks.instances("run", [1, "a"], int, "a number of runs")
    for value in (3.0, len, Rude(), np.array(1.0)):
        with pytest.raises(SceneError, match=r"^run = .*: expected a list, each of it a number of runs$"):
            checks.instances("run", value, int, "a number of runs")
