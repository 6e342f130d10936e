"""Poisson's and Stronge's laws: Routh's construction for planar impacts, an ode in space, energy of random impacts."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ngalpha_pin.numerics.gauss_seidel import solve_contact_problem
from ngalpha_pin.numerics.two_phases import Contacts, percussions

REST = 1e-13


def pulls(G, y, mu):
    """Tangential percussions per normal one, against the velocity; a row at rest stays, or pulls all that it can."""
    moves = np.abs(y[1:]) > REST
    for kinds in product((0, 1, -1), repeat=len(mu)):
        pull = np.where(moves, -mu * np.sign(y[1:]), mu * kinds)
        stays = np.flatnonzero(~moves & (np.array(kinds) == 0))
        rows = 1 + stays
        pull[stays] = 0.0
        pull[stays] = np.linalg.solve(G[np.ix_(rows, rows)], -(G[rows] @ np.concatenate(([1.0], pull))))
        rate = (G @ np.concatenate(([1.0], pull)))[1:]
        starts = ~moves & (np.array(kinds) != 0)
        if (np.abs(pull[stays]) <= mu[stays]).all() and (rate[starts] * pull[starts] < 0.0).all():
            return pull
    raise AssertionError("no percussions")


def routh(G, before, mu, e, law):
    """Percussions of a planar impact along the straight lines of Routh's diagram, and whether its slip ended.

    The first tangential row is the slip, with mu; others, as that of rolling, have bounds of their own.
    """
    P, y, work, goal, ended, mu = np.zeros(len(G)), np.array(before), 0.0, None, False, np.atleast_1d(mu)
    while True:
        along = np.concatenate(([1.0], pulls(G, y, mu)))
        rate = G @ along
        slows = (np.abs(y[1:]) > REST) & (rate[1:] * y[1:] < 0)
        events = [(-y[1 + i] / rate[1 + i], i) for i in np.flatnonzero(slows)]
        if goal is None:
            events += [(-y[0] / rate[0], "compressed")] if rate[0] > 0 else []
        elif law == "poisson":
            events.append((goal - P[0], "over"))
        else:
            roots = np.roots([0.5 * rate[0], y[0], work - goal])
            events += [(x.real, "over") for x in roots if abs(x.imag) < 1e-12 and x.real > 1e-15]
        length, what = min(events, key=lambda event: event[0])
        work += y[0] * length + 0.5 * rate[0] * length**2
        P, y = P + length * along, y + length * rate
        if what == "compressed":
            goal, y[0] = ((1 + e) * P[0] if law == "poisson" else -e * e * work), 0.0
            work = 0.0
        elif what != "over":
            y[1 + what], ended = 0.0, ended or what == 0
        if what == "over" or (what == "compressed" and e == 0.0):
            return P, ended


def contacts(G, mu, e, law, rows=1):
    k = len(e)
    of_F = np.repeat(np.arange(k), rows)
    return Contacts(G, lambda slip: np.full(k, mu), of_F, np.array(e), np.array([law == "stronge"] * k))


def gain(G, before, P):
    return P @ (before + 0.5 * G @ P)


@pytest.mark.parametrize("law", ["poisson", "stronge"])
@pytest.mark.parametrize("n", [20, pytest.param(1000, marks=pytest.mark.long)])
def test_planar_impacts_against_the_diagram_of_routh(law, n):
    """Slip throughout, slip that ends and sticks or turns back, jamming: random inverse masses have them all."""
    rng, ends = np.random.default_rng(0), 0
    for _ in range(n):
        A = rng.normal(size=(2, 2))
        G, before = A @ A.T + 1e-3 * np.eye(2), np.array([-rng.uniform(0.1, 2), rng.normal()])
        mu, e = rng.uniform(0, 1.5), rng.uniform(0, 1)
        exact, ended = routh(G, before, mu, e, law)
        P = percussions(contacts(G, mu, [e], law), before)
        assert P == pytest.approx(exact, rel=1e-10, abs=1e-11)
        assert gain(G, before, P) <= 1e-12
        ends += ended
    assert n / 5 < ends < 4 * n / 5


@pytest.mark.parametrize("law", ["poisson", "stronge"])
@pytest.mark.parametrize("n", [20, pytest.param(1000, marks=pytest.mark.long)])
def test_planar_impacts_with_rolling_resistance(law, n):
    """A row of rolling with a cone of its own: both stop, stick and turn back at moments of their own."""
    rng, stopped = np.random.default_rng(1), np.zeros(2)
    for _ in range(n):
        A = rng.normal(size=(3, 3))
        G, before = A @ A.T + 1e-3 * np.eye(3), np.array([-rng.uniform(0.1, 2), *rng.normal(size=2)])
        bounds, e = rng.uniform(0, (1.5, 0.5)), rng.uniform(0, 1)
        works, cone = np.array([law == "stronge"]), np.array([0, 0])
        process = Contacts(G, lambda slip, mu=bounds: mu, np.arange(2), np.array([e]), works, cone)
        P, exact = percussions(process, before), routh(G, before, bounds, e, law)[0]
        assert P == pytest.approx(exact, rel=1e-10, abs=1e-11)
        assert gain(G, before, P) <= 1e-12
        stopped += np.abs(before + G @ P)[1:] < 1e-9
    assert (stopped > 0).all()


@pytest.mark.parametrize("mu, slip, left", [(0.5, 0.3, -1), (1.0, 0.3, 0), (0.5, -0.3, -1)])
@pytest.mark.parametrize("law", ["poisson", "stronge"])
def test_rod_to_which_newtons_law_gives_energy(mu, slip, left, law):
    """The tip of a rod at 34 degrees: its slip turns back, sticks, or goes on; Newton's law adds energy to two."""
    c, s = np.cos(0.6), np.sin(0.6)
    G = np.array([[1 + 3 * c * c, -3 * c * s], [-3 * c * s, 1 + 3 * s * s]])
    before, e, of_F = np.array([-1.0, slip]), 0.95, np.zeros(1, dtype=int)
    newton, _, _ = solve_contact_problem(G, before + [-e, 0.0], np.array([mu]), of_F, np.zeros(2))
    P = percussions(contacts(G, mu, [e], law), before)
    assert P == pytest.approx(routh(G, before, mu, e, law)[0], rel=1e-12)
    assert np.sign(np.round((before + G @ P)[1], 12)) == left
    assert gain(G, before, P) < 0.0
    assert (gain(G, before, newton) > 0.0) == (slip > 0)


