"""Sums of joint coordinates, of continuous joints in turns."""

import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.joint_sum import JointSum, joint_factors, names_in, nearest


@pytest.fixture
def model():
    model = pin.Model()
    for i, joint in enumerate(
        (pin.JointModelRX(), pin.JointModelPZ(), pin.JointModelRUBZ(), pin.JointModelSpherical())
    ):
        model.addJoint(i, joint, pin.SE3.Identity(), "abcd"[i])
    return model


def test_sum_of_factors_and_its_row(model):
    both = JointSum("gear", {"a": 2.0, "b": -3.0}, model)
    q = pin.neutral(model)
    q[:2] = 0.5, 0.25
    assert both.value(q) == 0.25 and both.size(q) == 1.0 and both.nearest(100.0) == 100.0
    np.testing.assert_array_equal(both.row, [2, -3, 0, 0, 0, 0])


def test_a_continuous_joint_counts_by_its_angle(model):
    turning = JointSum("spring", {"c": -2.0}, model)
    q = pin.neutral(model)
    q[2:4] = np.cos(3.0), np.sin(3.0)
    assert turning.value(q) == pytest.approx(-6.0, abs=1e-14)
    assert turning.period == turning.size(q) == pytest.approx(4 * np.pi)
    assert turning.nearest(4 * np.pi + 0.1) == pytest.approx(0.1)
    assert nearest(-7.0, 2.0) == pytest.approx(1.0)


def test_what_cannot_be_summed_is_named(model):
    with pytest.raises(UnknownName, match="joint named 'e'"):
        JointSum("gear", "e", model)
    with pytest.raises(SceneError, match="gear: joint 'd' has 3 coordinates"):
        JointSum("gear", "d", model)
    with pytest.raises(SceneError, match="continuous joint 'c' cannot be summed"):
        JointSum("gear", {"a": 1.0, "c": 1.0}, model)


def test_factors_as_given():
    assert joint_factors("leader", "a") == "a" and names_in("a") == ["a"]
    assert names_in(joint_factors("leader", {"a": 1, "b": -2})) == ["a", "b"]
    for wrong in ({"a": 0}, {"a": np.inf}, {3: 1.0}):
        with pytest.raises(SceneError, match="leader"):
            joint_factors("leader", wrong)
