"""The compiled kernel against its numpy twin, on random states and over whole runs."""

import json
import os
import subprocess
import sys
from collections import Counter

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import ARRANGEMENTS, PAIRS, pair_scene, random_state
from feature_scenes import ALL, feature_system
from random_iterates import DT, random_iterate, sets_of, with_laws

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import doctor
from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.step.compiled import CompiledEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.newton_matrix import RCOND
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

TOLERANCE = 1e-12
SOLVED = 1e-13
"""Of a correction, per unit of the condition numbers of the Newton matrix and the mass matrix."""
WELL_CONDITIONED = 1e8
LAWS = ("second-order", "paper", "laws of the paper as a fallback", "captured", "other prox parameters")


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    """The kernel, also where the other tests run without it."""
    monkeypatch.delenv("NGALPHA_KERNEL", raising=False)
    library, _ = kernel.load()
    if library is None:
        pytest.skip("the kernel is not compiled")
    monkeypatch.setattr(kernel, "library", library)


def seeds_of(laws):
    """Two of four states, one with restitution; what one kind of laws leaves out, the next one has."""
    first = 2 * (LAWS.index(laws) % 2)
    return first, first + 1


def same(found, wanted, tolerance=TOLERANCE):
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.shape == wanted.shape
    if wanted.size:
        assert np.abs(found - wanted).max() <= tolerance * max(1.0, np.abs(wanted).max())


def twins(scene, laws, seed, index=None):
    """Both kinds of equations of one random step."""
    system = System(scene)
    return twins_at(system, random_state(system.model, seed), laws, seed, index)


def twins_at(system, motion, laws, seed, index=None):
    """The same at a motion q, v, a."""
    rng, (q, v, a) = np.random.default_rng(seed), motion
    if seed % 2:  # with restitution
        table = system.contacts  # whose arrays other systems have too
        table.e_N, table.e_F = np.full_like(table.e_N, 0.5), np.full_like(table.e_F, 0.2)
    tau = rng.normal(size=system.model.nv * (seed % 2))
    sub = system.contacts.subset(np.arange(system.contacts.n_points) if index is None else index)
    nothing = np.zeros(0)
    auxiliary = Auxiliary(a + 0.1 * rng.normal(size=len(a)), nothing, nothing, nothing)
    state = State(0.3, q, v, a, sub.index, memory=auxiliary, tau=tau, dt=DT)
    method = nga.GeneralizedAlpha(rho_inf=0.6, laws="paper" if laws == "paper" else "second-order")
    memory = tuple(rng.normal(size=sub.k + sub.m) for _ in range(2))
    both = [kind(system, method.parameters, state, DT, sub, memory) for kind in (StepEquations, CompiledEquations)]
    factors = np.where(rng.random(sub.k) < 0.5, 1e12, 0.0)
    options = {
        "laws of the paper as a fallback": LawOptions(paper=True),
        "captured": LawOptions(paper=True, displaces=False),
        "other prox parameters": LawOptions(paper=False, factors=factors),
    }.get(laws, method.parameters.laws)
    for equations in both:
        equations.evaluate(equations.start())  # sets the scales
    return [with_laws(equations, options) for equations in both]


def same_corrections(equations, dx_c, dx):
    """Equal corrections, or, where the Newton matrix is close to singular, solutions of the same equations."""
    n, nv = equations.n, equations.nv
    A = equations._work("A").reshape(n, n).T
    condition = np.linalg.cond(A) * np.linalg.cond(equations.system.data.M)
    if condition < WELL_CONDITIONED:
        same(dx_c / np.abs(dx).max(), dx / np.abs(dx).max(), SOLVED * condition)
        return
    y_c, y = (x[3 * nv :] / equations._array("column_scale") for x in (dx_c, dx))
    size = np.abs(A).max() * max(np.abs(y).max(), np.abs(y_c).max())
    same(A @ y_c / size, A @ y / size, 10 * RCOND)


