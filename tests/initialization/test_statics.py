"""Statics against closed forms: catenary, elastica, pendulums; and what is unstable."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import ngalpha_pin as nga
from ngalpha_pin.initialization.minimisation import displacement
from ngalpha_pin.system.system import System

GRAVITY = 9.81


def catenary(length, span):
    """Parameter a and sag of a chain of that length."""
    a = brentq(lambda a: 2 * a * np.sinh(span / (2 * a)) - length, 0.1, 5.0)
    return a, a * np.cosh(span / (2 * a)) - a


def cable(EI, elements):
    """A slack cable of 1.2 m between pins 1 m apart, on a circular arc of its length; scene, beam and q0."""
    scene = nga.Scene()
    body = scene.add_beam(nga.PlanarBeam(1.2, EA=1e4, EI=EI, line_density=0.5, elements=elements), "cable")
    for name, xi, x in (("left", 0.0, 0.0), ("right", 1.0, 1.0)):
        scene.add_beam_point(name, "cable", xi)
        place = body.plane * pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        scene.add_constraint(nga.PointJoint("world", name, placement_a=place))
    half = brentq(lambda half: 1.2 * np.sin(half) - half, 0.1, 3.0)
    angles, r = np.linspace(-half, half, 201), 0.6 / half
    points = np.column_stack((0.5 + r * np.sin(angles), r * (np.cos(half) - np.cos(angles))))

    def arc(xi):
        return np.column_stack([np.interp(xi, np.linspace(0, 1, 201), column) for column in points.T])

    return scene, body, body.basis.interpolate(arc).ravel()


def energy(scene, q):
    """Of gravity and strain [J]."""
    system = System(scene)
    still = np.zeros(system.nv)
    system.dynamics(0.0, q, still, still)
    return system.potential_energy(q) + system.beams.strain_energy(q)


@pytest.mark.parametrize(("EI", "elements"), [(1e-3, 16), (1e-5, 40), (1e-7, 16)])
def test_slack_cable_hangs_as_a_catenary(EI, elements):
    scene, body, q0 = cable(EI, elements)
    found = nga.static_equilibrium(scene, q0)
    a, sag = catenary(1.2, 1.0)
    assert -body.centreline(found.q, np.array([0.5]))[0, 1] == pytest.approx(sag, abs=1e-3)
    assert found.stable
    assert energy(scene, found.q) < energy(scene, q0)
    # each pin carries m g a to the side and half of the weight
    pulls = np.sort(np.abs(found.la_b).reshape(2, 2), axis=1)
    right = np.sort([0.5 * GRAVITY * a, 0.5 * 1.2 * 0.5 * GRAVITY])
    assert pulls == pytest.approx(np.tile(right, (2, 1)), rel=1e-2)


def test_lowest_mode_of_a_slack_cable_is_that_of_two_half_waves():
    """A little below sqrt(g a) / 1.2, that of a string under its horizontal force."""
    scene, _, q0 = cable(1e-5, 40)
    modes = nga.eigenmodes(scene, q0)
    string = np.sqrt(GRAVITY * catenary(1.2, 1.0)[0]) / 1.2
    assert modes.frequencies[0] == pytest.approx(1.64, abs=0.01)
    assert 0.85 * string < modes.frequencies[0] < string
    assert not modes.unstable.any()


def column(load):
    """A cantilever of unit length and EI = 1 along x, pressed at its tip by a dead load; scene, beam."""
    scene = nga.Scene()
    scene.model.gravity.linear = np.zeros(3)
    body = scene.add_beam(nga.PlanarBeam(1.0, EA=1e4, EI=1.0, line_density=1.0, elements=8, degree=4), "column")
    scene.add_beam_point("root", "column", 0.0)
    scene.add_beam_point("tip", "column", 1.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=body.plane))
    scene.add_load(nga.PointLoad("tip", force=(-load, 0.0, 0.0)))
    return scene, body


def test_column_stays_straight_below_the_load_of_euler():
    scene, body = column(0.98 * np.pi**2 / 4)
    found = nga.static_equilibrium(scene, scene.q_ref)
    assert found.stable
    assert np.abs(body.centreline(found.q, np.array([1.0]))[0, 1]) < 1e-9


@pytest.mark.parametrize("part", [1.2, 1.5])
def test_column_buckles_into_the_elastica_beyond_the_load_of_euler(part):
    """P L^2 / EI = K(k)^2 with k the sine of half the tip angle; the straight column is balanced, and left.

    The stretch of EA = 1e4 shifts the load of Euler by P / EA, 3e-4, and the way across by some times that.
    """
    scene, body = column(part * np.pi**2 / 4)
    found = nga.static_equilibrium(scene, scene.q_ref)
    k = brentq(lambda k: ellipk(k * k) - np.sqrt(part) * np.pi / 2, 1e-6, 0.999)
    across = np.abs(body.centreline(found.q, np.array([1.0]))[0, 1])
    assert found.stable
    assert across == pytest.approx(2 * k / ellipk(k * k), rel=2e-3)


def pendulum(links):
    """Links of 1 kg and 1 m with the mass at their end, which hang at q = 0."""
    model = pin.Model()
    joint = 0
    for i in range(links):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0 if i else 0.0]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"pin{i}")
        model.appendBodyToJoint(
            joint, pin.Inertia(1.0, np.array([0.0, 0.0, -1.0]), np.zeros((3, 3))), pin.SE3.Identity()
        )
    return nga.Scene(model)


def test_modes_of_a_double_pendulum():
    """omega^2 = (2 -+ sqrt 2) g / l hanging; upright the same with the other sign, and each grows."""
    right = GRAVITY * np.array([2 - np.sqrt(2), 2 + np.sqrt(2)])
    hanging = nga.eigenmodes(pendulum(2), np.zeros(2))
    assert hanging.omega_squared == pytest.approx(right)
    assert hanging.equilibrium.stable
    assert not hanging.unstable.any()
    upright = nga.eigenmodes(pendulum(2), np.array([np.pi, 0.0]))
    assert not upright.equilibrium.stable
    assert upright.omega_squared == pytest.approx(-right[::-1])
    assert upright.growth == pytest.approx(np.sqrt(right[::-1]))
    one_up = nga.eigenmodes(pendulum(2), np.array([0.0, np.pi]))
    assert list(one_up.unstable) == [True, False]
    assert str(one_up).startswith("2 modes at 0, ") and "Hz; 1 of them grow; unstable equilibrium" in str(one_up)
    assert str(hanging) == "2 modes at 0.3815, 0.9211 Hz; stable equilibrium; closed contacts: none"


@pytest.mark.parametrize("q0", [(3.0, 0.1), (np.pi, 1e-6), (0.0, 3.0), (1.0, -2.0)])
def test_pendulum_that_is_not_in_balance_hangs_down(q0):
    found = nga.static_equilibrium(pendulum(2), np.array(q0))
    assert found.stable
    assert np.cos(found.q) == pytest.approx(1.0)
    assert np.sin(found.q) == pytest.approx(0.0, abs=1e-9)


def test_forces_without_a_potential_flutter():
    """tau = (k q2, -k q1) beside springs c on two wheels J = 1: s^2 = -c -+ i k."""
    model = pin.Model()
    for i in range(2):
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), f"wheel{i}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    c, k, found = 4.0, 0.5, {}
    for gain in (0.0, k):
        scene = nga.Scene(model)
        scene.add_force(nga.Control(lambda t, q, v, gain=gain: np.array([gain * q[1], -gain * q[0]]) - c * (q - 0.2)))
        found[gain] = nga.eigenmodes(scene, np.zeros(2))
    assert found[0.0].equilibrium.stable
    assert not found[k].equilibrium.stable
    assert found[k].growth == pytest.approx(np.full(2, np.sqrt(-c + 1j * k).real), rel=1e-5)
    balanced = np.linalg.solve(np.array([[c, -k], [k, c]]), np.full(2, 0.2 * c))
    assert found[k].equilibrium.q == pytest.approx(balanced)


def test_displacement_is_the_lowest_point_within_the_radius():
    """Against a search on the circle and inside it; with a ridge, both signs and a start on top of it."""
    angles = np.linspace(0, 2 * np.pi, 20001)
    circle = np.array([np.cos(angles), np.sin(angles)])
    for S, gradient in (
        (np.diag([1.0, 4.0]), np.array([0.1, 0.2])),
        (np.array([[1.0, 0.5], [0.5, 4.0]]), np.array([10.0, -3.0])),
        (np.diag([-1.0, 4.0]), np.array([0.1, 0.2])),
        (np.diag([-1.0, 4.0]), np.array([0.0, 2.0])),
        (np.diag([-1.0, 4.0]), np.zeros(2)),
    ):
        y = displacement(S, gradient, 0.7)
        rings = np.concatenate([r * circle for r in np.linspace(0.0, 0.7, 141)], axis=1)
        lowest = (gradient @ rings + 0.5 * np.einsum("in,ij,jn->n", rings, S, rings)).min()
        assert np.linalg.norm(y) <= 0.7 * (1 + 1e-6)
        assert gradient @ y + 0.5 * y @ S @ y <= lowest + 1e-5
