"""Beams in motion: conserved quantities, order in dt, damping of what is too fast, blocks and bands."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.numerics.block_matrix import BlockMatrix
from ngalpha_pin.system.system import System

EA, EI, LINE_DENSITY, LENGTH = 1.89e7, 14.2, 0.71, 0.2
PERIOD = 2 * np.pi / (1.875104068711961**2 * np.sqrt(EI / LINE_DENSITY) / LENGTH**2)  # of the cantilever [s]
AXIAL_PERIOD = 4 * LENGTH / np.sqrt(EA / LINE_DENSITY)


def cantilever(elements=2, gravity=0.0, **parameters):
    scene = nga.Scene()
    scene.model.gravity.linear = np.array([0.0, 0.0, -gravity])
    body = nga.PlanarBeam(LENGTH, EA=EA, EI=EI, line_density=LINE_DENSITY, elements=elements, **parameters)
    scene.add_beam(body, "beam")
    scene.add_beam_point("root", "beam", 0.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=body.plane))
    return scene, body


def test_free_flying_beam_keeps_momentum_and_energy():
    """Ten periods of the first bending mode, flying and turning; rho_inf = 1."""
    scene = nga.Scene()
    scene.model.gravity.linear = np.zeros(3)
    body = scene.add_beam(nga.PlanarBeam(1.0, EA=100.0, EI=1.0, line_density=1.0, elements=2), "beam")
    v0 = body.rigid_velocity(body.q_ref, (1.0, 0.5), 0.5)
    v0[1::2] += 0.2 * np.cos(2 * np.pi * np.linspace(0, 1, body.nv // 2))
    period = 2 * np.pi / 22.37
    method = nga.GeneralizedAlpha(rho_inf=1.0)
    run = nga.simulate(scene, scene.q_ref, v0, t_end=10 * period, dt=period / 80, method=method)
    total = run.energy.total
    assert np.ptp(total) < 1e-6 * total[0]
    assert run.energy.elastic.max() > 3e-3 * total[0]
    p = np.array([body.M @ v for v in run.v]).reshape(len(run.t), -1, 2)
    momentum, q = p.sum(axis=1), run.q.reshape(p.shape)
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.abs(momentum[0]).max()
    angular = (q[:, :, 0] * p[:, :, 1] - q[:, :, 1] * p[:, :, 0]).sum(axis=1)
    assert np.ptp(angular) < 1e-6 * np.abs(angular[0])
    assert run.audit().ok


def test_audit_knows_the_rounding_of_a_stiff_beam_in_free_fall():
    scene = nga.Scene()
    scene.add_beam(nga.PlanarBeam(1.0, EA=3.5e6, EI=14.0, line_density=0.136, degree=3, elements=4), "beam")
    run = nga.simulate(scene, scene.q_ref, t_end=0.05, dt=1e-3)
    np.testing.assert_allclose(run.q[-1, 1::2], -9.81 * 0.05**2 / 2, rtol=1e-9)
    assert run.audit().ok


@pytest.mark.parametrize(("rho_inf", "fewest"), [(0.0, 80), (0.8, 25)])
def test_released_cantilever_is_of_second_order(rho_inf, fewest):
    """Let go in the shape of its first mode; the tip after a period and a quarter, where it is fastest."""
    scene, _ = cantilever()
    mode = nga.eigenmodes(scene, scene.q_ref).shapes[:, 0]
    q0 = scene.q_ref + 1e-4 * LENGTH * mode / np.abs(mode).max()
    method, tips = nga.GeneralizedAlpha(rho_inf=rho_inf), []
    for steps in (fewest, 2 * fewest, 4 * fewest):
        run = nga.simulate(scene, q0, t_end=1.25 * PERIOD, dt=1.25 * PERIOD / steps, method=method)
        tips.append(run.q[-1, -1] / q0[-1])
    order = np.log2((tips[1] - tips[0]) / (tips[2] - tips[1]))
    assert 1.9 < order < 2.1
    assert tips[-1] == pytest.approx(0.0, abs=2e-2)


def test_steps_of_a_hundred_axial_periods_are_stable():
    scene, _ = cantilever(gravity=9.81)
    scene.add_beam_point("tip", "beam", 1.0)
    loaded, _ = cantilever(gravity=9.81)
    loaded.add_beam_point("tip", "beam", 1.0)
    loaded.add_load(nga.PointLoad("tip", force=(0.0, 0.0, -100.0)))
    bent = nga.static_equilibrium(loaded, loaded.q_ref).q
    rest = nga.static_equilibrium(scene, scene.q_ref).q
    method = nga.GeneralizedAlpha(rho_inf=0.0)
    run = nga.simulate(scene, bent, t_end=200 * AXIAL_PERIOD * 100, dt=100 * AXIAL_PERIOD, method=method)
    assert run.q[-1] == pytest.approx(rest, abs=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-9


def test_kelvin_voigt_damping_dissipates():
    scene, body = cantilever(damping=1e-4)
    loaded, _ = cantilever()
    loaded.add_beam_point("tip", "beam", 1.0)
    loaded.add_load(nga.PointLoad("tip", force=(0.0, 0.0, -1.0)))
    q0 = nga.static_equilibrium(loaded, loaded.q_ref).q
    run = nga.simulate(scene, q0, t_end=2 * PERIOD, dt=PERIOD / 60, method=nga.GeneralizedAlpha(rho_inf=0.9))
    omega = 2 * np.pi / PERIOD
    damped = np.exp(-(omega**2) * 1e-4 * 2 * PERIOD)  # amplitude falls with omega^2 tau / 2
    assert run.energy.total[-1] == pytest.approx(run.energy.total[0] * damped, rel=0.05)
    assert body.damping == 1e-4


def mixed_scene():
    """A floating body, a pendulum, two beams with pins and a clamp between all of them."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(base, pin.Inertia.FromBox(1.0, 0.2, 0.3, 0.1), pin.SE3.Identity())
    arm = model.addJoint(base, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), "arm")
    model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.3, 0.1), pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])))
    scene = nga.Scene(model)
    scene.add_beam(nga.PlanarBeam(0.5, EA=1e3, EI=1.0, line_density=0.4, elements=3), "first")
    tilted = pin.SE3(pin.utils.rotate("x", 1.2), np.array([0.0, 0.1, 0.0]))
    scene.add_beam(nga.PlanarBeam(0.3, EA=2e3, EI=0.5, line_density=0.3, degree=2, elements=4, plane=tilted), "second")
    for name, beam, xi in (("a", "first", 0.0), ("b", "first", 0.37), ("c", "second", 1.0)):
        scene.add_beam_point(name, beam, xi)
    return scene