def compare(both, x):
    """Everything that one evaluation and one correction give."""
    numpy, c = both
    evs = ev, ev_c = [equations.evaluate(x) for equations in both]
    for name in ("x", "q", "v", "dq"):
        same(getattr(ev_c, name), getattr(ev, name))
    same(ev_c.R, ev.R)
    same(ev_c.dynamics.residual, ev.dynamics.residual)
    same(ev_c.W, ev.W)
    for name in ("g_N", "normals", "directions", "c", "c_dot", "rate", "acceleration"):
        wanted = getattr(ev.parts[0], name)
        same(ev_c.array(name).reshape(wanted.shape), wanted)
    for name in ("y", "z", "R"):
        same(getattr(ev_c.contact, name), getattr(ev.contact, name))
    for name in ("A", "B", "C", "kinematic"):
        assert np.array_equal(getattr(ev_c.contact, name), getattr(ev.contact, name))
    if numpy.sub.m:
        assert np.array_equal(ev_c.contact.stick, ev.contact.stick)
        assert np.array_equal(ev_c.contact.stick_a, ev.contact.stick_a)
    same(ev_c.error / ev.error, 1.0)
    if not numpy.system.moves_by_pairs:  # the contacts that are looked at in a step do not depend on who solves it
        at_start = numpy.system.gap_motion(numpy.dt * numpy.state.v)
        assert np.array_equal(c._array("motion"), [at_start], equal_nan=True)
    assert c.spent(ev_c) == pytest.approx(numpy.spent(ev), rel=TOLERANCE, nan_ok=True)
    for found, wanted in zip(c.bars(ev_c), numpy.bars(ev), strict=True):
        same(found, wanted)
    assert np.array_equal(c.keeps(ev_c), numpy.keeps(ev))
    ev, ev_c = (equations.evaluate(x) for equations in both)  # Pinocchio's data belong to the last call
    for found, wanted in zip(c.linearise(ev_c), numpy.linearise(ev), strict=True):
        scale = np.abs(wanted).max(axis=0)
        same(found / scale, wanted / scale)
    dx, dependent = numpy.correction(ev)
    dx_c, dependent_c = c.correction(ev_c)
    assert dependent_c == dependent
    same_corrections(c, dx_c, dx)
    return evs[0].contact


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("pair", PAIRS)
def test_twins_agree_on_random_states(pair, arrangement, laws):
    for seed in seeds_of(laws):
        both = twins(pair_scene(pair, arrangement), laws, seed)
        compare(both, both[0].start())
        compare(both, random_iterate(both[0], seed))


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("first", range(0, len(ALL), SLOTS))
def test_twins_agree_on_features(first, arrangement, laws):
    """Corners, edges, rims, faces and round shapes of both sides in all combinations."""
    seed = 3 + 2 * (LAWS.index(laws) % 2)
    system, *motion = feature_system(ALL[first : first + SLOTS], arrangement, seed)
    system.slots.loaded[:] = True
    both = twins_at(system, motion, laws, seed)
    compare(both, both[0].start())
    compare(both, random_iterate(both[0], seed))


def jointed(name):
    """A scene whose steps have rows of one kind besides those of contact points, and which contacts are unknowns."""
    if name in ("four_bar", "bricard", "andrews", "n_four_bar", "slider_crank"):
        return robots.load(name)[0], np.zeros(0, dtype=int)
    model = pin.buildSampleModelManipulator()
    if name == "friction":
        model.upperDryFrictionLimit[::2], model.lowerDryFrictionLimit[::2] = 3.0, -2.0
    if "gears" in name or name == "driven":
        turn = model.addJoint(model.njoints - 1, pin.JointModelRUBX(), pin.SE3.Identity(), "turn")
        model.appendBodyToJoint(turn, pin.Inertia.FromSphere(0.5, 0.2), pin.SE3.Identity())
    scene = nga.Scene(model)
    names = list(model.names)
    if "gears" in name:
        scene.add_constraint(nga.JointCoupling(names[1], names[2], (0.3, -1.5, 0.4, 0.1)))
        scene.add_constraint(nga.JointCoupling("turn", {names[3]: 0.5, names[4]: -2.0}, (0.1, 3.0)))
        scene.add_constraint(nga.JointCoupling({names[5]: 1.0, names[6]: 2.0}, {}, (0.2,)))
    if "driven" in name:
        scene.add_constraint(nga.JointTrajectory("turn", lambda t: 40.0 * t))
        scene.add_constraint(nga.JointTrajectory(names[-2], lambda t: (np.sin(3.0 * t), 3.0 * np.cos(3.0 * t), 0.5)))
        placed = {side: pin.SE3.Random() for side in ("placement_a", "placement_b")}
        scene.add_constraint(nga.DrivenAngle(names[1], names[-2], lambda t: 9.0 * t, **placed))
    if name in ("gears and frames", "driven gears and frames"):
        scene.add_constraint(nga.PointJoint(names[-2], "world", placement_b=pin.SE3.Random()))
    if "gears" in name or "driven" in name:
        return scene, np.zeros(0, dtype=int)
    return scene, np.arange(0, System(scene).contacts.n, 3)


