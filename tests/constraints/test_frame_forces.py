"""Forces at frames: their derivatives against finite differences, their power against their energy."""

import numpy as np
import pinocchio as pin
import pytest
from constraint_scenes import motion_of, tree

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

L, R = "left_d_tip", "right_c_tip"
FORCES = {
    "spring": lambda: nga.Spring(L, R, 30.0, 0.2, damping=2.0),
    "spring to an ancestor": lambda: nga.Spring("left_a_tip", L, 30.0, 0.2, damping=2.0),
    "spring to the world": lambda: nga.Spring("world", R, 30.0, 0.2, placement_a=pin.SE3(np.eye(3), np.ones(3))),
    "damper": lambda: nga.Damper(L, R, 3.0),
    "wrench": lambda: nga.Wrench(R, (1.0, -2.0, 0.5), (0.3, 0.2, -1.0)),
    "wrench that turns along": lambda: nga.Wrench(R, (1.0, -2.0, 0.5), lambda t: (t, 0.2, -1.0), local=True),
    "gravity": lambda: nga.Gravity((3.0, 1.0, -2.0)),
    "control": lambda: nga.Control(lambda t, q, v: np.sin(q[:18]) - v**2, derivatives=True),
    "joint position law": lambda: nga.JointPD(pin.neutral(tree()), 20.0, 3.0),
}


def loads(system, t, q, v):
    system.dynamics(t, q, v, np.zeros_like(v))
    tau, K, D = system.loads(t, q, v)
    return tau.copy(), K.copy(), D.copy()


def system_with(force):
    scene = nga.Scene(tree())
    scene.joints = nga.JointLaws(effort=False)
    scene.add_force(FORCES[force]())
    return System(scene)


@pytest.mark.parametrize("force", FORCES)
def test_derivatives_agree_with_finite_differences(force):
    system = system_with(force)
    model, h = system.model, 1e-6
    q, v, _ = motion_of(system)
    _, K, D = loads(system, 0.2, q, v)
    K_h, D_h = np.empty_like(K), np.empty_like(D)
    for i, e in enumerate(h * np.eye(model.nv)):
        plus, minus = (loads(system, 0.2, pin.integrate(model, q, s * e), v)[0] for s in (1, -1))
        K_h[:, i] = (plus - minus) / (2 * h)
        plus, minus = (loads(system, 0.2, q, v + s * e)[0] for s in (1, -1))
        D_h[:, i] = (plus - minus) / (2 * h)
    size = max(1.0, abs(K_h).max())
    np.testing.assert_allclose(K, K_h, atol=2e-8 * size)
    np.testing.assert_allclose(D, D_h, atol=2e-8 * size)


@pytest.mark.parametrize("force", ["spring to the world", "gravity"])
def test_power_is_the_loss_of_energy(force):
    system = system_with(force)
    q, v, _ = motion_of(system)
    h, bound = 1e-6, system.forces[0]
    tau = loads(system, 0.0, q, v)[0]
    plus, minus = (bound.energy(pin.integrate(system.model, q, s * h * v)) for s in (1, -1))
    assert tau @ v == pytest.approx(-(plus - minus) / (2 * h), rel=1e-7)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nga.Spring(L, R, -1.0), "stiffness = -1.0"),
        (lambda: nga.Spring(L, "nowhere", 1.0), "no frame named 'nowhere'"),
        (lambda: nga.Spring(L, L, 1.0), "one and the same body"),
        (lambda: nga.Wrench(L, (1.0, 2.0)), "force has shape"),
        (lambda: nga.Wrench(L, lambda t: (np.nan, 0, 0)), "must be finite"),
        (lambda: nga.Gravity((1.0, 0.0)), "acceleration has shape"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(nga.SceneError, match=message):
        nga.Scene(tree()).add_force(make())
