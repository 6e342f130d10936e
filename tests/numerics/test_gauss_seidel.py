"""One-level contact problem: its answers obey Signorini and Coulomb, and are those of trying all cases."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

from ngalpha_pin.numerics.gauss_seidel import forces_of_closed_contacts, solve_contact_problem
from ngalpha_pin.numerics.proximal_newton import Rows, proximal_newton


def problem(rng, k, rows, nv=12):
    """A random problem of k contacts with so many friction rows each."""
    J = rng.normal(size=(k * (1 + rows), nv))
    return J @ J.T, rng.normal(size=len(J)), rng.uniform(0.1, 1.0, k), np.repeat(np.arange(k), rows)


def violation(G, b, mu, of_F, P):
    """Largest violation of the laws, in units of b [m/s] and of P times the diagonal of G."""
    k = len(mu)
    y, unit = b + G @ P, G.diagonal().max()
    worst = [max(0.0, -y[:k].min()), max(0.0, -P[:k].min() * unit), np.abs(y[:k] * P[:k]).max() * unit]
    for j in range(k):
        f = k + np.flatnonzero(of_F == j)
        slip, force, bound = np.linalg.norm(y[f]), np.linalg.norm(P[f]), mu[j] * P[j]
        worst.append(max(0.0, force - bound) * unit)
        if slip > 1e-7:  # then the force is on the edge of the cone and against the slip
            worst.append(np.abs(P[f] + bound * y[f] / slip).max() * unit)
    return max(worst)


@pytest.mark.parametrize("rows", [0, 1, 2, 3])
@pytest.mark.parametrize("k", [1, 2, 4])
def test_solution_obeys_the_laws(k, rows):
    rng = np.random.default_rng(10 * k + rows)
    for _ in range(30):
        G, b, mu, of_F = problem(rng, k, rows, nv=4 * k * (1 + rows))
        P, converged, sweeps = solve_contact_problem(G, b, mu, of_F, np.zeros(len(b)))
        assert converged
        assert violation(G, b, mu, of_F, P) < 1e-9


@pytest.mark.parametrize("first", [0.0, 1.0, 100.0])
def test_first_guess_does_not_matter(first):
    rng = np.random.default_rng(3)
    for _ in range(20):
        G, b, mu, of_F = problem(rng, 2, 2, nv=30)
        mu = 0.3 * mu  # little friction: the solution is unique
        P = solve_contact_problem(G, b, mu, of_F, np.zeros(6))[0]
        other = solve_contact_problem(G, b, mu, of_F, np.full(6, first))[0]
        assert np.abs(P - other).max() < 1e-9 * max(1.0, np.abs(P).max())


def test_proximal_method_from_nothing():
    """Many contacts on few bodies, and little friction: far more directions than can be independent."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        G, b, mu, of_F = problem(rng, 20, 2, nv=24)
        W = np.linalg.cholesky(G + 1e-12 * np.eye(len(b)))
        b = -np.abs(W @ rng.normal(size=len(b)))  # approach, and slip of any direction
        P, found = proximal_newton(G, b, Rows(0.2 * mu, of_F), np.zeros(len(b)), 1e-11)
        assert found
        assert violation(G, b, 0.2 * mu, of_F, P) < 1e-8 * np.abs(b).max() * len(b)


def test_proximal_method_carries_a_tall_stack():
    """The force at every joint of a stack is the weight above it; one sweep carries it on by one body."""
    n, weight = 100, 9.81e-3
    M = np.linspace(1.0, 3.0, n)
    W = np.eye(n) - np.eye(n, k=-1)
    G, b = W / M @ W.T, np.concatenate(([-weight], np.zeros(n - 1)))
    P, found = proximal_newton(G, b, Rows(np.zeros(n), np.zeros(0, dtype=int)), np.zeros(n), 1e-11)
    assert found
    assert P == pytest.approx(weight * np.cumsum(M[::-1])[::-1], rel=1e-7)


