"""Newton's correction with constraints, joint friction and joint limits against finite differences of the residual."""

import numpy as np
import pinocchio as pin
import pytest
from constraint_scenes import KINDS, tree, with_geometries

import ngalpha_pin as nga
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


def equations_of(kinds, dt, friction, paper, seed=3):
    """A step of the tree with some constraints, dry friction in two joints and one limit that is closed."""
    model = tree()
    rng = np.random.default_rng(seed)
    q = pin.integrate(model, pin.neutral(model), 0.5 * rng.normal(size=model.nv))
    slider = model.joints[model.getJointId("left_c")]
    model.lowerPositionLimit[slider.idx_q], model.upperPositionLimit[slider.idx_q] = q[slider.idx_q], 9.0
    for name in ("left_a", "right_c"):
        dof = model.joints[model.getJointId(name)].idx_v
        model.lowerDryFrictionLimit[dof], model.upperDryFrictionLimit[dof] = -friction, friction
    scene = nga.Scene(model)
    with_geometries(scene)
    for kind in kinds:
        scene.add_constraint(KINDS[kind]())
    system = System(scene)
    v, a, tau = rng.normal(size=model.nv), rng.normal(size=model.nv), rng.normal(size=2)
    layout = system.layout(system.contacts.subset(np.zeros(0, dtype=int)))
    la_b = rng.normal(size=layout.kb + layout.mb)
    state = State(0.1, q, v, a, tau_f=tau, P_f=dt * tau, la_b=la_b, La_b=0 * la_b, dt=dt)
    contacts, memory = np.array([0]), (np.array([3.0]), np.array([3.0]))
    method = nga.GeneralizedAlpha(0.8, laws="paper" if paper else "second-order")
    return StepEquations(system, method.parameters, state, dt, system.contacts.subset(contacts), memory)


def residual(equations, x):
    ev = equations.evaluate(x)
    return np.concatenate((ev.R.ravel(), ev.law))


def relative_error(kinds, dt, friction, paper):
    equations = equations_of(kinds, dt, friction, paper)
    x = equations.start()
    ev = equations.evaluate(x)
    dx, _ = equations.correction(ev)
    # differences in the units of each unknown: a, U, Q, then the multipliers of the three levels
    nv, layout = equations.nv, equations.layout
    unit = np.concatenate((np.repeat((1.0, dt, dt * dt), nv), np.ones(equations.n)))
    multipliers = unit[3 * nv :]
    multipliers[layout.at_v], multipliers[layout.at_g] = dt, dt * dt
    h = 0.05  # moves q by h dt^2: small, and large against rounding
    columns = [
        (residual(equations, x + h * u * e) - residual(equations, x - h * u * e)) / (2 * h)
        for u, e in zip(unit, np.eye(len(x)), strict=True)
    ]
    J = np.stack(columns, axis=1)
    rows = np.abs(J).max(axis=1, keepdims=True)
    expected = unit * np.linalg.lstsq(J / rows, -residual(equations, x) / rows[:, 0], rcond=1e-13)[0]
    error, size = np.abs(dx - expected) / unit, np.abs(expected) / unit
    return error.max() / size.max()


@pytest.mark.parametrize("paper", [False, True])
@pytest.mark.parametrize("friction", [1e-3, 1e3])
@pytest.mark.parametrize(
    "kinds",
    [("revolute",), ("weld", "knife"), ("distance", "joint trajectory"), ("disc on plane",), ("sphere on turntable",),
     ("frame trajectory",), ("disc in shell", "universal"), ()],
)  # fmt: skip
def test_correction_agrees_with_finite_differences(kinds, friction, paper):
    """Slip with small friction, stick with large; derivatives of M and W, which are left out, go with dt squared."""
    errors = [relative_error(kinds, dt, friction, paper) for dt in (2e-3, 2.5e-4)]
    assert errors[0] < 1e-3
    assert errors[1] < max(errors[0] / 30, 1e-8)  # dt squared: a 64th, and rounding
