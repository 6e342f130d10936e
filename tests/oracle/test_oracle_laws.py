"""The laws of one contact: the package's residuals and index sets against the oracle's, on random iterates."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from oracle_twin import Twin
from random_iterates import DT, random_iterate, sets_of, with_laws

import ngalpha_pin as nga
from ngalpha_pin import oracle
from ngalpha_pin.oracle.equations import contact_kinematics, contact_residual, smooth_residual
from ngalpha_pin.oracle.laws import Forces, Kinematics, Law, index_sets, prox_updates, residuals
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.system.state import Auxiliary, State

SYSTEMS = ("rotating_ball", "ball_in_corner", "ball_in_cylinder", "painleve_rod", "hopper", "tippe_top")
LAWS = ("second-order", "paper")
SEEDS = range(60)
BRANCHES = {"open", *(f"{n} {f}" for n in ("A", "AB", "ABC") for f in ("slip", "just started", "stick"))}
E = 0.5, 0.2


def same(found, wanted, tolerance=1e-12):
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max(initial=0.0) <= tolerance * max(1.0, np.abs(wanted).max(initial=0.0))


def random_step(twin, laws, seed):
    """One random step in both: equations of the package, and a step of the oracle with their prox parameters."""
    rng, p, sub = np.random.default_rng(seed), twin.problem, twin.every
    e_N, e_F = E if seed % 2 else (0.0, 0.0)  # with restitution and without
    table = twin.system.contacts  # whose arrays other systems have too
    table.e_N, table.e_F = np.full_like(table.e_N, e_N), np.full_like(table.e_F, e_F)
    sub = type(sub)(twin.system.contacts, sub.index)
    p = replace(p, contacts=tuple(replace(c, law=replace(c.law, e_N=e_N, e_F=e_F)) for c in p.contacts))
    q = p.moved(twin.q0, 1e-2 * rng.normal(size=p.nv))
    v, a = rng.normal(size=(2, p.nv))
    la, la_bar = rng.normal(size=(2, sub.k + sub.m))
    nothing = np.zeros(0)
    auxiliary = Auxiliary(a + 0.1 * rng.normal(size=p.nv), nothing, nothing, nothing)
    la_b = np.zeros(len(p.rows))
    state = State(0.3, q, v, a, sub.index, la_b=la_b, memory=auxiliary, dt=DT)
    parameters = nga.GeneralizedAlpha(rho_inf=0.6, laws=laws).parameters
    equations = StepEquations(twin.system, parameters, state, DT, sub, (la, la_bar))
    equations.evaluate(equations.start())  # sets the scales
    k, s = sub.k, twin.signs
    start = oracle.State(
        0.3, q, v, a, auxiliary.a_bar, la[:k], la_bar[:k], la[k:] * s, la_bar[k:] * s, la_b, DT, *np.zeros((4, 0))
    )
    first = [2 * k + F.start for F in p.friction]
    r_N, r_F = equations.r[:k], equations.r[first]
    step = oracle.Step(p, oracle.Parameters(0.6), start, DT, np.ones(k, dtype=bool), laws, r_N, r_F)
    return with_laws(equations, parameters.laws), step


def compare(twin, laws, seed):
    """Everything that is asked of both at one iterate; the index sets that were met."""
    equations, step = random_step(twin, laws, seed)
    sub, s, n_g = equations.sub, twin.signs, len(step.problem.rows)
    k, m, n_c = sub.k, sub.m, equations.layout.n_c
    x = random_iterate(equations, seed, (-1.3 if seed % 4 < 2 else -0.5, 0.5, 2.0))
    ev = equations.evaluate(x)
    smooth, z = x[: 3 * equations.nv], x[3 * equations.nv :]
    kappa_N, La_N, La_F, la_N, la_F, _ = np.split(z, np.cumsum((k, k, m, k, m)))
    ours = np.concatenate((smooth, np.zeros(3 * n_g), kappa_N, La_N, la_N, La_F * s, la_F * s))
    end = oracle.end_of_step(step, ours)
    forces, kinematics, sets = end.forces, contact_kinematics(step, end), oracle.contact_sets(step, end)
    for found, names, wanted in (
        (forces, ("kappa_hat_N", "P_N", "P_F", "la_N", "la_F"), ev.z[:n_c]),
        (kinematics, ("g_N", "xi_N", "xi_F", "g_N_ddot", "gamma_F_dot"), ev.contact.y),
    ):
        columns = [np.hstack([getattr(one, name) for one in found]) for name in names]
        same(np.concatenate([c * s if "_F" in name else c for c, name in zip(columns, names, strict=True)]), wanted)
    for i, name in enumerate(("A", "B", "C", "stick", "stick_a")):
        wanted = getattr(ev.contact, name)
        friction = np.isin(np.arange(k), sub.of_F) | (i < 3)
        assert np.array_equal(np.array(sets)[friction, i], wanted[friction]), name
    R = contact_residual(step, end, sets)
    R_kappa, R_La_N, R_la_N, R_La_F, R_la_F = np.split(R, np.cumsum((k, k, k, m)))
    same(np.concatenate((R_kappa, R_La_N, R_La_F * s, R_la_N, R_la_F * s)), ev.contact.R)
    same(smooth_residual(step, ours, end)[: 3 * equations.nv], ev.R.ravel())
    assert np.array_equal(oracle.residual(step, ours)[step.n_y :], R)
    return sets_of(ev.contact, sub)


@pytest.mark.parametrize("laws", LAWS)
def test_laws_agree_on_random_iterates(laws):
    met = Counter()
    for name in SYSTEMS:
        twin = Twin(name)
        for seed in SEEDS:
            met += compare(twin, laws, seed)
    assert {branch for branch in BRANCHES | {"capped"} if not met[branch]} == set(), met


LAW = Law(mu=0.4, e_N=0.0, e_F=0.0, drilling=0.0)


def random_contact(rng):
    """Kinematics and forces of one contact, near the edges of all sets."""
    numbers = rng.normal(size=4)
    vectors = rng.normal(size=(5, 2)) * rng.choice([0.1, 1.0], (5, 1))
    y = Kinematics(numbers[0], numbers[1], vectors[0], numbers[2], vectors[1], vectors[2])
    P_N, la_N, La_N, kappa = np.abs(rng.normal(size=4))
    return y, Forces(kappa, P_N, vectors[3], la_N, vectors[4], La_N, rng.normal(size=2))


@pytest.mark.parametrize("laws", LAWS)
def test_forces_that_no_update_changes_are_those_whose_residuals_vanish(laws):
    """The fixed points of (146) solve (129)-(142), with kinematics that are given."""
    rng, seen = np.random.default_rng(3), Counter()
    for _ in range(50):
        y, z = random_contact(rng)
        sets = index_sets(LAW, y, z, 1.0, 1.0)
        # kinematics that vanish where the sets ask for it
        zero = np.zeros(2)
        y = y._replace(
            g_N=0.0 if sets.A else abs(y.g_N), xi_N=0.0 if sets.B else abs(y.xi_N),
            g_N_ddot=0.0 if sets.C else abs(y.g_N_ddot), xi_F=zero if sets.D_st else y.xi_F,
            gamma_F_dot=zero if sets.E_st else y.gamma_F_dot,
        )  # fmt: skip
        for _ in range(1000):
            kappa_hat_N, P_N, la_N, P_F, la_F = prox_updates(LAW, y, z, 1.0, 1.0, laws)
            z = Forces(kappa_hat_N, P_N, P_F, la_N, la_F, P_N, P_F)
        sets = index_sets(LAW, y, z, 1.0, 1.0)
        R = residuals(LAW, y, z, sets, laws)
        assert np.abs(np.hstack(R)).max() <= 1e-6
        assert P_N >= 0.0 and np.linalg.norm(P_F) <= LAW.mu * P_N + 1e-12
        seen[sets] += 1
    assert len(seen) >= 6