def test_proximal_method_with_joint_friction():
    """Rows between constant bounds: no slip inside of them, slip against the torque at them."""
    rng, inside, outside = np.random.default_rng(7), 0, 0
    for _ in range(20):
        k, f = 4, 12
        J = rng.normal(size=(3 * k, 14))
        J = np.concatenate((J, np.eye(14)[:f]))  # more rows than coordinates
        G, b = J @ np.diag(rng.uniform(1.0, 30.0, 14)) @ J.T, J @ rng.normal(size=14)
        mu, of_F, bound = rng.uniform(0.1, 0.4, k), np.repeat(np.arange(k), 2), rng.uniform(1e-3, 0.1, f)
        P, found = proximal_newton(G, b, Rows(mu, of_F, (-bound, bound)), np.zeros(len(b)), 1e-11)
        assert found
        j, y = 3 * k, b + G @ P
        assert violation(G[:j, :j], y[:j] - G[:j, :j] @ P[:j], mu, of_F, P[:j]) < 1e-7
        sticks = np.abs(P[j:]) < bound * (1 - 1e-9)
        assert np.abs(y[j:][sticks]).max(initial=0.0) < 1e-7
        assert (np.abs(P[j:]) <= bound * (1 + 1e-9)).all() and (y[j:][~sticks] * P[j:][~sticks] < 1e-9).all()
        inside, outside = inside + sticks.sum(), outside + (~sticks).sum()
    assert inside > 40 and outside > 40


def planar_cases(G, b, mu):
    """All solutions with one friction row per contact, by trying open, stick, and slip to either side."""
    k, found = len(mu), []
    for case in product(("open", "stick", 1.0, -1.0), repeat=k):
        A, c = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
        for j, kind in enumerate(case):
            if kind == "open":
                A[j, j] = A[k + j, k + j] = 1.0
                continue
            A[j], c[j] = G[j], -b[j]
            if kind == "stick":
                A[k + j], c[k + j] = G[k + j], -b[k + j]
            else:
                A[k + j, k + j], A[k + j, j] = 1.0, kind * mu[j]
        try:
            P = np.linalg.solve(A, c)
        except np.linalg.LinAlgError:
            continue
        y, fits = b + G @ P, True
        for j, kind in enumerate(case):
            if kind == "open":
                fits &= y[j] >= 0
            else:
                fits &= P[j] >= 0
                fits &= abs(P[k + j]) <= mu[j] * P[j] if kind == "stick" else kind * y[k + j] >= 0
        if fits:
            found.append(P)
    return found


@pytest.mark.parametrize("k", [1, 2])
def test_planar_solution_is_one_of_those_found_by_trying(k):
    rng = np.random.default_rng(k)
    for _ in range(100):
        G, b, mu, of_F = problem(rng, k, 1, nv=6 * k)
        P, converged, _ = solve_contact_problem(G, b, mu, of_F, np.zeros(2 * k))
        assert converged
        assert min(np.abs(P - x).max() for x in planar_cases(G, b, mu)) < 1e-8 * max(1.0, np.abs(P).max())


def test_sliding_direction_in_space_by_a_scalar_equation():
    """One contact in space, G isotropic: friction is against the slip, whose direction is that of b_F."""
    g_N, g_F, mu = 2.0, 3.0, 0.4
    b = np.array([-1.0, 3.0, 4.0])
    P = solve_contact_problem(np.diag([g_N, g_F, g_F]), b, np.array([mu]), np.array([0, 0]), np.zeros(3))[0]
    assert P == pytest.approx([0.5, -0.6 * mu * 0.5, -0.8 * mu * 0.5])
    # anisotropic: y_F = (b_F + G_F P_F) with P_F = -mu P_N (cos, sin) and y_F in the same direction
    G = np.diag([g_N, 3.0, 9.0])

    def across(angle):
        d = np.array([np.cos(angle), np.sin(angle)])
        y = b[1:] - np.array([3.0, 9.0]) * mu * 0.5 * d
        return y[0] * d[1] - y[1] * d[0]

    angle = brentq(across, 0.1, 1.5)
    P = solve_contact_problem(G, b, np.array([mu]), np.array([0, 0]), np.zeros(3))[0]
    assert P[1:] == pytest.approx(-mu * 0.5 * np.array([np.cos(angle), np.sin(angle)]), abs=1e-10)