def state_of(scene, seed):
    system, rng = System(scene), np.random.default_rng(seed)
    step = np.concatenate((rng.normal(size=scene.model.nv), 0.01 * rng.normal(size=system.nv - scene.model.nv)))
    return system, system.integrate(scene.q_ref, step), rng.normal(size=system.nv), rng.normal(size=system.nv)


def differences(f, system, h=1e-6):
    return np.array([(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(system.nv)]).T


CONSTRAINTS = {
    "beam pinned to a link": nga.PointJoint("arm", "b"),
    "link clamped to a beam": nga.Weld("c", "arm"),
    "beam clamped to the world": nga.Weld("world", "a"),
    "beam pinned to a beam": nga.RevoluteJoint("a", "c"),
    "driven angle of beam and link": nga.DrivenAngle("base", "b", np.sin, axis=(0.2, 0.3, 1.0)),
    "driven angle of link and beam": nga.DrivenAngle("c", "arm", np.sin),
    "driven angle of links": nga.DrivenAngle("base", "arm", np.sin, axis=(0.0, 1.0, 0.0)),
}


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_rows_of_constraints_with_beams_have_their_derivatives(name):
    scene = mixed_scene()
    scene.add_constraint(CONSTRAINTS[name])
    system, q, v, a = state_of(scene, 1)
    t, h = 0.3, 1e-5

    def rows(dq, v, a, t=t):
        system.dynamics(t, system.integrate(q, dq), v, a)
        return system.constraint_rows(t, system.integrate(q, dq), v, a)

    zero = np.zeros(system.nv)
    found = rows(zero, v, a)
    W = system.directions([found])
    X, Y = system.row_derivatives([found], v, a)
    size = max(1.0, np.abs(X).max())
    assert X == pytest.approx(differences(lambda d: rows(d, v, a).rate, system), abs=1e-6 * size)
    assert Y == pytest.approx(differences(lambda d: rows(zero, v + d, a).acceleration, system), abs=1e-6 * size)
    assert W == pytest.approx(differences(lambda d: rows(zero, v + d, a).rate, system), abs=1e-6 * np.abs(W).max())
    along = [rows(s * h * v + h * h / 2 * a, v + s * h * a, a, t + s * h).rate for s in (1, -1)]
    assert (along[0] - along[1]) / (2 * h) == pytest.approx(found.acceleration, abs=1e-5 * size)


def test_driven_angle_is_a_joint_trajectory():
    def angle(t):
        return 0.3 * np.sin(5.0 * t) + 0.2 * t

    runs = []
    for constraint in (nga.JointTrajectory("arm", angle), nga.DrivenAngle("world", "arm", angle, axis=(0.0, 1.0, 0.0))):
        model = pin.Model()
        arm = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "arm")
        model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.3, 0.1), pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.1])))
        scene = nga.Scene(model)
        scene.add_constraint(constraint)
        runs.append(nga.simulate(scene, np.zeros(1), np.array([1.7]), t_end=0.5, dt=1e-2))
    assert runs[1].q == pytest.approx(runs[0].q, abs=1e-12)
    assert runs[1].la_g == pytest.approx(runs[0].la_g, abs=1e-9)
    assert runs[1].q[:, 0] == pytest.approx([angle(t) for t in runs[1].t], abs=1e-12)


