"""Drilling friction, one cone with slip: a disc that slides and spins against an ode, and a moment at its bound."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga

G, MU, RADIUS = 9.81, 0.3, 0.05
LEVER = 3 * np.pi / 16 * RADIUS  # of the row of drilling
INERTIA = 2e-3


def puck(moment=0.0):
    """A body of 1 kg that slides and turns about the vertical on a pad of radius RADIUS; q = (x, y, z, angle)."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "slides")
    joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3.Identity(), "puck")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), INERTIA * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ice")
    scene.add_geometry("puck", coal.Sphere(0.1), parent="puck")
    scene.add_contact("puck", "ice", mu=MU, contact_radius=RADIUS)
    if moment:
        scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, 0.0, 0.0, moment])))
    return scene, np.array([0.0, 0.0, 0.1, 0.0])


def slides(t, y):
    """Rates of (x, y, angle) and their velocities: the bound is shared between slip and drilling."""
    gamma = y[3:] * [1.0, 1.0, LEVER]
    force = -MU * G * gamma / np.linalg.norm(gamma)
    return np.concatenate((y[3:], force[:2], [LEVER * force[2] / INERTIA]))


@pytest.mark.parametrize("rtols", [(1e-4,), pytest.param((1e-6, 1e-8), marks=pytest.mark.long)])
def test_puck_slides_and_spins(rtols):
    """Of second order with dt, within ten times the tolerance with rtol."""
    v0, t_end, errors = np.array([0.8, 0.3, 0.0, 12.0]), 0.1, []
    exact = solve_ivp(slides, (0, t_end), [0, 0, 0, *v0[[0, 1, 3]]], "DOP853", rtol=1e-12, atol=1e-13).y[:3, -1]
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, *({"rtol": rtol} for rtol in rtols)):
        run = nga.simulate(*puck(), v0, t_end=t_end, **accuracy)
        errors.append(np.abs(run.q[-1, [0, 1, 3]] - exact).max())
        assert run.audit().ok, str(run.audit())
        if "rtol" in accuracy:
            assert errors.pop() < 10 * accuracy["rtol"]
    assert np.log10(errors[0] / errors[1]) > 1.9


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_moment_at_its_bound(side, accuracy):
    bound = LEVER * MU * G
    t_end = 0.1 if "dt" in accuracy else 0.03
    run = nga.simulate(*puck((1 + side) * bound), t_end=t_end, **accuracy)
    turned = max(0.0, side * bound / INERTIA * t_end**2 / 2)
    assert run.q[-1, 3] == pytest.approx(turned, abs=1e-14 if side < 0 else 1e-9)
    assert np.abs(run.q[:, :2]).max() < 1e-14 and run.audit().ok