def test_slip_that_turns_in_the_plane_of_contact():
    """Two friction rows: the direction of slip changes along a curve of an ordinary differential equation."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(3, 3))
    G, before, mu = A @ A.T + 0.2 * np.eye(3), np.array([-1.0, 0.5, -0.4]), 0.3

    def flow(p, y):
        slip = y[1:3] / np.linalg.norm(y[1:3])
        along = np.concatenate(([1.0], -mu * slip))
        return np.concatenate((G @ along, along))

    compressed = lambda p, y: y[0]  # noqa: E731
    compressed.terminal = True
    start = np.concatenate((before, np.zeros(3)))
    first = solve_ivp(flow, (0, 100), start, events=compressed, rtol=1e-11, atol=1e-13)
    end = solve_ivp(flow, (0, 0.7 * first.t[-1]), first.y[:, -1], rtol=1e-11, atol=1e-13).y[:, -1]
    turned = before[1:] @ end[1:3] / np.linalg.norm(before[1:]) / np.linalg.norm(end[1:3])
    assert turned < 0.98
    P = percussions(contacts(G, mu, [0.7], "poisson", rows=2), before)
    assert P == pytest.approx(end[3:], abs=1e-3 * end[3])


def random_impact(rng, i, rolls=False):
    """Four contacts in a plane or two in space at most, some of them at rest, each with its own coefficient."""
    rows = 1 + (i // 4) % 2
    k = 1 + i % 4 if rows == 1 else 1 + i % 2
    A = rng.normal(size=(k * (1 + rows * (1 + rolls)), rng.integers(3, 13)))  # of more or fewer coordinates than rows
    law = ("poisson", "stronge")[(i // 8) % 2]
    before = A @ rng.normal(size=A.shape[1])
    before[:k] = np.where(rng.random(k) < 0.2, 0.0, before[:k])
    before = A @ np.linalg.lstsq(A, before, rcond=None)[0]
    found = contacts(A @ A.T, rng.uniform(0, 1.2), rng.uniform(0, 1, k), law, rows)
    if rolls:
        bounds = np.concatenate((np.full(k, rng.uniform(0, 1.2)), rng.uniform(0, 0.4, k)))
        of_F = np.concatenate((found.of_F, k + found.of_F))
        found = found._replace(coefficients=lambda slip: bounds, of_F=of_F, of_cone=np.arange(2 * k) % k)
    return found, before


@pytest.mark.parametrize(
    "n, seed, rolls",
    [(24, 1, False), (24, 1, True), *(pytest.param(500, seed, False, marks=pytest.mark.long) for seed in range(20))],
)
def test_random_impacts_never_gain_energy(n, seed, rolls):
    rng, lost = np.random.default_rng(seed), 0
    for i in range(n):
        given, before = random_impact(rng, i, rolls)
        G, k = given.G, len(given.e)
        P = percussions(given, before)
        if P is None:
            lost += 1
            continue
        size = max(abs(P * before).max(), 1e-300)
        assert gain(G, before, P) <= 1e-9 * size
        assert (P[:k] >= 0.0).all()
        assert (before + G @ P)[:k].min() >= -1e-6 * abs(before).max()
    assert lost <= n // 250  # of dependent rows; such an impact is captured, as a plastic one


def test_compression_ends_where_what_is_left_is_rounding():
    """Eight rows in three coordinates, all of them at rest but for 1e-9: no percussion moves them any more."""
    rng = np.random.default_rng(5)
    for i in range(412):
        given, before = random_impact(rng, i)
    P = percussions(given, before)
    assert P is not None
    assert before + given.G @ P == pytest.approx(0.0, abs=1e-8)
    assert gain(given.G, before, P) < 0.0


def test_a_wedge_that_jams_has_nothing_to_give_back():
    """A point falls between walls on which it sticks: no percussion moves it any more, so none can do work."""
    c, s = np.cos(0.35), np.sin(0.35)
    A = np.array([[c, s], [-c, s], [-s, c], [s, c]])  # normals, then tangents
    for law in ("poisson", "stronge"):
        P = percussions(contacts(A @ A.T, 0.8, [0.6, 0.6], law), A @ [0.1, -1.0])
        assert P is not None
        assert [0.1, -1.0] + A.T @ P == pytest.approx(np.zeros(2), abs=1e-12)


def test_contacts_without_friction_give_back_what_they_are_told():
    """Two masses that do not feel each other, and two that do: with e = 1 the energy stays."""
    before = np.array([-1.0, -2.0])
    for law in ("poisson", "stronge"):
        P = percussions(contacts(np.eye(2), 0.0, [0.5, 0.25], law, rows=0), before)
        if law == "poisson":
            assert P == pytest.approx([1.5, 2.5], rel=1e-12)
        for G in (np.eye(2), np.array([[1.0, -0.6], [-0.6, 1.0]])):
            P = percussions(contacts(G, 0.0, [1.0, 1.0], law, rows=0), before)
            assert abs(gain(G, before, P)) < 1e-12
