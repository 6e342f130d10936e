"""The Newton correction reduced to the multipliers against the whole matrix from finite differences of the residual.

The reduction leaves out how M and W change with q, which enters multiplied by dt^2. Where M and W are constant the two
corrections are equal; on a robot their difference falls with dt^2.
"""

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.state import State
from ngalpha_pin.step_equations import Choice, StepEquations
from ngalpha_pin.system import System

NORMAL = ("open", "A", "AB", "ABC")
FRICTION = ("stick", "slip", "just started")
PATTERNS = [("open", "stick"), *((n, f) for n in NORMAL[1:] for f in FRICTION)]
"""Every combination of the index sets (130), (133), (136), (139), (141) of one contact; an open one has no friction."""
LAWS = ("second-order", "paper", "whole-percussion")


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


def anymal():
    pytest.importorskip("example_robot_data")
    return robots.load("anymal")[0]


def quadruped():
    return robots.load("quadruped")[0]


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


def iterate(scene, dt, patterns, seed, laws="second-order", contacts=None):
    """Velocities, impulses and forces of size one at the end of the step; only what the clock scales depends on dt."""
    system, rng = System(scene), np.random.default_rng(seed)
    method = nga.GeneralizedAlpha(rho_inf=0.6, laws="paper" if laws == "paper" else "second-order")
    sub = system.contacts.subset(np.arange(system.contacts.n) if contacts is None else contacts)
    model, k, m = system.model, sub.k, sub.m
    nv, o = model.nv, sub.of_F
    q1 = pin.integrate(model, touching(system, sub, rng), dt**2 * rng.normal(size=nv))
    W = system.contact_rows_at(sub, q1, np.zeros(nv)).W
    v1, a = rng.normal(size=nv), rng.normal(size=nv)
    xi_N = rng.uniform(0.1, 0.2, k)  # opening slowly, so that a percussion beside r xi_N has either order
    v1 += np.linalg.pinv(W[:k]) @ (xi_N - W[:k] @ v1)
    U, Q = 0.3 * rng.normal(size=nv), dt**2 * rng.normal(size=nv)
    start_a, start_bar = rng.normal(size=nv), rng.normal(size=nv)
    memory = [rng.uniform(0.5, 1.0, n) for n in (k, k, m, m)]

    def equations_from(q, v):
        state = State(0.0, q, v, start_a, start_bar, sub.index, dt=dt)
        found = StepEquations(system, method, state, dt, sub, memory)
        if laws == "whole-percussion":
            found.choose(Choice(None, whole_percussion=True))
        return found

    first = equations_from(q1, v1)
    v = 2 * v1 - first.v_free - first.gamma_c * a - U
    dq = equations_from(q1, v).dq_free + first.beta_c * a + Q
    equations = equations_from(pin.integrate(model, q1, -dq), v)

    zeros = np.zeros(3 * k + 2 * m)
    ev = equations.evaluate(np.concatenate((a, U, Q, zeros)))
    assert np.abs(pin.difference(model, ev.q, q1)).max() < 1e-12
    r, mu, f = equations.r, sub.mu, 1 / np.einsum("ij,ij->i", W, np.linalg.solve(ev.dynamics.M, W.T).T)[:k]
    level = np.array([NORMAL.index(n) for n, _ in patterns])
    sign = np.where(level[:, None] > np.arange(3), 1.0, -1.0)
    kappa_hat = r * ev.rows.g_N + 0.7 * dt**2 * f * sign[:, 0]
    P_N = np.where(level > 1, r * ev.xi[:k] + f, r * ev.xi[:k] - 0.01 * f)
    la_N = r * ev.rows.acceleration[:k] + 3 * f * sign[:, 2]

    def beside(y, radius, outside):
        """A point at 2 or 0.4 times a radius from r y, in a random direction of each contact."""
        d = rng.normal(size=m)
        d /= np.sqrt(np.bincount(o, d * d, k))[o]
        return r[o] * y + (np.where(outside, 2.0, 0.4) * radius)[o] * d

    kinds = np.array([f for _, f in patterns])
    P_F = beside(ev.xi[k:], mu * np.abs(P_N), kinds == "slip")
    la_F = beside(ev.rows.acceleration[k:], mu * np.abs(la_N), kinds == "just started")
    z = equations.impulses(kappa_hat, np.concatenate((P_N, P_F)), np.concatenate((la_N, la_F)))
    x = np.concatenate((a, U, Q, z))
    ev = equations.evaluate(x)
    assert (ev.contact.A == (level > 0)).all()
    assert (ev.contact.B == (level > 1)).all()
    assert (ev.contact.C == (level > 2)).all()
    assert (ev.contact.stick == ((level > 0) & (kinds != "slip"))).all()
    # without a normal force nothing can stick on acceleration level
    holds = (level > 0) & (kinds == "stick") & (la_N > 0)
    assert (ev.contact.stick_a == holds).all()
    times = (np.ones(nv), np.full(nv, dt), np.full(nv, dt**2))
    forces = (dt**2 * f, dt * f, f, dt * f[o], f[o])
    return Iterate(equations, x, np.concatenate((*times, *forces)))


