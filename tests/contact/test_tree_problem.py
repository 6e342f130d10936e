"""Contact problems on the trees: the matrix that is never formed, the laws, and contacts that do not touch."""

import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin import robots
from ngalpha_pin.contact.tree_problem import TreeProblem
from ngalpha_pin.engine.contact_solver import ContactSolver
from ngalpha_pin.numerics.gauss_seidel import forces_of_closed_contacts, solve_contact_problem, violation
from ngalpha_pin.numerics.tree_matrix import TreeMatrix
from ngalpha_pin.system.system import System


@pytest.fixture(scope="module")
def posed():
    """Twelve of the contacts of eight balls in a box: the problem, G and random velocities."""
    system = System(robots.load("balls_in_box", side=2, layers=2)[0])
    rng, nv = np.random.default_rng(3), system.nv
    sub = system.contacts.subset(np.sort(rng.choice(system.contacts.n, 12, replace=False)))
    q = pin.integrate(system.model, pin.neutral(system.model), rng.normal(size=nv))
    M = system.dynamics(0.0, q, np.zeros(nv), np.zeros(nv)).M.copy()
    W = system.contact_rows(sub, q, np.zeros(nv), np.zeros(nv)).W
    problem = TreeProblem(ContactSolver(), system.contact_blocks(sub), TreeMatrix.of(system.trees, M), W)
    return problem, sub, W @ np.linalg.solve(M, W.T), W @ rng.normal(size=nv)


def test_response(posed):
    problem, sub, G, _ = posed
    P = np.random.default_rng(0).normal(size=sub.k + sub.m)
    assert problem.response(P) == pytest.approx(G @ P, rel=1e-12, abs=1e-12 * np.abs(G @ P).max())


def test_laws_hold_for_contacts_that_touch_and_others_carry_nothing(posed):
    problem, sub, G, b = posed
    touches = np.arange(sub.k) % 3 > 0
    P, solved = problem.solve(b, sub.mu, touches, np.zeros(len(b)), 1e-11)
    rows = np.concatenate((touches, touches[sub.of_F]))
    place = np.cumsum(touches) - 1
    assert solved and P[rows].any() and not P[~rows].any()
    part = G[np.ix_(rows, rows)], b[rows], sub.mu[touches], place[sub.of_F[touches[sub.of_F]]]
    assert violation(*part, P[rows]) < 1e-9 * np.abs(b).max()


def test_friction_along_a_given_slip(posed):
    problem, sub, G, b = posed
    slip = np.where(np.arange(sub.m) // 2 % 2 > 0, 1.0, 0.0) * np.linspace(1.0, 2.0, sub.m)
    speed = np.sqrt(np.bincount(sub.of_F, slip * slip, sub.k))
    direction = -slip / np.where(speed > 0.0, speed, 1.0)[sub.of_F]
    every = np.ones(sub.k, dtype=bool)
    P, solved = problem.solve(b, sub.mu, every, np.zeros(len(b)), 1e-12, speed > 0.0, direction)
    wanted, converged = forces_of_closed_contacts(G, b, sub.mu, sub.of_F, every, slip)
    assert solved and converged and (P[: sub.k] > 0.0)[speed > 0.0].any()
    assert G @ P == pytest.approx(G @ wanted, abs=1e-9 * np.abs(b).max())


def test_nothing_touches(posed):
    problem, sub, _, b = posed
    P, solved = problem.solve(b, sub.mu, np.zeros(sub.k, dtype=bool), np.ones(len(b)), 1e-9)
    assert solved and not P.any()


def test_normal_percussions_without_friction(posed):
    """Friction that is tied to nothing, as the gaps have it."""
    problem, sub, G, b = posed
    k, every = sub.k, np.ones(sub.k, dtype=bool)
    P, solved = problem.solve(b, np.ones(k), every, np.zeros(len(b)), 1e-12, every, np.zeros(sub.m))
    wanted, converged, _ = solve_contact_problem(G[:k, :k], b[:k], np.zeros(k), sub.of_F[:0], np.zeros(k))
    assert solved and converged and not P[k:].any()
    assert G[:k, :k] @ P[:k] == pytest.approx(G[:k, :k] @ wanted, abs=1e-9 * np.abs(b).max())
