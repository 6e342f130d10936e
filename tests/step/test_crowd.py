"""Many contacts: equations on the trees and compiled sweeps are those of dense twins, packings rest, runs repeat."""

import sys
from collections import Counter
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import random_inertia
from random_iterates import DT, random_iterate, sets_of, with_laws

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.numerics import proximal_newton
from ngalpha_pin.numerics.gauss_seidel import solve_contact_problem, violation
from ngalpha_pin.step import crowd as crowd_equations
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.crowd import CrowdEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.fixed_point import by_percussions
from ngalpha_pin.step.kinds import step_equations
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.regime import FEW
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

CHOICES = {
    "second-order": LawOptions(paper=False),
    "paper": LawOptions(paper=True),
    "captured": LawOptions(paper=True, displaces=False),
    "percussions": LawOptions(paper=True, displaces=False, accelerates=False),
}


def same(found, wanted, tolerance):
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= tolerance * np.abs(wanted).max()


@pytest.fixture(scope="module")
def balls():
    """Eight balls in a box."""
    return System(robots.load("balls_in_box", side=2, layers=2)[0])


def both(system, n, seed):
    """Sparse and dense equations of a random step with n of the contacts."""
    rng, nv = np.random.default_rng(seed), system.nv
    index = np.sort(rng.choice(system.contacts.n, n, replace=False))
    sub = system.contacts.subset(index)
    q = pin.integrate(system.model, pin.neutral(system.model), rng.normal(size=nv))
    v, (a, a_bar) = rng.normal(size=nv), rng.normal(size=(2, nv))
    state = State(0.3, q, v, a, sub.index, memory=Auxiliary(a_bar, *3 * [np.zeros(0)]), dt=DT)
    memory = tuple(rng.normal(size=sub.k + sub.m) for _ in range(2))
    method = nga.GeneralizedAlpha(rho_inf=0.6)
    found = [kind(system, method.parameters, state, DT, sub, memory) for kind in (CrowdEquations, StepEquations)]
    for equations in found:
        equations.evaluate(equations.start())  # sets the scales
    return found


@pytest.fixture(scope="module")
def trees():
    """Trees of joints of several kinds, some of two links; spheres on all of them."""
    model, rng = pin.Model(), np.random.default_rng(0)
    kinds, joints = (pin.JointModelFreeFlyer, pin.JointModelPlanar, pin.JointModelRX, pin.JointModelSpherical), []
    for i in range(9):
        joints.append(model.addJoint(0, kinds[i % 4](), pin.SE3.Random(), f"body_{i}"))
        if i < 3:
            joints.append(model.addJoint(joints[-1], pin.JointModelRY(), pin.SE3.Random(), f"link_{i}"))
    for joint in joints:
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        model.addJointFrame(joint)
    model.armature = rng.uniform(0.1, 0.2, model.nv)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for joint in joints:
        pose = pin.SE3(np.eye(3), 0.2 * rng.normal(size=3))
        scene.add_geometry(f"g{joint}", coal.Sphere(0.1), parent=model.names[joint], placement=pose)
    scene.add_contact("g*", "ground", mu=0.4)
    for a, b in ((1, 3), (3, 5), (2, 4), (4, 7), (6, 8), (8, 9), (10, 11)):
        scene.add_contact(f"g{a}", f"g{b}", mu=0.3)
    return System(scene)