JOINTED = (
    *("four_bar", "bricard", "andrews", "n_four_bar", "slider_crank"),
    *("limits", "friction", "gears", "gears and frames", "driven", "driven gears and frames"),
)


@pytest.mark.parametrize("paper", [False, True])
@pytest.mark.parametrize("monotone", [False, True])
@pytest.mark.parametrize("name", JOINTED)
def test_twins_agree_on_joints_of_all_kinds(name, monotone, paper):
    scene, index = jointed(name)
    system, parameters = System(scene), nga.GeneralizedAlpha(rho_inf=0.6).parameters
    sub, options = system.contacts.subset(index), LawOptions(paper=paper, monotone=monotone)
    layout, sets = system.layout(sub), Counter()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        q, v, a = random_state(system.model, seed)
        v *= 1e-4 ** (seed % 2)  # joints slip, or hardly move
        memory = tuple(rng.normal(size=sub.k) for _ in range(2))
        f, b, none = layout.f, layout.kb + layout.mb, np.zeros(0)
        state = State(
            0.3, q, v, a, index, *2 * (memory[0], none), tau_f=rng.normal(size=f), la_b=rng.normal(size=b),
            memory=Auxiliary(a, memory[1], none, rng.normal(size=f)), dt=DT,
        )  # fmt: skip
        both = [kind(system, parameters, state, DT, sub, memory) for kind in (StepEquations, CompiledEquations)]
        for equations in both:
            equations.evaluate(equations.start())  # sets the scales
        x = both[0].start() + 0.1 * 1e-3 ** (seed % 2) * rng.normal(size=3 * system.nv + layout.n)
        ev, ev_c = (equations.evaluate(x, options) for equations in both)
        for what in ("R", "W", "y", "law"):
            same(getattr(ev_c, what), getattr(ev, what))
        assert np.array_equal(ev_c.kinematic, ev.kinematic)
        same(ev_c.error / ev.error, 1.0)
        if f:
            same(ev_c.friction.P, ev.friction.P)
        for found, wanted in zip(both[1].bars(ev_c), both[0].bars(ev), strict=True):
            same(found, wanted)
        for found, wanted in zip(both[1].row_forces(ev_c), both[0].row_forces(ev), strict=True):
            same(found, wanted)
        ev, ev_c = (equations.evaluate(x, options) for equations in both)
        for found, wanted in zip(both[1].linearise(ev_c), both[0].linearise(ev), strict=True):
            scale = np.maximum(np.abs(wanted).max(axis=0, initial=0.0), 1e-300)
            same(found / scale, wanted / scale)
        same_corrections(both[1], both[1].correction(ev_c)[0], both[0].correction(ev)[0])
        sets.update(ev.kinematic[layout.friction_v].tolist())
    assert name != "friction" or (sets[True] and sets[False])


def test_twins_agree_on_prescribed_index_sets():
    for seed in range(6):
        both = twins(pair_scene("sphere-plane", "moving"), "second-order", seed)
        sub, rng = both[0].sub, np.random.default_rng(seed)
        level, (stick, stick_a) = rng.integers(0, 4, sub.k), rng.random((2, sub.cones.c)) < 0.5
        stick = stick & (level >= 1)
        laws = LawOptions(paper=False, sets=IndexSets(level >= 1, level >= 2, level >= 3, stick, stick & stick_a))
        x = random_iterate(both[0], seed)
        ev, ev_c = (equations.evaluate(x, laws) for equations in both)
        assert np.array_equal(ev_c.kinematic, ev.kinematic)
        same(ev_c.contact.R, ev.contact.R)
        same_corrections(both[1], both[1].correction(ev_c)[0], both[0].correction(ev)[0])
        same(both[1].evaluate(x).contact.R, both[0].evaluate(x).contact.R)  # and no longer


