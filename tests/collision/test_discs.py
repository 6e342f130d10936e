"""Discs of finite thickness on their rims: steady circular rolling, and Euler's disk down to its rest on the face."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

GRAVITY, RADIUS = 9.81, 0.3


def disc(half, damping=0.0):
    """A disc of 1 kg above a plane, with its moments of inertia about a diameter and the axis."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "disc")
    A, C = (3 * RADIUS**2 + (2 * half) ** 2) / 12, RADIUS**2 / 2
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([A, A, C])), pin.SE3.Identity())
    model.addJointFrame(joint)
    model.damping = np.repeat([0.0, damping], 3)
    scene = nga.Scene(model)
    scene.add_plane("plane")
    scene.add_geometry("disc", coal.Cylinder(RADIUS, 2 * half), parent="disc")
    scene.add_contact("disc", "plane", mu=1.0)
    return scene, A, C


def circular_rolling(half, A, C, tilt, x):
    """Steady rolling on the rim: rate of precession, q0 and v0.

    With the axis e of the disc inclined by the tilt, d towards the lowest point of the rim, P - G = R d - h e, and the
    centre G on a circle of radius x, omega = Omega e_z + s e rolls if Omega x = Omega (h sin - R cos) - s R. Normal
    force m g and friction m Omega^2 x turn the angular momentum: Omega sin (C (s + Omega cos) - A Omega cos) =
    m g (h sin - R cos) + m Omega^2 x (h cos + R sin).
    """
    c, s = np.cos(tilt), np.sin(tilt)
    arm = half * s - RADIUS * c
    inertia = s * (C * ((arm - x) / RADIUS + c) - A * c) - x * (half * c + RADIUS * s)
    Omega = np.sqrt(GRAVITY * arm / inertia)
    R = pin.exp3(np.array([0.0, tilt, 0.0]))
    omega = Omega * (np.array([0.0, 0.0, 1.0]) + (arm - x) / RADIUS * R[:, 2])
    q0 = np.concatenate(([x, 0.0, half * c + RADIUS * s], pin.Quaternion(R).coeffs()))
    return Omega, q0, np.concatenate((R.T @ [0.0, Omega * x, 0.0], R.T @ omega))


@pytest.mark.parametrize(("tilt", "x"), [(0.5, 0.0), (1.2, 0.5)])
def test_thick_disc_rolls_in_a_circle(tilt, x):
    """Second order in dt: the centre on its circle, the energy constant."""
    scene, A, C = disc(0.04)
    Omega, q0, v0 = circular_rolling(0.04, A, C, tilt, x)
    errors, drifts = [], []
    for dt in (4e-3, 2e-3):
        run = nga.simulate(scene, q0, v0, t_end=0.2, dt=dt)
        assert run.audit().ok
        circle = np.column_stack((x * np.cos(Omega * run.t), x * np.sin(Omega * run.t), np.full(len(run.t), q0[2])))
        errors.append(np.abs(run.q[:, :3] - circle).max())
        drifts.append(np.abs(run.energy.total - run.energy.total[0]).max())
    assert errors[1] < 4e-6
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert drifts[0] / drifts[1] == pytest.approx(4.0, rel=0.15)


def spin_down(t_end, dt, damping, tilt, half=0.01):
    """Euler's disk with a damping of its rotation."""
    scene, A, C = disc(half, damping)
    _, q0, v0 = circular_rolling(half, A, C, tilt, 0.0)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt)
    assert run.audit().ok
    return run, run.energy.total - GRAVITY * half


def test_disk_of_euler_loses_energy_without_jumps():
    """While it spins down slowly, E = 1.5 m g R sin(tilt) falls by the work of damping, c omega^2 = 8 c E / (3 R^2)."""
    dt, damping = 4e-3, 2e-3
    run, energy = spin_down(0.4, dt, damping, tilt=0.3)
    lost = -np.diff(energy)
    model = 8 * damping / (3 * RADIUS**2) * energy[:-1] * dt
    # the first step starts with a_bar = a, an error of dt^2; the model leaves out terms of the size h / R
    assert np.abs(lost / model - 1.0)[1:].max() < 0.01 / RADIUS
    assert np.abs(np.diff(lost[1:])).max() < 0.01 * lost.mean()


@pytest.mark.long
def test_disk_of_euler_comes_to_rest_on_its_face():
    """Energy never rises on the way down; at last the rim comes down all around it, and the disc rests."""
    run, energy = spin_down(2.0, 4e-3, 0.1, tilt=0.4)
    assert np.diff(energy).max() < 1e-12
    assert np.abs(run.v[-1]).max() < 1e-9
    assert energy[-1] == pytest.approx(0.0, abs=1e-9)
    assert run.la_N[-1].sum() == pytest.approx(GRAVITY, rel=1e-9)