@pytest.mark.parametrize("laws", CHOICES)
@pytest.mark.parametrize("name", ["balls", "trees"])
def test_equations_on_the_trees_are_the_dense_ones(name, laws, request, monkeypatch):
    # a direction with the eigenvalue s of the scaled matrix is off by 2 SHIFT / s
    monkeypatch.setattr(crowd_equations, "SHIFT", 1e-13)
    system, sets = request.getfixturevalue(name), Counter()
    assert system.many_trees
    for seed in range(6):
        sparse, dense = both(system, 12, seed)
        sparse, dense = with_laws(sparse, CHOICES[laws]), with_laws(dense, CHOICES[laws])
        x = random_iterate(dense, seed)
        ev = dense.evaluate(x)
        sets += sets_of(ev.contact, dense.sub)
        wanted = ev.error, *(ev.R.copy(), dense.response(ev), np.array(dense.delassus(ev)))
        forces = dense.row_forces(ev)
        wanted = *wanted, dense.with_forces(ev, *forces)
        dx, dependent = dense.correction(dense.evaluate(x))
        ev = sparse.evaluate(x)
        assert ev.error == pytest.approx(wanted[0], rel=1e-12)
        same(ev.R, wanted[1], 1e-12)
        same(sparse.response(ev), wanted[2], 1e-12)
        same(np.array(sparse.delassus(ev)), wanted[3], 1e-12)
        same(sparse.with_forces(ev, *forces), wanted[4], 1e-12)
        if not dependent:
            same(sparse.correction(ev)[0], dx, 1e-8)
    expected = (
        {"ABC stick", "ABC slip", "AB slip", "A slip", "open"}
        if CHOICES[laws].accelerates
        else {"AB slip", "A slip", "open"}
    )
    assert expected <= {found for found, count in sets.items() if count}


@pytest.mark.parametrize("k", [5, 40])
def test_compiled_sweeps_are_those_of_numpy(k, monkeypatch):
    library, _ = kernel.load()
    if library is None:
        pytest.skip("the kernel is not compiled")
    rng = np.random.default_rng(k)
    J = rng.normal(size=(3 * k + 2, 4 * k))
    G, b, mu, of_F = J @ J.T, rng.normal(size=3 * k + 2), rng.uniform(0.0, 0.6, k), np.repeat(np.arange(k), 2)
    bounds = (np.array([-0.01, -0.1]), np.array([0.02, 0.1]))
    runs = []
    for found in (library, None):
        monkeypatch.setattr(kernel, "library", found)
        runs.append(solve_contact_problem(G, b, mu, of_F, np.zeros(len(b)), bounds=bounds))
    assert runs[0][1:] == runs[1][1:]
    same(runs[0][0], runs[1][0], 1e-12)


def test_sparse_newton_on_one_level_finds_the_same(monkeypatch):
    rng, k = np.random.default_rng(0), 30
    J = rng.normal(size=(3 * k, 60))  # dependent directions
    G, b, mu, of_F = J @ J.T, J @ rng.normal(size=60), rng.uniform(0.1, 0.4, k), np.repeat(np.arange(k), 2)
    y = []
    for dense in (10**6, 0):
        monkeypatch.setattr(proximal_newton, "DENSE", dense)
        P, converged, _ = solve_contact_problem(G, b, mu, of_F, np.zeros(3 * k))
        assert converged
        y.append(b + G @ P)
    assert np.abs(y[0] - y[1]).max() < 1e-9 * np.abs(b).max()


@pytest.mark.parametrize("seed", [2, 17])
def test_patience_where_the_residual_has_to_grow(seed):
    """45 contacts in random directions between 20 balls, with much friction: Coulomb's problem has a solution."""
    rng, k, n = np.random.default_rng(seed), 45, 20
    W = np.zeros((3 * k, 6 * n))
    for c in range(k):
        i, j = rng.choice(n, 2, replace=False)
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        first = np.cross(normal, rng.normal(size=3))
        first /= np.linalg.norm(first)
        for row, d, arm in ((c, normal, 0), (k + 2 * c, first, 1), (k + 2 * c + 1, np.cross(normal, first), 1)):
            W[row, 6 * i : 6 * i + 6] = *d, *(-arm * np.cross(normal, d))
            W[row, 6 * j : 6 * j + 6] = *(-d), *(-arm * np.cross(normal, d))
    v = 1e-2 * rng.normal(size=6 * n)
    v[2::6] -= 1e-2
    G, b = W / np.tile([1.0, 1.0, 1.0, 0.4, 0.4, 0.4], n) @ W.T, W @ v
    mu, of_F = np.ones(k), np.repeat(np.arange(k), 2)
    problem = G, b, proximal_newton.Rows(mu, of_F), np.zeros(3 * k), 1e-11
    assert not proximal_newton.proximal_newton(*problem)[1]
    P, found = proximal_newton.proximal_newton(*problem, patient=True)
    assert found
    assert violation(G, b, mu, of_F, P) < 1e-10 * np.abs(b).max()