def test_friction_that_cannot_move_is_for_numpy():
    """One hinge is held: along one tangent of a slope across their plane the ball moves only with the normal."""
    model = pin.Model()
    shoulder = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "shoulder")
    elbow = model.addJoint(shoulder, pin.JointModelRX(), pin.SE3(np.eye(3), np.array([0.0, 0.3, 0.0])), "elbow")
    for joint in (shoulder, elbow):
        middle = pin.SE3(np.eye(3), np.array([0.0, 0.15, 0.0]))
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3)), middle)
    geometry = pin.GeometryModel()
    end = pin.SE3(np.eye(3), np.array([0.0, 0.3, 0.0]))
    geometry.addGeometryObject(pin.GeometryObject("ball", elbow, end, coal.Sphere(0.05)))
    for tilt in (0.0, 0.4):
        scene = nga.Scene(model, geometry)
        slope = {"point": (0.0, 0.0, -0.05 / np.cos(tilt) - 1e-4), "normal": (np.sin(tilt), 0.0, np.cos(tilt))}
        scene.add_plane("slope", **slope)
        scene.add_contact("ball", "slope", mu=0.5)
        scene.add_constraint(nga.JointCoupling("elbow", {}, (0.0,)))
        system, method = System(scene), nga.GeneralizedAlpha()
        state = initial_state(system, np.zeros(2))
        while not len(state.contacts):
            state = method.step(system, state, 1e-3).state
        engine = system.plain.engine
        before = engine.solved, engine.steps
        assert method.step(system, state, 1e-3).converged
        assert (engine.solved, engine.steps) == before


def test_every_kind_of_contact_has_been_compared():
    met = Counter()
    for seed in range(40):
        both = twins(pair_scene("sphere-plane", "moving"), "second-order", seed)
        met += sets_of(compare(both, random_iterate(both[0], seed)), both[0].sub)
    normals = ("A", "AB", "ABC")
    assert all(met[f"{normal} slip"] and met["capped"] for normal in normals)
    assert met["open"] and met["AB just started"] and met["ABC stick"]


@pytest.mark.parametrize("laws", LAWS)
def test_twins_agree_on_a_robot_with_force_laws(laws):
    scene, q0, _ = robots.load("quadruped")
    for seed in seeds_of(laws):
        both = twins(scene, laws, seed, np.array([0, 2, 3]))
        compare(both, random_iterate(both[0], seed))


def test_twins_agree_without_contact():
    scene = robots.load("arm")[0]
    system = System(scene)
    q, v, a = random_state(system.model, 0)
    state, sub = (
        State(0.0, q, v, a, memory=Auxiliary(0.9 * a, *3 * [np.zeros(0)]), dt=DT),
        system.contacts.subset(np.arange(0)),
    )
    arguments = (system, nga.GeneralizedAlpha().parameters, state, DT, sub, (np.zeros(0), np.zeros(0)))
    numpy, c = StepEquations(*arguments), CompiledEquations(*arguments)
    ev_c, ev = c.evaluate(c.start()), numpy.evaluate(numpy.start())
    same(ev_c.error / ev.error, 1.0)
    same(c.correction(ev_c)[0], numpy.correction(ev)[0], 1e-11)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("pair", PAIRS)
def test_gaps(pair, arrangement, monkeypatch):
    system = System(pair_scene(pair, arrangement))
    sub = system.contacts.subset(np.arange(system.contacts.n))
    for seed in range(4):
        q = random_state(system.model, seed)[0]
        system.place(q)
        found = system.gaps(sub, q)
        with monkeypatch.context() as without:
            without.setattr(kernel, "library", None)
            same(found, system.gaps(sub, q))


RUNS = {
    "ball_in_corner": (1.2, 1e-2, {}),
    "tippe_top": (1.0, 2e-3, {}),
    "quadruped": (0.5, 2e-3, {}),
    "rotating_ball": (1.2, 2e-3, {"e_N": 0.5}),
    "hopper": (0.06, 1e-3, {"height": 0.3001}),
}


@pytest.mark.parametrize("name", RUNS)
def test_whole_runs_agree(name, monkeypatch):
    t_end, dt, options = RUNS[name]
    scene, q0, v0 = robots.load(name, **options)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt)
    monkeypatch.setattr(kernel, "library", None)
    twin = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt)
    for array in ("q", "v", "P_N", "P_F"):
        same(getattr(run, array), getattr(twin, array), 1e-9)
    assert np.array_equal(run.solver_path, twin.solver_path)


@pytest.mark.parametrize("wanted", ["0", "1"])
def test_environment_decides(wanted):
    command = [sys.executable, "-c", doctor.KERNEL, json.dumps(sys.path)]
    environment = {**os.environ, "NGALPHA_KERNEL": wanted}
    found = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    assert found.stdout.startswith("compiled " if wanted == "1" else "numpy ")


def test_library_of_other_sources_is_refused(monkeypatch):
    monkeypatch.setattr(kernel, "VERSION", kernel.VERSION + 1)
    library, why = kernel.load()
    assert library is None
    assert "another version" in why
