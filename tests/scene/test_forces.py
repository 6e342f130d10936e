"""Force laws: value, derivatives by finite differences, energy, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.forces import Control, JointSpring
from ngalpha_pin.scene.joint_pd import JointPD


def model_of():
    model = pin.buildSampleModelHumanoid()
    rng = np.random.default_rng(0)
    return model, pin.integrate(model, pin.neutral(model), 0.3 * rng.normal(size=model.nv)), rng.normal(size=model.nv)


def added(law, q, v):
    tau, K, D = np.zeros(len(v)), np.zeros((len(v), len(v))), np.zeros((len(v), len(v)))
    law.add_to(0.2, q, v, tau, K, D)
    return tau, K, D


def laws(model):
    free = lambda t, q, v: np.concatenate((np.zeros(6), np.sin(q[7:]) - 0.3 * v[6:]))  # noqa: E731
    joint = next(n for n, nq in zip(model.names, model.nqs, strict=True) if nq == 1)
    yield JointPD(pin.neutral(model), kp=5.0, kd=np.linspace(0.1, 1.0, model.nv))
    yield JointSpring(joint, 30.0, rest=0.2, damping=2.0)
    yield Control(free, derivatives=True)


@pytest.mark.parametrize("i", range(3))
def test_derivatives_and_energy(i):
    model, q, v = model_of()
    law = list(laws(model))[i]
    law.check(nga.Scene(model))
    tau, K, D = added(law, q, v)
    h = 1e-6
    for j, e in enumerate(h * np.eye(model.nv)):
        plus, minus = (added(law, pin.integrate(model, q, s * e), v)[0] for s in (1, -1))
        np.testing.assert_allclose(K[:, j], (plus - minus) / (2 * h), atol=1e-6)
        plus, minus = (added(law, q, v + s * e)[0] for s in (1, -1))
        np.testing.assert_allclose(D[:, j], (plus - minus) / (2 * h), atol=1e-6)
    if law.energy is not None:  # the force at rest is minus its gradient
        still = added(law, q, np.zeros(model.nv))[0]
        for j, e in enumerate(h * np.eye(model.nv)):
            slope = (law.energy(pin.integrate(model, q, e)) - law.energy(pin.integrate(model, q, -e))) / (2 * h)
            assert still[j] == pytest.approx(-slope, abs=1e-5)


def test_a_free_root_has_no_motor():
    model, q, v = model_of()
    law = JointPD(pin.neutral(model), 5.0, 1.0)
    law.check(nga.Scene(model))
    assert (added(law, q, v)[0][:6] == 0.0).all()


@pytest.mark.parametrize(
    "law, message",
    [
        (lambda m: JointPD(np.zeros(3), 1.0, 1.0), "q_ref has shape"),
        (lambda m: JointPD(np.full(m.nq, np.nan), 1.0, 1.0), r"q_ref\[0\] = nan is not finite"),
        (lambda m: JointPD(pin.neutral(m), -1.0, 1.0), "kp = .*: expected finite numbers, not negative"),
        (lambda m: JointPD(pin.neutral(m), 1.0, np.ones(3)), "kd has shape"),
        (lambda m: JointSpring("nowhere", 1.0), "no joint named 'nowhere'"),
        (lambda m: JointSpring(m.names[1], 1.0), "coordinates"),
        (lambda m: JointSpring(m.names[2], -1.0), "not negative"),
        (lambda m: Control(3.0), "expected a function of"),  # type: ignore[arg-type]
        (lambda m: Control(lambda t, q, v: np.zeros(2)), "shape"),
    ],
)
def test_what_does_not_fit_is_refused(law, message):
    model = pin.buildSampleModelHumanoid()
    with pytest.raises(nga.SceneError, match=message):
        nga.Scene(model).add_force(law(model))
