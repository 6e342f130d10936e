"""The Newton correction reduced to the multipliers against the whole matrix from finite differences of the residual.

The reduction leaves out how M and W change with q, which enters multiplied by dt^2. Where M and W are constant the two
corrections are equal; on a robot their difference falls with dt^2.
"""

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
import pytest
from random_iterates import with_laws

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.step.compiled import CompiledEquations
from ngalpha_pin.step.differenced import DifferencedEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

NORMAL = ("open", "A", "AB", "ABC")
FRICTION = ("stick", "slip", "just started")
PATTERNS = [("open", "stick"), *((n, f) for n in NORMAL[1:] for f in FRICTION)]
"""Every combination of the index sets (130), (133), (136), (139), (141) of one contact; an open one has no friction."""
SIZES = np.array([1e-3, 2.5e-4])
LAWS = ("second-order", "paper", "laws of the paper as a fallback", "captured")


def point_mass():
    """Three translations: M and W are constant, two friction directions."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "point")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground", normal=(0.1, -0.2, 1.0))
    scene.add_geometry("foot", coal.Sphere(0.1), parent="point")
    scene.add_contact("foot", "ground", mu=0.5)
    return scene


def planar_ball():
    return robots.load("rotating_ball", mu=0.5)[0]


def top():
    """One body with drilling friction, M constant but not W."""
    scene = robots.load("tippe_top")[0]
    scene.contacts.pop()
    return scene


def held(scene, q0):
    """With joints held softly: the time constant inertia / kd of a stiff hold would ask for tiny steps."""
    scene.forces.clear()
    scene.add_force(nga.JointPD(q0, 5.0, 0.01))
    return scene


def anymal():
    pytest.importorskip("example_robot_data")
    return held(*robots.load("anymal")[:2])


def quadruped():
    return held(*robots.load("quadruped")[:2])


@dataclass
class Iterate:
    """A point in the middle of a Newton iteration, with the index sets that were asked for."""

    equations: StepEquations
    x: np.ndarray
    scale: np.ndarray


def touching(system, sub, rng):
    """A random configuration with all gaps of the subset closed."""
    model = system.model
    q = pin.integrate(model, pin.neutral(model), 0.3 * rng.normal(size=model.nv))
    for _ in range(30):
        rows = system.contact_rows_at(sub, q, np.zeros(model.nv))
        q = pin.integrate(model, q, -np.linalg.pinv(rows.W[: sub.k]) @ rows.g_N)
    assert np.abs(rows.g_N).max() < 1e-12
    return q


def iterate(scene, dt, patterns, seed, laws="second-order", contacts=None, percussion=1.0):
    """Forces and slip of size one; impulses, and velocities that they turn round, of size dt, displacements dt^2.

    With percussion = 1 the percussions are more than what the forces make of them (a body that lands), with 0.3 less.
    """
    system, rng = System(scene), np.random.default_rng(seed)
    method = nga.GeneralizedAlpha(rho_inf=0.6, laws="paper" if laws == "paper" else "second-order")
    sub = system.contacts.subset(np.arange(system.contacts.n) if contacts is None else contacts)
    model, k, m = system.model, sub.k, sub.m
    nv, o = model.nv, sub.of_F
    level, kinds = np.array([NORMAL.index(n) for n, _ in patterns]), np.array([f for _, f in patterns])

    q1 = touching(system, sub, rng)
    root = np.linalg.cholesky(pin.crba(model, system.data, q1))
    unit = np.sqrt(sum(inertia.mass for inertia in model.inertias) / nv)

    def motion():
        """A random motion with the kinetic energy of the whole mass at about 1 m/s."""
        return unit * np.linalg.solve(root.T, rng.normal(size=nv))

    q1 = pin.integrate(model, q1, dt**2 * motion())
    W = system.contact_rows_at(sub, q1, np.zeros(nv)).W
    v1, a = motion(), motion()
    slip = np.where(kinds == "slip", 1.0, dt)[o] * (W[k:] @ motion())
    xi = np.append(percussion * dt * rng.uniform(15.0, 20.0, k), slip)
    by_M = np.linalg.solve(root @ root.T, W.T)
    v1 += by_M @ np.linalg.lstsq(W @ by_M, xi - W @ v1)[0]
    system.dynamics(0.0, q1, v1, a)
    g_N_ddot = system.contact_rows(sub, q1, v1, a).acceleration[:k]
    a += by_M[:, :k] @ np.linalg.solve(W[:k] @ by_M[:, :k], rng.uniform(-1.0, 1.0, k) - g_N_ddot)
    U, Q, start_a, start_bar = dt * motion(), dt**2 * motion(), motion(), motion()
    f = 1 / np.einsum("ij,ij->i", W, np.linalg.solve(root @ root.T, W.T).T)[:k]
    size = np.concatenate((f, f[o]))
    memory = [size * np.append(rng.uniform(0.5, 1, k), rng.uniform(-0.3, 0.3, m)) for _ in range(2)]

    def equations_from(q, v):
        state = State(0.0, q, v, start_a, sub.index, memory=Auxiliary(start_bar, *3 * [np.zeros(0)]), dt=dt)
        return StepEquations(system, method.parameters, state, dt, sub, memory)

    first = equations_from(q1, v1)
    v = 2 * v1 - first.v_free - first.gamma_c * a - U
    dq = equations_from(q1, v).dq_free + first.beta_c * a + Q
    equations = equations_from(pin.integrate(model, q1, -dq), v)

    ev = equations.evaluate(np.concatenate((a, U, Q, np.zeros(3 * k + 2 * m))))
    if laws == "laws of the paper as a fallback":
        equations = with_laws(equations, LawOptions(paper=True))
    if laws == "captured":
        equations = with_laws(equations, LawOptions(paper=True, displaces=False))
    assert np.abs(pin.difference(model, ev.q, q1)).max() < 1e-12
    r, mu = equations.r, sub.mu
    g_N, xi_N, xi_F, g_N_ddot, gamma_F_dot = np.split(r * ev.contact.y, np.cumsum([k, k, m, k]))
    sign = np.where(level[:, None] > np.arange(3), 1.0, -1.0)
    kappa_hat = g_N + 0.7 * dt**2 * f * sign[:, 0]
    P_N = xi_N + percussion * dt * f * np.where(level > 1, 2.0, -1.0)
    la_N = g_N_ddot + 3 * f * sign[:, 2]
    d = rng.normal(size=m)
    d /= np.sqrt(np.bincount(o, d * d, k))[o]
    # a slipping contact has friction against its slip already, in about the right size
    against = -xi_F / np.sqrt(np.bincount(o, xi_F**2, k))[o]
    cone = (mu * np.abs(P_N))[o]
    P_F = np.where((kinds == "slip")[o], cone * (1.5 * against + 0.3 * d), xi_F + 0.4 * cone * d)
    la_F = gamma_F_dot + (np.where(kinds == "just started", 2.0, 0.4) * mu * np.abs(la_N))[o] * d
    # z is affine in the multipliers (102), (95), (113)
    la, z_0 = np.concatenate((la_N, la_F)), ev.z[: 2 * k + m]
    known = z_0 + np.concatenate((equations.beta_c * la_N, equations.gamma_c * la))
    x = np.concatenate((a, U, Q, np.concatenate((kappa_hat, P_N, P_F)) - known, la))

    contact = equations.evaluate(x).contact
    assert np.array_equal(np.array([contact.A, contact.B, contact.C]).T, level[:, None] > np.arange(3))
    sticks = (level > 0) & (kinds != "slip")
    assert np.array_equal(contact.stick, sticks & (P_N > 0))
    # without a normal force nothing can stick on acceleration level
    assert np.array_equal(contact.stick_a, contact.stick & (kinds == "stick") & (la_N > 0))
    size = unit * np.sqrt(np.linalg.inv(root @ root.T).diagonal())
    times = (size, dt * size, dt**2 * size)
    forces = (dt**2 * f, dt * f, dt * f[o], f, f[o])
    return Iterate(equations, x, np.concatenate((*times, *forces)))


def residual(equations, x):
    ev = equations.evaluate(x)
    return np.concatenate((*ev.R, ev.contact.R))


def whole_matrix(point, step=1e-2):
    """dR/dx by central differences, extrapolated (error step^4), with columns scaled to size one."""
    J = np.empty((len(point.x), len(point.x)))
    for i, h in enumerate(step * point.scale):
        e = np.zeros(len(point.x))
        e[i] = h
        wide, narrow = (
            (residual(point.equations, point.x + s * e) - residual(point.equations, point.x - s * e)) / (2 * s * step)
            for s in (1.0, 0.5)
        )
        J[:, i] = (4 * narrow - wide) / 3
    return J


def difference(point):
    """Largest difference of the two corrections in any unknown, relative to the largest change of any unknown."""
    R, J = residual(point.equations, point.x), whole_matrix(point)
    rows = 1 / np.abs(J).max(axis=1)
    whole = np.linalg.solve(rows[:, None] * J, -rows * R)
    reduced, dependent = point.equations.correction(point.equations.evaluate(point.x))
    assert not dependent
    return np.abs(reduced / point.scale - whole).max() / np.abs(whole).max()


def falls_with_square(sizes, found):
    return found[-1] < 1e-6 or np.polyfit(np.log(sizes), np.log(found), 1)[0] > 1.8


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("pattern", PATTERNS, ids="-".join)
@pytest.mark.parametrize("build", [point_mass, planar_ball])
def test_corrections_are_equal_where_mass_and_directions_are_constant(build, pattern, laws):
    assert difference(iterate(build(), 1e-2, [pattern], LAWS.index(laws), laws)) < 1e-6


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("pattern", PATTERNS, ids="-".join)
@pytest.mark.parametrize("build", [top, quadruped])
def test_difference_falls_with_the_square_of_the_step(build, pattern, laws):
    scene = build()
    found = [difference(iterate(scene, dt, [pattern], 1, laws, np.array([0]))) for dt in SIZES]
    assert falls_with_square(SIZES, found), found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("percussion", [0.05, 0.2, 0.3])
def test_slipping_contact_with_less_percussion_than_its_forces_make(percussion, seed):
    assert difference(iterate(point_mass(), 1e-2, [("ABC", "slip")], seed, percussion=percussion)) < 1e-6


@pytest.mark.parametrize(("build", "seed"), [*((quadruped, seed) for seed in range(4)), (anymal, 0), (anymal, 1)])
def test_four_feet_in_different_states(build, seed):
    scene = build()
    rng = np.random.default_rng(seed)
    feet = one_point_per_foot(scene)
    patterns = [PATTERNS[i] for i in rng.integers(len(PATTERNS), size=len(feet))]
    found = [difference(iterate(scene, dt, patterns, seed, "second-order", feet)) for dt in SIZES]
    assert falls_with_square(SIZES, found), found


def one_point_per_foot(scene):
    """Numbers of four contacts, one of each leg."""
    names = System(scene).contacts.names
    return np.array([next(i for i, n in enumerate(names) if n.startswith(p.geometry_a)) for p in scene.contacts])


@pytest.mark.parametrize("laws", LAWS[:2])
@pytest.mark.parametrize("pattern", PATTERNS[-2:], ids="-".join)
@pytest.mark.parametrize("build", [top])
def test_corrections_with_all_derivatives_are_exact_in_steps_of_any_length(build, pattern, laws):
    """Half of the digits are those of differences; without these derivatives more than 1e-3 of it is missing."""
    point = iterate(build(), 2e-2, [pattern], 1, laws, np.array([0]))
    given = point.equations
    twin = DifferencedEquations(given.system, given.parameters, given.state, given.dt, given.sub, given.memory)
    twin._scales = given._scales
    whole = Iterate(with_laws(twin, given.parameters.laws), point.x, point.scale)
    assert difference(whole) < 1e-5 < 1e-3 < difference(point)


@pytest.mark.parametrize("kind", [StepEquations, CompiledEquations])
@pytest.mark.parametrize("yaw", [0.0, 1e-10, 1e-8, 1e-7, 1e-6, 0.3])
def test_corners_of_an_edge_cannot_both_be_held_along_it(yaw, kind):
    """Where the edge nearly runs along a tangent that shows in the singular values, but not in a single pivot."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "foot")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(2.0, 0.2, 0.1, 0.06), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("sole", coal.Box(0.2, 0.1, 0.06), parent="foot")
    scene.add_contact("sole", "ground", mu=0.5)
    R = pin.exp3(np.array([0.0, 0.0, yaw])) @ pin.exp3(np.array([0.3, 0.0, 0.0]))
    q = np.array([0.0, 0.0, -(R @ [0.1, -0.05, -0.03])[2], *pin.Quaternion(R).coeffs()])
    system, still, none = System(scene), np.zeros(model.nv), np.zeros(0)
    sub = system.contacts.subset(np.array([0, 4]))
    state = State(0.0, q, still, still, memory=Auxiliary(still, *3 * [none]), dt=1e-3)
    nothing = np.zeros(sub.k + sub.m), np.zeros(sub.k + sub.m)
    equations = kind(system, nga.GeneralizedAlpha().parameters, state, 1e-3, sub, nothing)
    start = equations.evaluate(equations.start())
    found, dependent = equations.corrected(start)
    assert np.abs(start.y[:2]).max() < 1e-5 and start.contact.stick.all() and dependent
    # they carry alike, and along the edge they do not press against each other
    forces = found.x[3 * model.nv :][equations.layout.at_a]
    assert forces[: sub.k] == pytest.approx(np.repeat(forces[: sub.k].mean(), 2), rel=1e-9)
    along = forces[sub.k :].reshape(2, 2) @ R[:2, 0]
    assert np.abs(along).max() < 1e-6 * forces[0]