def test_bad_driven_angles_are_refused():
    scene = mixed_scene()
    with pytest.raises(nga.SceneError, match="DrivenAngle base-b: angle = 0.3: expected a function of time"):
        nga.DrivenAngle("base", "b", 0.3)
    with pytest.raises(nga.SceneError, match="'b' and 'b' are on one and the same body"):
        scene.add_constraint(nga.DrivenAngle("b", "b", np.sin))
    with pytest.raises(nga.UnknownName, match="no frame named 'd'"):
        scene.add_constraint(nga.DrivenAngle("base", "d", np.sin))


def test_forces_at_frames_act_on_the_tree():
    scene = mixed_scene()
    scene.add_force(nga.Spring("world", "b", stiffness=1.0))
    with pytest.raises(nga.SceneError, match="'b' is a point of a beam, and forces at frames act on the bodies"):
        System(scene)


def test_equations_of_motion_of_tree_and_beams():
    scene = mixed_scene()
    scene.add_force(nga.Spring("world", "arm", stiffness=5.0, rest=0.1, damping=0.3))
    scene.add_load(nga.PointLoad("b", force=(1.0, 2.0, 3.0), moment=0.4))
    scene.add_force(nga.JointSpring("arm", stiffness=3.0, damping=0.2))
    system, q, v, a = state_of(scene, 2)
    found = system.dynamics(0.0, q, v, a)
    M, K, D = (x.copy().toarray() for x in (found.M, found.K, found.D))
    assert isinstance(found.M, BlockMatrix)
    assert M == pytest.approx(system.mass_matrix(q), abs=1e-12)
    zero = np.zeros(system.nv)

    def residual(dq, dv, da):
        return system.dynamics(0.0, system.integrate(q, dq), v + dv, a + da).residual.copy()

    assert K == pytest.approx(differences(lambda d: residual(d, zero, zero), system), abs=1e-6 * np.abs(K).max())
    assert D == pytest.approx(differences(lambda d: residual(zero, d, zero), system), abs=1e-6 * np.abs(D).max())
    assert M == pytest.approx(differences(lambda d: residual(zero, zero, d), system), abs=1e-6 * np.abs(M).max())


