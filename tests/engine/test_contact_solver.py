"""The compiled contact solver: closed forms, all cases tried, units, warm starts, and inputs that stay as they are."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from ngalpha_pin.engine.contact_solver import ContactSolver, Group, Kind
from ngalpha_pin.numerics.gauss_seidel import violation

MASS, G = 2.0, 9.81


def block(mu, angle, dt=0.01):
    """A block at rest on a slope: rows along the normal and two tangents, percussions of one time step."""
    gravity = dt * G * np.array([-np.cos(angle), np.sin(angle), 0.0])
    return [MASS * np.eye(3)], [Group([(0, np.eye(3))], gravity, mu=mu)]


@pytest.mark.parametrize("mu", [0.49, 0.51])
def test_block_on_a_slope_sticks_within_the_cone_and_slips_outside(mu):
    angle, weight = np.arctan(0.5), 0.01 * MASS * G
    P, work = ContactSolver().solve(*block(mu, angle), tolerance=1e-12)
    assert work["solved"]
    force = min(mu * np.cos(angle), np.sin(angle))
    assert P == pytest.approx(weight * np.array([np.cos(angle), -force, 0.0]), rel=1e-10, abs=1e-13)


@pytest.mark.parametrize(("bound", "expected"), [(0.5, -0.3), (0.2, -0.2)])
def test_joint_friction_within_and_at_its_bound(bound, expected):
    groups = [Group([(0, np.ones((1, 1)))], np.array([0.3]), Kind.BOUNDED, bounds=(-bound, bound))]
    P, work = ContactSolver().solve([np.eye(1)], groups)
    assert work["solved"] and P == pytest.approx([expected], rel=1e-9)


def test_bilateral_rows_that_repeat_each_other_share_the_load():
    row = Group([(0, np.array([[1.0, 0.0]]))], np.array([0.7]), Kind.BOUNDED)
    P, work = ContactSolver().solve([np.diag([2.0, 3.0])], [row, row])
    assert work["solved"] and P.sum() == pytest.approx(-1.4, rel=1e-8)


@pytest.mark.parametrize("spin", [0.0, 0.1, 10.0])
def test_drilling_friction_takes_from_sliding_friction(spin):
    """On an isotropic body friction is against the slip, of which the third row is a part."""
    P, work = ContactSolver().solve([np.eye(4)], [Group([(0, np.eye(4))], np.array([-1.0, 3.0, 4.0, spin]), mu=0.5)])
    slip = np.array([3.0, 4.0, spin])
    assert work["solved"] and P == pytest.approx([1.0, *(-0.5 * slip / np.linalg.norm(slip))], rel=1e-8)


def random_problem(rng, k, rows, nv):
    """Contacts on one tree; and the same as G, b, mu and of_F with all normal rows first."""
    J = rng.normal(size=(k, 1 + rows, nv))
    b, mu = rng.normal(size=(k, 1 + rows)), rng.uniform(0.1, 0.4, k)
    groups = [Group([(0, J[i])], b[i], mu=mu[i]) for i in range(k)]
    order = np.concatenate((np.arange(k) * (1 + rows), [i * (1 + rows) + 1 + f for i in range(k) for f in range(rows)]))
    W = J.reshape(-1, nv)[order.astype(int)]
    return groups, order.astype(int), W @ W.T, b.ravel()[order.astype(int)], mu, np.repeat(np.arange(k), rows)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_planar_solutions_are_among_those_of_all_cases(k):
    rng, solver = np.random.default_rng(k), ContactSolver()
    for _ in range(40):
        groups, order, D, b, mu, _ = random_problem(rng, k, 1, 8 * k)
        P, work = solver.solve([np.eye(8 * k)], groups, tolerance=1e-11)
        assert work["solved"]
        found = []
        for case in product((None, 0.0, 1.0, -1.0), repeat=k):  # open, sticks, slips one way or the other
            A, c = np.eye(2 * k), np.zeros(2 * k)
            for j, side in enumerate(case):
                if side is not None:
                    A[j], c[j] = D[j], -b[j]
                    A[k + j] = D[k + j] if side == 0.0 else A[k + j]
                    c[k + j] = -b[k + j] if side == 0.0 else 0.0
                    A[k + j, j] = A[k + j, j] if side == 0.0 else side * mu[j]
            x = np.linalg.solve(A, c)
            y = b + D @ x
            fits = all(
                y[j] >= 0 if s is None else x[j] >= 0 and (s * y[k + j] >= 0 if s else abs(x[k + j]) <= mu[j] * x[j])
                for j, s in enumerate(case)
            )
            found += [x] if fits else []
        assert min(np.abs(P[order] - x).max() for x in found) < 1e-8


@pytest.mark.parametrize("rows", [0, 1, 2, 3])
def test_judge_agrees_where_directions_are_dependent(rows):
    rng, solver = np.random.default_rng(rows), ContactSolver()
    for _ in range(20):
        groups, order, D, b, mu, of_F = random_problem(rng, 6, rows, 4 * (1 + rows))
        W = np.concatenate([group.J[0][1] for group in groups])
        moves = W @ rng.normal(size=4 * (1 + rows))  # velocities of a body: a solution exists
        groups = [Group(g.J, moves[i * (1 + rows) : (i + 1) * (1 + rows)], mu=g.mu) for i, g in enumerate(groups)]
        P, work = solver.solve([np.eye(4 * (1 + rows))], groups)
        assert work["solved"]
        assert violation(D, moves[order], mu, of_F, P[order]) < 1e-7 * np.abs(moves).max()


def test_a_solution_is_taken_as_it_is_and_units_scale_it():
    groups, *_ = random_problem(np.random.default_rng(1), 5, 2, 30)
    solver, M = ContactSolver(), [np.eye(30)]
    P, work = solver.solve(M, groups)
    again, none = solver.solve(M, groups, P)
    assert work["solved"] and none["corrections"] == none["sweeps"] == 0 and (again == P).all()
    scaled = [Group(g.J, 1e6 * g.bias, mu=g.mu) for g in groups]
    assert solver.solve([1e9 * M[0]], scaled)[0] == pytest.approx(1e15 * P, rel=1e-9)


def test_same_bits_and_no_write_on_what_is_given():
    groups, *_ = random_problem(np.random.default_rng(2), 8, 2, 12)
    guess = np.ones(24)
    for x in (guess, *(g.bias for g in groups), *(g.J[0][1] for g in groups)):
        x.setflags(write=False)
    runs = [ContactSolver().solve([np.eye(12)], groups, guess)[0] for _ in range(2)]
    assert (runs[0] == runs[1]).all() and (guess == 1.0).all()


def test_shapes_that_do_not_fit_are_named():
    with pytest.raises(ValueError, match="J does not have the rows"):
        ContactSolver().solve([np.eye(3)], [Group([(0, np.eye(2))], np.zeros(3))])


@pytest.mark.parametrize("name", ["pile9", "pile10", "wall22"])
def test_problems_that_steps_have_posed(name):
    """Sixty-four balls at rest in a box from the forces of the step before, and a wall pushed sideways from nothing."""
    with np.load(Path(__file__).with_name("posed_problems.npz")) as data:
        M, trees, J, mu, bias, guess = (data[f"{name}_{x}"] for x in ("M", "trees", "J", "mu", "bias", "guess"))
    groups = [
        Group([(int(t), J[i, leg]) for leg, t in enumerate(trees[i]) if t >= 0], bias[i], mu=mu[i])
        for i in range(len(mu))
    ]
    solver = ContactSolver()
    P, work = solver.solve(M, groups, guess.ravel())
    assert work["solved"] and work["error"] <= 1e-9
    assert solver.solve(M, groups, P)[1]["corrections"] == 0
