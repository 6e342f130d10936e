"""A scene that changes while it runs: momentum of plastic captures, what is switched off and on, files, messages."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.system.system import System

G = 9.81


def pose(x, y, z, turn=(0.0, 0.0, 0.0)):
    return np.array([x, y, z, *pin.Quaternion(pin.exp3(np.array(turn))).coeffs()])


def boxes(n=2, mu=0.5, weightless=False):
    """Cubes of edge 0.2 m and 1, 2, ... kg above a plane."""
    scene = nga.Scene()
    scene.add_plane("ground")
    for i in range(n):
        scene.add_body(f"box_{i}", coal.Box(0.2, 0.2, 0.2), mass=1.0 + i)
    scene.add_contact("box_*", "ground", mu=mu)
    for i in range(1, n):
        scene.add_contact(f"box_{i}", f"box_{i - 1}", mu=mu)
    if weightless:
        scene.model.gravity = pin.Motion.Zero()
    return scene


def momentum(scene, state):
    """Linear momentum, and angular momentum about the centre of mass."""
    data = scene.model.createData()
    return pin.computeCentroidalMomentum(scene.model, data, state.q, state.v).vector


def test_plastic_capture_in_flight_keeps_all_momentum():
    scene = boxes(weightless=True)
    rng = np.random.default_rng(3)
    q0 = np.concatenate((pose(0.0, 0.0, 2.0, rng.normal(size=3)), pose(0.5, 0.1, 2.2, rng.normal(size=3))))
    v0 = rng.normal(size=12)
    simulator = nga.Simulator(scene, 1e-3, record=True)
    before = simulator.initial_state(q0, v0)
    after = simulator.weld("box_0", "box_1")
    p = momentum(scene, before)
    assert momentum(scene, after) == pytest.approx(p, abs=1e-12)
    energies = [0.5 * s.v @ pin.crba(scene.model, scene.model.createData(), s.q) @ s.v for s in (before, after)]
    assert energies[1] < 0.9 * energies[0]
    # they go on as one body, in flight without forces
    state = after
    for _ in range(50):
        state = simulator.step(state)
    assert momentum(scene, state) == pytest.approx(p, abs=1e-3)  # in axes of the bodies, that is the method's order
    run = simulator.trajectory()
    assert len(run.parts) == 2 and len(run.t) == 51 and run.audit().ok, str(run.audit())
    assert run.impacts.t.tolist() == [0.0] and run.parts[1].entry is not None
    assert run.parts[1].constraint_motion.g == pytest.approx(0.0, abs=1e-12)
    assert [(event.t, event.kind, event.contact) for event in run.events] == [(0.0, "weld", "Weld box_0-box_1")]


def as_one_body(q, v, t_end):
    """Where the first of two boxes is that are welded in flight: the rigid body of both, without gravity."""
    turns = [pin.Quaternion(x[3:7]).matrix() for x in (q[:7], q[7:])]
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "both")
    first = pin.SE3(turns[0], q[:3])
    for i, (mass, turn) in enumerate(zip((1.0, 2.0), turns, strict=True)):
        at = first.actInv(pin.SE3(turn, q[7 * i : 7 * i + 3]))
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(mass, 0.2, 0.2, 0.2), at)
    inertia, centre = model.inertias[1].inertia, model.inertias[1].lever
    omega0, speed = v[3:6], turns[0] @ (v[:3] + np.cross(v[3:6], centre))

    def rate(t, y):
        omega, x = y[4:], pin.Quaternion(y[:4] / np.linalg.norm(y[:4]))
        turn = x * pin.Quaternion(0.0, *omega)
        return np.concatenate((0.5 * turn.coeffs(), np.linalg.solve(inertia, np.cross(inertia @ omega, omega))))

    y = solve_ivp(rate, (0, t_end), [*q[3:7], *omega0], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return q[:3] + turns[0] @ centre + t_end * speed - pin.Quaternion(y[:4]).matrix() @ centre


def test_welded_in_flight_they_move_as_one_body():
    """Of second order with dt, within ten times the tolerance with rtol."""
    scene, rng = boxes(weightless=True), np.random.default_rng(3)
    q0 = np.concatenate((pose(0.0, 0.0, 2.0, rng.normal(size=3)), pose(0.5, 0.1, 2.2, rng.normal(size=3))))
    v0, t_end, errors = 2.0 * rng.normal(size=12), 0.2, []
    for dt in (1e-2, 1e-3):
        simulator = nga.Simulator(scene, dt)
        simulator.initial_state(q0, v0)
        welded = state = simulator.weld("box_0", "box_1")
        exact = as_one_body(welded.q, welded.v, t_end)
        for _ in range(round(t_end / dt)):
            state = simulator.step(state)
        errors.append(np.abs(state.q[:3] - exact).max())
    assert np.log10(errors[0] / errors[1]) > 1.9, errors
    for rtol in (1e-4, 1e-6, 1e-8):
        run = nga.simulate(simulator.scene, welded.q, welded.v, t_end=t_end, rtol=rtol)
        assert np.abs(run.q[-1, :3] - exact).max() < 10 * rtol
        assert run.audit().ok, str(run.audit())


def test_plastic_capture_of_a_body_in_contact():
    """A cube flies against one that slides on the ground: the ground answers, within its cone, and nothing sinks."""
    scene, mu = boxes(), 0.5
    q0 = np.concatenate((pose(0.0, 0.0, 0.1), pose(0.05, 0.0, 0.35)))
    v0 = np.zeros(12)
    v0[0], v0[6:9] = 0.5, (2.0, 0.3, -1.0)
    simulator = nga.Simulator(scene, 1e-3, record=True)
    state = simulator.initial_state(q0, v0)
    before = simulator.step(state)
    after = simulator.weld("box_0", "box_1")
    simulator_run = [after]
    for _ in range(100):
        simulator_run.append(simulator.step(simulator_run[-1]))
    run = simulator.trajectory()
    hit = run.parts[1].entry
    # all that the ground does is in the jump of the momentum
    rows = run.parts[1]
    system = rows.system
    system.dynamics(before.t, before.q, before.v, np.zeros(12))
    W = system.contact_rows(system.contacts.subset(rows.contact_columns), before.q, before.v, np.zeros(12)).W
    linear = [momentum(scene, s)[:3] for s in (before, after)]
    jump = linear[1] - linear[0]
    assert jump[2] == pytest.approx(hit.P_N.sum(), abs=1e-12)
    assert jump[2] > 0.5 and np.hypot(*jump[:2]) <= mu * jump[2] * (1 + 1e-12)
    # the sensor has it in the step that follows, with what that step adds
    assert run.contact_percussion("box_0", "ground").force[2] == pytest.approx(jump, abs=1e-4)
    M = system.mass_matrix(before.q)
    W_b = system.constraint_rows(before.t, before.q, before.v, np.zeros(12)).W
    P = np.concatenate((hit.P_N[0], hit.P_F[0]))
    left = M @ (after.v - before.v) - W.T @ P - W_b.T @ hit.P_b[0]
    assert np.abs(left).max() < 1e-12
    assert np.nanmin(run.g_N) > -1e-10
    assert run.audit().ok, str(run.audit())


def test_a_weld_of_bodies_that_touch_carries_what_the_contact_carried():
    scene = boxes()
    simulator = nga.Simulator(scene, 1e-3, record=True)
    state = simulator.initial_state(np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))))
    for _ in range(5):
        state = simulator.step(state)
    weight = simulator.sensors(state).contact_force("box_1/box_0").force[2]
    assert weight == pytest.approx(2.0 * G, rel=1e-9)
    state = simulator.weld("box_0", "box_1")
    assert "box_1/box_0" in simulator.names["pairs"] and not any(
        "box_1/" in c for c in simulator.system.contacts.names if "box_0" in c
    )
    for _ in range(5):
        state = simulator.step(state)
    assert np.linalg.norm(state.la_b[:3]) == pytest.approx(2.0 * G, rel=1e-8)
    state = simulator.release("Weld box_0-box_1")
    for _ in range(5):
        state = simulator.step(state)
    assert simulator.sensors(state).contact_force("box_1/box_0").force[2] == pytest.approx(2.0 * G, rel=1e-8)
    run = simulator.trajectory()
    assert [event.kind for event in run.changes] == ["weld", "release"] and set(run.changes) <= set(run.events)
    assert run.audit().ok, str(run.audit())
    force = run.contact_force("box_1/box_0").force[:, 2]
    assert force[[3, 14]] == pytest.approx(2.0 * G, rel=1e-8) and force[8] == 0.0
    assert np.isnan(
        run.g_N[8, [i for i, name in enumerate(run.contact_names) if "box_1" in name and "box_0" in name]]
    ).all()


def test_a_declared_weld_between_bodies_that_touch():
    scene = boxes(mu=0.2)  # with 0.4 they would tip over
    scene.add_constraint(nga.Weld("box_0", "box_1", placement_a=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2]))))
    v0 = np.zeros(12)
    v0[:2] = v0[6:8] = 1.0, 0.2
    run = nga.simulate(scene, np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))), v0, t_end=0.1, dt=2e-3)
    assert run.audit().ok and not any("box_1" in name and "box_0" in name for name in run.contact_names)
    assert run.contact_force("ground").force[-1, 2] == pytest.approx(-3.0 * G, rel=1e-8)


def test_a_joint_that_is_locked_in_motion_and_let_go():
    """A pendulum of two rods: the impulse of the lock keeps the momentum about the pivot."""
    model, parent = pin.Model(), 0
    for name in ("first", "second"):
        offset = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0 if parent else 0.0]))
        parent = model.addJoint(parent, pin.JointModelRY(), offset, name)
        model.appendBodyToJoint(
            parent, pin.Inertia(1.0, np.array([0.0, 0.0, -0.5]), np.eye(3) * 0.1), pin.SE3.Identity()
        )
    scene = nga.Scene(model)
    simulator = nga.Simulator(scene, 1e-3, record=True)
    before = simulator.initial_state(np.array([0.3, 0.4]), np.array([1.0, 2.0]))
    after = simulator.lock("second")
    assert after.v[1] == pytest.approx(0.0, abs=1e-14)
    # the generalized momentum of the first hinge, which nothing acts on
    M = pin.crba(model, model.createData(), before.q)
    M = np.triu(M) + np.triu(M, 1).T
    assert (M @ after.v)[0] == pytest.approx((M @ before.v)[0], abs=1e-14)
    state = after
    for _ in range(20):
        state = simulator.step(state)
    assert state.q[1] == pytest.approx(0.4, abs=1e-12)
    state = simulator.unlock("second")
    for _ in range(20):
        state = simulator.step(state)
    assert abs(state.q[1] - 0.4) > 1e-4
    assert [event.kind for event in simulator.trajectory().events] == ["lock", "unlock"]
    assert simulator.trajectory().audit().ok
    with pytest.raises(nga.UnknownName, match="no weld or lock named 'second'"):
        simulator.unlock("second")


def test_a_ball_joint_is_locked_as_it_is():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0.1, 0.0, -0.5]), np.eye(3) * 0.1), pin.SE3.Identity())
    simulator = nga.Simulator(nga.Scene(model), 1e-3)
    q0 = pin.Quaternion(pin.exp3(np.array([0.3, 0.2, -0.1]))).coeffs()
    simulator.initial_state(q0, np.array([1.0, -0.5, 0.2]))
    state = simulator.lock("ball")
    for _ in range(10):
        state = simulator.step(state)
    assert state.q == pytest.approx(q0, abs=1e-12)


def test_what_is_switched_off_and_on():
    """A cube falls through a contact that is off, floats without gravity, and is pushed while a wrench is on."""
    scene = boxes(1, mu=0.0)
    scene.add_force(nga.Wrench("box_0", force=(3.0, 0.0, 0.0)))
    simulator = nga.Simulator(scene, 1e-3, record=True)
    state = simulator.initial_state(pose(0.0, 0.0, 0.1))
    assert state.a[[0, 2]] == pytest.approx([3.0, 0.0], abs=1e-12)
    state = simulator.disable("Wrench box_0")
    assert state.a[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)
    state = simulator.step(state)
    state = simulator.disable("ground/box_0")  # either way round
    assert state.a[2] == pytest.approx(-G)
    for _ in range(10):
        state = simulator.step(state)
    with pytest.raises(nga.Penetration):
        simulator.enable("box_0/ground")
    state = simulator.gravity((0.0, 0.0, 0.0))
    assert state.a == pytest.approx(0.0, abs=1e-12)
    v = state.v.copy()
    state = simulator.step(state)
    assert state.v == pytest.approx(v, abs=1e-12)
    state = simulator.enable("Wrench box_0")
    assert state.a[0] == pytest.approx(3.0)
    state = simulator.step(state)
    run = simulator.trajectory()
    assert [event.kind for event in run.changes] == ["disable", "disable", "gravity", "enable"]
    assert run.audit().ok, str(run.audit())
    with pytest.raises(nga.UnknownName, match="no contact pair, constraint or force named 'box_0/gound'; did you mean"):
        simulator.disable("box_0/gound")


def test_a_loop_that_is_opened_goes_on_as_the_open_one():
    scene, q0, v0 = robots.load("four_bar")
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(q0, v0)
    name = simulator.names["constraints"][0]
    after = simulator.disable(name)
    free = nga.Simulator(simulator.scene, 1e-3).initial_state(state.q, state.v)
    assert after.a == pytest.approx(free.a, abs=1e-9) and not np.allclose(after.a, state.a, atol=1e-3)
    again = simulator.enable(name)
    assert again.a == pytest.approx(state.a, abs=1e-8)


def test_saved_loaded_replayed_and_resumed(tmp_path):
    scene = boxes()
    simulator = nga.Simulator(scene, 1e-3, record=True)
    v0 = np.zeros(12)
    v0[6] = 0.5
    state = simulator.initial_state(np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))), v0)
    for i in range(30):
        if i == 10:
            state = simulator.weld("box_1", "box_0")
        state = simulator.step(state)
    run = simulator.trajectory()
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    for name in ("t", "q", "v", "P_N", "la_g", "La_g", "slots", "g_N", "gamma_F"):
        assert np.array_equal(getattr(loaded, name), getattr(run, name), equal_nan=True), name
    assert loaded.events == run.events and len(loaded.parts) == 2
    assert loaded.energy.total == pytest.approx(run.energy.total)
    viz.save_html(loaded, tmp_path / "run.html")
    # it goes on with the same bits, by hand or by simulate, from the state of the file
    rest = nga.simulate(simulator.scene, state=loaded.final_state, t_end=0.04, dt=1e-3)
    for _ in range(10):
        state = simulator.step(state)
    assert np.array_equal(rest.q[-1], state.q) and np.array_equal(rest.la_g[-1], state.la_b)


def test_a_state_in_a_scene_that_differs_says_what_differs():
    scene = boxes()
    simulator = nga.Simulator(scene, 1e-3)
    start = simulator.initial_state(np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))))
    state = simulator.weld("box_0", "box_1")
    with pytest.raises(nga.SceneError, match="the state has row of constraint 'Weld box_0-box_1'; .*transfer"):
        nga.simulate(scene, state=state, t_end=0.1, dt=1e-3)
    with pytest.raises(nga.SceneError, match="the scene has row of constraint 'Weld box_0-box_1'"):
        simulator.step(start)
    with pytest.raises(nga.SceneError, match=r"the state has joint 'box_1'; the state has contact 'box_1\[0\]/ground'"):
        nga.simulate(boxes(1), state=start, t_end=0.1, dt=1e-3)


def test_a_scene_that_runs_takes_no_constraint():
    scene = boxes()
    simulator = nga.Simulator(scene, 1e-3)
    scene.add_constraint(nga.Distance("box_0", "box_1", 0.2, name="before"))
    simulator = nga.Simulator(scene, 1e-3)
    simulator.initial_state(np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))))
    with pytest.raises(nga.SceneError, match=r"running in a Simulator.*simulator\.weld\(frame_a, frame_b\)"):
        scene.add_constraint(nga.Weld("box_0", "box_1"))
    del simulator
    scene.add_constraint(nga.Distance("box_0", "box_1", 0.2, name="after"))


def test_errors_say_what_to_do():
    simulator = nga.Simulator(boxes(), 1e-3)
    with pytest.raises(nga.SceneError, match="needs a state"):
        simulator.weld("box_0", "box_1")
    simulator.initial_state(np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3))))
    with pytest.raises(nga.UnknownName, match="no frame named 'bax_0'"):
        simulator.weld("bax_0", "box_1")
    simulator.weld("box_0", "box_1")
    with pytest.raises(nga.SceneError, match="'Weld box_0-box_1' already"):
        simulator.weld("box_0", "box_1")
    with pytest.raises(nga.UnknownName, match="no joint named 'hip'"):
        simulator.lock("hip")
    assert len(System(simulator.scene).constraints.names) == 6


@pytest.mark.parametrize("method", [nga.MoreauJean(), nga.GeneralizedAlpha(rho_inf=0.0)], ids=str)
def test_other_methods(method):
    scene = boxes(weightless=True)
    simulator = nga.Simulator(scene, 1e-3, method, record=True)
    v0 = np.zeros(12)
    v0[6] = 1.0
    before = simulator.step(simulator.initial_state(np.concatenate((pose(0.0, 0.0, 1.1), pose(0.0, 0.0, 1.4))), v0))
    after = simulator.weld("box_0", "box_1")
    assert momentum(scene, after) == pytest.approx(momentum(scene, before), abs=1e-12)
    state = simulator.step(after)
    assert momentum(scene, state)[:3] == pytest.approx(momentum(scene, before)[:3], abs=1e-5)
    assert len(simulator.trajectory().parts) == 2


def test_a_sliding_box_is_locked_without_pressing():
    """What is met lies along the surface: nothing approaches, and the impact has no normal percussion."""
    scene = nga.Scene()
    scene.add_plane("ground")
    for name in ("lower", "upper"):
        scene.add_body(name, coal.Box(0.2, 0.2, 0.2), mass=1.0)
    scene.add_contact("lower", "ground", mu=0.5)
    scene.add_contact("upper", "lower", mu=0.5)
    q0 = np.array([0, 0, 0.1, 0, 0, 0, 1, 0, 0, 0.3, 0, 0, 0, 1.0])
    simulator = nga.Simulator(scene, dt=1e-3, record=True)
    state = simulator.initial_state(q0, 0.5 * np.eye(12)[6])
    for _ in range(2):
        state = simulator.step(state)
    state = simulator.step(simulator.lock("upper"))
    assert np.abs(state.v).max() < 1e-12
    state = simulator.step(simulator.unlock("upper"))
    assert np.abs(state.v).max() < 1e-12 and simulator.trajectory().audit().ok
    with pytest.raises(nga.SceneError, match="state = .*expected a State"):
        simulator.sensors(q0)
    with pytest.raises(nga.SceneError, match="joint = 3"):
        simulator.sensors(state).joint_reaction(3)


@pytest.mark.parametrize("weightless", [False, True])
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_where_all_bodies_are_locked_rounding_is_no_speed(weightless, speed):
    """A part of the run has one moment, and nothing moves: neither has a speed that rounding could be a part of."""
    scene = boxes(weightless=weightless)
    simulator = nga.Simulator(scene, 1e-3, record=True)
    q0 = np.concatenate((pose(0.0, 0.0, 0.1), pose(0.0, 0.0, 0.3)))
    state = simulator.initial_state(q0, np.r_[np.zeros(6), speed, np.zeros(5)])
    simulator.step(state)
    for name in ("box_0", "box_1"):
        state = simulator.lock(name)
    for _ in range(2):
        state = simulator.step(state)
    run = simulator.trajectory()
    assert [len(part.t) for part in run.parts] == [2, 1, 3]
    for part in run.parts:
        audit = part.audit()
        assert audit.ok and audit.drift_rate < 1e-10 and audit.slip_law < 1e-10, str(audit)
    # but a velocity that a lock should not let through is none of rounding
    v = run.parts[-1].v.copy()
    v[1, 6] = 1e-9
    rows = {row.name: row.ok for row in replace(run.parts[-1], v=v).audit().rows()}
    assert not rows["constraints on velocity level"]
