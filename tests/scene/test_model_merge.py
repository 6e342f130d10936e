"""Two models in one: the motion of each is what it was."""

import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.scene.model_merge import merged

AT = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 1.1), np.array([0.4, -0.1, 0.7]))


@pytest.fixture
def models():
    arm, legs = pin.buildSampleModelManipulator(), pin.buildSampleModelHumanoidRandom()
    arm.damping = np.arange(1.0, 1 + arm.nv)
    arm.referenceConfigurations["bent"] = np.full(arm.nq, 0.2)
    return arm, legs


def test_on_the_world_both_move_as_alone(models):
    first, second = models
    both, place = merged(first, second, 0, AT, "b_")
    rng = np.random.default_rng(0)
    q = [pin.randomConfiguration(m, -np.ones(m.nq), np.ones(m.nq)) for m in models]
    v = [rng.normal(size=m.nv) for m in models]
    whole = pin.rnea(both, both.createData(), np.concatenate(q), np.concatenate(v), np.zeros(both.nv))
    # the second model feels gravity in its own frame
    second.gravity = pin.Motion(AT.rotation.T @ first.gravity.linear, np.zeros(3))
    alone = [pin.rnea(m, m.createData(), x, y, np.zeros(m.nv)) for m, x, y in zip(models, q, v, strict=True)]
    np.testing.assert_allclose(whole, np.concatenate(alone), atol=1e-10)
    assert both.names[place[1, 1]] == "b_" + second.names[1]
    np.testing.assert_array_equal(both.damping[: first.nv], first.damping)
    bent = both.referenceConfigurations["bent"]
    np.testing.assert_array_equal(bent, [*np.full(first.nq, 0.2), *pin.neutral(second)])


def test_on_a_joint_the_second_one_is_carried(models):
    first, second = models
    joint = 3
    both, place = merged(first, second, joint, AT, "b_")
    q = np.zeros(both.nq)
    q_1, q_2 = np.linspace(0.1, 0.6, first.nq), pin.neutral(second)
    for k, (model, part) in enumerate(((first, q_1), (second, q_2))):
        for j in range(1, model.njoints):
            there = place[k, j]
            q[both.idx_qs[there] :][: both.nqs[there]] = part[model.idx_qs[j] :][: model.nqs[j]]
    data, one, two = both.createData(), first.createData(), second.createData()
    for model, d, x in ((both, data, q), (first, one, q_1), (second, two, q_2)):
        pin.forwardKinematics(model, d, x)
    expected = one.oMi[joint] * AT * two.oMi[second.njoints - 1]
    np.testing.assert_allclose(data.oMi[place[1, second.njoints - 1]].homogeneous, expected.homogeneous, atol=1e-14)
    assert pin.computeTotalMass(both) == pytest.approx(pin.computeTotalMass(first) + pin.computeTotalMass(second))


def test_left_out_joints_take_what_they_carry_with_them(models):
    first, _ = models
    left, place = merged(first, None, 0, pin.SE3.Identity(), without=[4])
    assert list(left.names) == list(first.names)[:4] and (0, 4) not in place
    np.testing.assert_array_equal(left.damping, first.damping[:3])
