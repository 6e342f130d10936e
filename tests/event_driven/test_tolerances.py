"""What a run of chosen accuracy is asked for: defaults, and what is refused."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.event_driven.tolerances import checked_accuracy, checked_times


def test_defaults():
    asked = checked_accuracy(1e-6, None, np.inf, None, 2.0)
    assert (asked.rtol, asked.atol, asked.max_step, asked.min_step) == (1e-6, 1e-6, np.inf, 2e-9)
    assert checked_accuracy(1e-6, 1e-9, 1e-10, None, 2.0).min_step == 1e-10


@pytest.mark.parametrize(
    "asked, message",
    [
        ((1e-13, None, 1.0, None), "rtol"),
        ((1.0, None, 1.0, None), "rtol"),
        ((np.nan, None, 1.0, None), "rtol"),
        ((1e-6, -1.0, 1.0, None), "atol"),
        ((1e-6, 0.0, 1.0, None), "atol = 0.0: expected a positive number"),
        ((1e-6, None, 1e-3, 1e-2), "min_step"),
        ((1e-6, None, 1e-3, 0.0), "min_step"),
    ],
)
def test_numbers_that_cannot_be_used(asked, message):
    with pytest.raises(nga.SceneError, match=message):
        checked_accuracy(*asked, 1.0)


def test_times():
    assert checked_times(None, 0.0, 1.0) is None
    assert checked_times([0, 0.5, 1], 0.0, 1.0).tolist() == [0.0, 0.5, 1.0]
    for times, word in (
        ([0.0, 0.0], "increas"),
        ([], "t_eval"),
        ([0.1, np.nan], "not finite"),
        ([[0.1, 0.2]], "shape"),
    ):
        with pytest.raises(nga.SceneError, match=word):
            checked_times(times, 0.0, 1.0)
    with pytest.raises(nga.SceneError, match="outside of"):
        checked_times([0.5, 1.5], 0.0, 1.0)