def test_laws_without_forces_do_not_jump(balls):
    """Where a contact on the edge of its cone slips by nothing, and where a gap is off by less than the tolerance."""
    k, m = 8, 16
    sub, rng = balls.contacts.subset(np.arange(k)), np.random.default_rng(1)
    P_N, tiny = rng.uniform(1.0, 2.0, k), 1e-9 * rng.normal(size=m)
    edge = rng.normal(size=(k, 2))
    P_F = (0.5 * P_N[:, None] * edge / np.linalg.norm(edge, axis=1)[:, None]).ravel() * (1 + 1e-6)
    z = np.concatenate((np.zeros(k), P_N, P_F, np.zeros(k + m)))
    y = np.concatenate((np.full(k, 1e-9), np.zeros(k), tiny, np.zeros(k + m)))

    def residual(slack):
        laws = ContactResidual(sub, y, z, z[k : 2 * k + m], tiny, np.ones(len(y)), True, None, False, slack)
        return np.abs(laws.R).max()

    assert residual(np.full(k, 1e-8)) < 1e-5
    assert residual(np.zeros(k)) > 1.0  # the gap opens, and its percussion should vanish
    y[:k] = 0.0
    assert residual(np.zeros(k)) < 1e-5
    assert residual(None) > 1e-2  # the direction of a slip that is rounding


def test_percussions_do_all_of_the_work_of_a_step():
    """27 balls: Coulomb's and Signorini's laws hold with the velocities at the end of the step, after a few rounds."""
    scene, q0, v0 = robots.load("balls_in_box", side=3, layers=3)
    system, method, dt = System(scene), nga.GeneralizedAlpha(), 1e-3
    state = initial_state(system, q0, v0)
    for _ in range(220):
        result = method.step(system, state, dt)
        assert result.converged
        state = result.state
    sub = system.contacts.subset(state.contacts)
    equations = step_equations(system, method.parameters, state, dt, sub, memory(system, state, sub.index))
    equations.evaluate(equations.start())  # sets the scales
    end, converged, rounds = by_percussions(equations, None)
    assert converged
    assert sub.k > FEW
    assert rounds <= 4
    P, y, G = end.z[sub.k : 2 * sub.k + sub.m], end.parts[0].rate, equations.delassus(end)[0]
    assert np.abs(P).max() > 9.81 * dt
    assert violation(G, y - G @ P, sub.mu, sub.of_F, P) < 1e-9 * 9.81 * dt
    assert end.parts[0].g_N.min() > -1e-12
    assert end.parts[0].g_N[P[: sub.k] > 0.0].max() < 1e-12


def test_packing():
    """Steps of all balls at once: every one converges, nothing penetrates, and what has fallen in is dissipated."""
    scene, q0, v0 = robots.load("balls_in_box", side=2, layers=2)
    run = nga.simulate(scene, q0, v0, t_end=0.35, dt=1e-3)
    assert run.success
    assert run.g_N.min() > -1e-12
    assert np.count_nonzero(run.la_N[-1]) > 12
    energy = run.energy.kinetic + run.energy.potential
    assert np.diff(energy).max() < 1e-9 * np.ptp(run.energy.potential)
    assert run.audit().ok


def test_wall_of_boxes_stands():
    scene, q0, v0 = robots.load("wall", rows=3, columns=2)
    run = nga.simulate(scene, q0, v0, t_end=0.05, dt=5e-3)
    on_floor = np.array(["floor" in name for name in run.contact_names])
    assert run.success
    assert np.abs(run.v).max() < 1e-9
    assert run.g_N.min() > -1e-12
    assert run.la_N[-1][on_floor].sum() == pytest.approx(6 * 9.81, rel=1e-9)


def hit_wall(side, t_end):
    """A ball hits a wall and breaks it; no contact penetrates, and without restitution no impact adds energy."""
    scene, q0, v0 = robots.load("wall", rows=side, columns=side, speed=5.0)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=2e-3)
    energy = run.energy.kinetic + run.energy.potential
    assert run.success
    assert run.g_N.min() > -1e-12
    assert np.diff(energy).max() < 1e-9 * energy[0]
    return run