def residual(equations, x):
    ev = equations.evaluate(x)
    return np.concatenate((ev.R_a, ev.R_U, ev.R_Q, ev.contact.R))


def whole_matrix(point, step=1e-2):
    """dR/dx by central differences, extrapolated (error step^4), with columns and rows scaled to size one."""
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
    """Largest difference of the two corrections in each block (a, U, Q, the multipliers), relative to the block."""
    R, J = residual(point.equations, point.x), whole_matrix(point)
    rows = 1 / np.abs(J).max(axis=1)
    whole = np.linalg.solve(rows[:, None] * J, -rows * R) * point.scale
    ev = point.equations.evaluate(point.x)
    reduced, dependent = point.equations.correction(ev)
    assert not dependent
    worst = 0.0
    for block in point.equations.slices:
        if block.stop > block.start:
            worst = max(worst, np.abs(reduced[block] - whole[block]).max() / np.abs(whole[block]).max())
    return worst


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("pattern", PATTERNS, ids="-".join)
@pytest.mark.parametrize("build", [point_mass, planar_ball])
def test_corrections_are_equal_where_mass_and_directions_are_constant(build, pattern, laws):
    assert max(difference(iterate(build(), 1e-2, [pattern], seed, laws)) for seed in range(3)) < 1e-6


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("pattern", PATTERNS, ids="-".join)
@pytest.mark.parametrize("build", [top, quadruped])
def test_difference_falls_with_the_square_of_the_step(build, pattern, laws):
    scene = build()
    sizes = np.array([4e-3, 2e-3, 1e-3])
    found = [difference(iterate(scene, dt, [pattern], 1, laws, np.array([0]))) for dt in sizes]
    assert found[-1] < 1e-6 or np.polyfit(np.log(sizes), np.log(found), 1)[0] > 1.8, found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("build", [quadruped, anymal])
def test_four_feet_in_different_states(build, seed):
    scene = build()
    rng = np.random.default_rng(seed)
    feet = one_point_per_foot(scene)
    patterns = [PATTERNS[i] for i in rng.integers(len(PATTERNS), size=len(feet))]
    sizes = np.array([4e-3, 2e-3, 1e-3])
    found = [difference(iterate(scene, dt, patterns, seed, "second-order", feet)) for dt in sizes]
    assert found[-1] < 1e-6 or np.polyfit(np.log(sizes), np.log(found), 1)[0] > 1.8, found


def one_point_per_foot(scene):
    """Numbers of four contacts, one of each leg."""
    names = System(scene).contacts.names
    return np.array([next(i for i, n in enumerate(names) if n.startswith(p.geometry_a)) for p in scene.contacts])