def test_redundant_contacts_share_the_load():
    """Four corners of a box: the forces are not unique, their sum is."""
    corners = 0.1 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    W_N = np.column_stack([np.ones(4), corners[:, 1], -corners[:, 0]])
    M = np.diag([1.0, 0.01, 0.01])
    G = W_N @ np.linalg.solve(M, W_N.T)
    v = np.array([-2.0, 0.3, -0.2])
    P, converged, _ = solve_contact_problem(G, W_N @ v, np.zeros(4), np.zeros(0, dtype=int), np.zeros(4))
    assert converged
    assert violation(G, W_N @ v, np.zeros(4), np.zeros(0, dtype=int), P) < 1e-9
    # it comes to rest flat on the ground
    assert v + np.linalg.solve(M, W_N.T @ P) == pytest.approx(np.zeros(3), abs=1e-9)


def test_contacts_that_all_open_have_no_forces():
    rng = np.random.default_rng(0)
    G, b, mu, of_F = problem(rng, 3, 2, nv=20)
    b[:3] = np.abs(b[:3])
    P, converged, sweeps = solve_contact_problem(G, b, mu, of_F, np.zeros(9))
    assert converged
    assert not P.any()
    assert sweeps == 1


def test_scaling_of_units_scales_the_answer():
    rng = np.random.default_rng(5)
    G, b, mu, of_F = problem(rng, 3, 2, nv=40)
    P, _, sweeps = solve_contact_problem(G, b, mu, of_F, np.zeros(9))
    scaled, _, same = solve_contact_problem(1e-9 * G, 1e6 * b, mu, of_F, np.zeros(9))
    assert sweeps == same
    assert scaled == pytest.approx(1e15 * P, rel=1e-12)


def test_limit_of_the_sweeps_is_reported():
    rng = np.random.default_rng(7)
    G, b, mu, of_F = problem(rng, 4, 2, nv=13)
    b[:4] = -1.0
    _, converged, sweeps = solve_contact_problem(G, b, mu, of_F, np.zeros(12), max_sweeps=3)
    assert (converged, sweeps) == (False, 3)


def test_no_contact_at_all():
    none = np.zeros(0)
    P, converged, _ = solve_contact_problem(np.zeros((0, 0)), none, none, none.astype(int), none)
    assert converged
    assert P.shape == (0,)


def test_forces_of_closed_contacts_slip_where_told():
    """Contact 0 slides in a given direction, contact 1 sticks, contact 2 is open."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        G, b, mu, of_F = problem(rng, 3, 2, nv=40)
        b[:3] = -np.abs(b[:3]) - 1.0
        closed, slip = np.array([True, True, False]), np.zeros(6)
        slip[:2] = [0.6, -0.8]
        la, converged = forces_of_closed_contacts(G, b, mu, of_F, closed, slip)
        assert converged
        y = b + G @ la
        assert la[3:5] == pytest.approx(-mu[0] * la[0] * slip[:2], abs=1e-12)
        assert not la[[2, 7, 8]].any()
        assert (la[:2] >= 0).all()
        assert np.abs(y[:2] * la[:2]).max() < 1e-9
        assert np.linalg.norm(la[5:7]) <= mu[1] * la[1] * (1 + 1e-9) + 1e-12
        if np.linalg.norm(la[5:7]) < 0.999 * mu[1] * la[1]:
            assert np.abs(y[5:7]).max() < 1e-9


@pytest.mark.parametrize("rows, bounded", [(0, 0), (1, 0), (2, 3), (3, 0)])
def test_the_engine_finds_what_python_finds(rows, bounded):
    """Also in the number of sweeps, from nothing and from a guess, with dependent directions and joint friction."""
    rng = np.random.default_rng(rows)
    for i in range(12):
        J = rng.normal(size=(4 * (1 + rows) + bounded, 24 if i % 2 else 9))
        b, mu, of_F = rng.normal(size=len(J)), rng.uniform(0.0, 0.4, 4), np.repeat(np.arange(4), rows)
        given = J @ J.T, b, mu, of_F, rng.uniform(size=len(J)) * (i % 3), 1e-11, 400
        bounds = -rng.uniform(size=bounded), rng.uniform(size=bounded)
        P, solved, sweeps = solve_contact_problem(*given, bounds=bounds, in_engine=True)
        wanted, as_well, count = solve_contact_problem(*given, bounds=bounds)
        assert (solved, sweeps) == (as_well, count)
        if i % 2:  # no dependent directions
            assert np.abs(P - wanted).max() <= 1e-9 * np.abs(wanted).max()
        y, y_wanted = (b + given[0] @ x for x in (P, wanted))
        assert np.abs(y - y_wanted).max() <= 1e-7 * np.abs(b).max()