def test_wall_of_four_boxes_is_hit_by_a_ball():
    """The ball falls to the floor, slides on and hits the lower boxes."""
    run = hit_wall(2, 0.1)
    assert run.audit().ok
    q, v = run.q[-1].reshape(-1, 7), run.v[-1].reshape(-1, 6)
    along = [pin.XYZQUATToSE3(x).rotation[1] @ y[:3] for x, y in zip(q, v, strict=True)]  # [m/s], masses are 1 kg
    # a ball of the mass of a box that stays at it, or at more of them, keeps half of its velocity at most
    assert along[-1] < 2.5
    assert max(along[:-1]) > 1.0
    # what is left of the momentum of the ball; friction on the floor takes some of it
    assert 2.5 < sum(along) < 5.0


@pytest.mark.parametrize("ratio", [1e-6, 1e6])
def test_two_stacked_spheres_with_a_mass_ratio_of_a_million(ratio):
    """Both rest: force sums are the weights, above and below."""
    scene, q0, v0 = robots.load("balls_in_box", side=1, layers=2)
    light, heavy = 1.0, ratio
    scene.model.inertias[2] = pin.Inertia(heavy, np.zeros(3), heavy * 0.4 * 0.01 * np.eye(3))
    q0[:3], q0[7:10] = (0.0, 0.0, 0.1), (0.0, 0.0, 0.3)
    run = nga.simulate(scene, q0, v0, t_end=0.05, dt=1e-3)
    names = list(run.contact_names)
    below, between = (run.la_N[1:, [names.index(name)]] for name in ("ball_0/floor", "ball_0/ball_1"))
    assert run.success
    assert np.abs(below / (9.81 * (light + heavy)) - 1.0).max() < 1e-9
    assert np.abs(between / (9.81 * heavy) - 1.0).max() < 1e-9


RUNS = {
    "points": lambda: (robots.load("balls_in_box", side=2, layers=1), {"t_end": 0.2, "dt": 1e-3}),
    "features": lambda: (robots.load("wall", rows=2, columns=1), {"t_end": 0.02, "dt": 5e-3}),
    "chosen accuracy": lambda: (robots.load("rotating_ball"), {"t_end": 0.7, "rtol": 1e-5}),
}


@pytest.mark.parametrize("name", RUNS)
def test_same_run_twice_gives_the_same_bits(name):
    runs = []
    for _ in range(2):
        (scene, q0, v0), options = RUNS[name]()
        runs.append(nga.simulate(scene, q0, v0, **options))
    assert runs[0].t.tobytes() == runs[1].t.tobytes()
    for quantity in ("q", "v", "a", "P_N", "P_F", "la_N", "la_F"):
        assert getattr(runs[0], quantity).tobytes() == getattr(runs[1], quantity).tobytes()


@pytest.mark.parametrize("name", ["points", "features"])
def test_order_of_declaration(name):
    runs = []
    for reverse in (False, True):
        (scene, q0, v0), options = RUNS[name]()
        if reverse:
            scene.contacts.reverse()
        runs.append(nga.simulate(scene, q0, v0, **options))
    assert runs[0].P_N.any()
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-9


@pytest.mark.long
def test_wall_of_25_boxes_stands_for_a_second():
    scene, q0, v0 = robots.load("wall")
    run = nga.simulate(scene, q0, v0, t_end=1.0, dt=2e-3)
    assert run.success
    assert np.abs(run.v).max() < 1e-9
    assert run.g_N.min() > -1e-12
    assert "halved" not in set(run.solver_path)


def test_wall_of_nine_boxes_is_hit_by_a_ball():
    run = hit_wall(3, 0.08)
    assert run.audit().ok
    assert "captured" in set(run.solver_path)


@pytest.mark.long
def test_wall_of_nine_boxes_comes_to_rest_after_a_ball_has_hit_it():
    """Its boxes lie on the floor and the ball rolls away; corners of boxes that slide over each other may be missed by
    4e-8 m for a step."""
    run = hit_wall(3, 0.5)
    assert np.abs(run.v[-1, :-6]).max() < 1e-9
    assert run.audit().penetration < 1e-7


@pytest.mark.long
def test_crowd_of_64_balls_comes_to_rest():
    """`python benchmarks/crowd.py`."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    try:
        from crowd import main
    finally:
        sys.path.pop(0)
    assert main([]) == 0