@pytest.mark.parametrize("elements", [1, 2, 7])
def test_blocks_and_bands_are_the_dense_matrices(elements):
    rng = np.random.default_rng(0)
    body = nga.PlanarBeam(1.0, EA=10.0, EI=1.0, line_density=1.0, degree=3, elements=elements)
    tree = rng.normal(size=(3, 3)) + 5 * np.eye(3)
    A = BlockMatrix(tree, (body.M, body.M))
    dense = A.toarray()
    assert dense[:3, :3] == pytest.approx(tree)
    for x in (rng.normal(size=len(dense)), rng.normal(size=(len(dense), 4))):
        assert A @ x == pytest.approx(dense @ x)
        assert A.solve(dense @ x, positive=False) == pytest.approx(x)
        assert BlockMatrix(tree @ tree.T, A.bands).solve(x, positive=True) == pytest.approx(
            np.linalg.solve(BlockMatrix(tree @ tree.T, A.bands).toarray(), x)
        )
    x = rng.normal(size=(4, len(dense)))
    assert x @ A == pytest.approx(x @ dense)
    assert x[0] @ A == pytest.approx(x[0] @ dense)
    assert (A + 2.0 * A).toarray() == pytest.approx(3 * dense)
    assert A.diagonal() == pytest.approx(dense.diagonal())


def test_bands_do_not_grow_with_the_elements():
    widths = {System(cantilever(n)[0]).beams.M[0].data.shape[0] for n in (2, 8, 64)}
    assert widths == {15}


def test_beams_are_saved_and_continued(tmp_path):
    scene, body = cantilever(elements=3, gravity=9.81, damping=1e-5)
    scene.add_load(nga.LineLoad("beam", (1.0, 0.0, 2.0)))
    whole = nga.simulate(scene, scene.q_ref, t_end=2e-3, dt=1e-4)
    half = nga.simulate(scene, scene.q_ref, t_end=1e-3, dt=1e-4)
    half.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    rest = nga.simulate(scene, state=loaded.final_state, t_end=2e-3)
    assert (rest.q[-1] == whole.q[-1]).all()
    twin = loaded.scene.beams["beam"]
    assert (twin.q_ref == body.q_ref).all()
    assert repr(twin) == repr(body)
    assert loaded.scene.slices[twin] == scene.slices[body]
    assert loaded.energy.total == pytest.approx(half.energy.total, rel=1e-12)
    name, points, radius = loaded.tubes[0]
    assert (name, points.shape, radius) == ("beam", (11, 33, 3), pytest.approx(2 * np.sqrt(EI / EA)))
    assert points == pytest.approx(half.tubes[0][1])
    with pytest.raises(nga.UnknownName, match="no beam, rod or cable named 'leg'"):
        loaded.section_forces("leg", np.zeros(1))


def test_moreau_and_the_simulator_take_beams():
    scene, _ = cantilever(elements=2, gravity=9.81)
    fine = nga.simulate(scene, scene.q_ref, t_end=1e-4, dt=5e-6)
    moreau = nga.simulate(scene, scene.q_ref, t_end=1e-4, dt=1e-6, method=nga.MoreauJean())
    assert moreau.q[-1] == pytest.approx(fine.q[-1], abs=2e-9)
    simulator = nga.Simulator(scene, 5e-6)
    state = simulator.initial_state(scene.q_ref)
    for _ in range(20):
        state = simulator.step(state)
    assert (state.q == fine.q[-1]).all()


def test_assembly_moves_a_beam_to_its_clamp():
    scene, body = cantilever(elements=3)
    found = nga.assemble(scene, body.configuration((0.02, -0.03), angle=0.1))
    assert "beam" in found.moved
    system = System(scene)
    system.dynamics(0.0, found.q, found.v, found.v)
    assert np.abs(system.constraint_rows(0.0, found.q, found.v, found.v).g).max() < 1e-10
