"""Contact of beam points with half-spaces, spheres and cylinders, and the hopper of section 10.5."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from verdicts import only_energy_of_unresolved_motion

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.report.points import MaterialPoints, largest_distance
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.robots import hopper
from ngalpha_pin.system.system import System

GRAVITY = 9.81
POSE = pin.SE3(pin.exp3(np.array([0.4, -0.7, 0.2])), np.array([0.3, -0.2, 0.1]))


def surfaces(model):
    """A free body that carries surfaces, for beams to touch."""
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(body, pin.Inertia.FromBox(2.0, 0.2, 0.3, 0.1), pin.SE3.Identity())
    model.addJointFrame(body)


SHAPES = {
    "half-space": coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.1),
    "sphere": coal.Sphere(0.3),
    "cylinder": coal.Cylinder(0.3, 50.0),
    "hollow cylinder": nga.Hollow(coal.Cylinder(5.0, 50.0)),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("parent", [None, "body"])
def test_rows_of_contacts_have_their_derivatives(shape, parent):
    model = pin.Model()
    surfaces(model)
    scene = nga.Scene(model)
    scene.add_beam(nga.PlanarBeam(1.0, EA=1e3, EI=1.0, line_density=1.0, elements=3), "beam")
    scene.add_beam_point("end", "beam", 1.0, radius=0.05)
    scene.add_beam_point("inside", "beam", 0.4)
    scene.add_geometry("surface", SHAPES[shape], parent=parent, placement=POSE)
    scene.add_contact("end", "surface", mu=0.3)
    scene.add_contact("inside", "surface", mu=0.3)
    system, rng = System(scene), np.random.default_rng(5)
    step = np.concatenate((rng.normal(size=6), 0.02 * rng.normal(size=system.nv - 6)))
    q, v, a = system.integrate(scene.q_ref, step), rng.normal(size=system.nv), rng.normal(size=system.nv)
    sub = system.contacts.subset(np.arange(2))

    def rows(dq, v, a):
        moved = system.integrate(q, dq)
        system.dynamics(0.0, moved, v, a)
        return system.contact_rows(sub, moved, v, a)

    def differences(f, h=1e-6):
        return np.array([(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(system.nv)]).T

    zero, h = np.zeros(system.nv), 1e-5
    found = rows(zero, v, a)
    W = system.directions([found])
    X, Y = system.row_derivatives([found], v, a)
    size = max(1.0, np.abs(X).max())
    assert W[: sub.k] == pytest.approx(differences(lambda d: rows(d, v, a).g_N), abs=1e-6)
    # tangents of a round surface are carried along with the contact, see test_contact_kinematics
    n = len(W) if shape == "half-space" else sub.k
    by_q = differences(lambda d: rows(d, v, a).rate)
    by_v = differences(lambda d: rows(zero, v + d, a).acceleration)
    along = [rows(s * h * v + h * h / 2 * a, v + s * h * a, a).rate for s in (1, -1)]
    assert X[:n] == pytest.approx(by_q[:n], abs=1e-6 * size)
    assert Y == pytest.approx(by_v, abs=1e-6 * size)
    assert ((along[0] - along[1]) / (2 * h))[:n] == pytest.approx(found.acceleration[:n], abs=1e-5 * size)


def test_a_beam_point_does_not_touch_a_box():
    scene = nga.Scene()
    scene.add_beam(nga.PlanarBeam(1.0, EA=1e3, EI=1.0, line_density=1.0, elements=3), "beam")
    scene.add_beam_point("end", "beam", 1.0)
    scene.add_geometry("box", coal.Box(1.0, 1.0, 1.0), placement=pin.SE3(np.eye(3), np.array([5.0, 0.0, 0.0])))
    scene.add_contact("end", "box")
    with pytest.raises(nga.SceneError, match="points of beams touch half-spaces, spheres and the lateral surface"):
        System(scene)


def lying_beam(mu, speed):
    """A soft beam on the ground that touches it with three points and slides along itself."""
    scene = nga.Scene()
    scene.add_plane("ground")
    body = scene.add_beam(nga.PlanarBeam(1.0, EA=100.0, EI=0.1, line_density=1.0, elements=2, damping=0.02), "beam")
    for i, xi in enumerate(np.linspace(0, 1, 3)):
        scene.add_beam_point(f"p{i}", "beam", xi)
    scene.add_contact("p*", "ground", mu=mu)
    q0 = nga.static_equilibrium(scene, scene.q_ref).q
    return scene, body, q0, body.rigid_velocity(q0, (speed, 0.0))


def test_beam_slides_on_the_ground_and_stops():
    mu, speed = 0.4, 0.1
    scene, body, q0, v0 = lying_beam(mu, speed)
    time = speed / (mu * GRAVITY)
    run = nga.simulate(scene, q0, v0, t_end=0.04, dt=5e-4, method=nga.GeneralizedAlpha(rho_inf=0.0))
    centre = run.v[:, 0::2] @ body.node_mass / body.mass
    half = np.searchsorted(run.t, 0.6 * time)
    assert centre[half] == pytest.approx(speed - mu * GRAVITY * run.t[half], abs=1e-3)
    assert run.la_N[half].sum() == pytest.approx(body.mass * GRAVITY, rel=0.02)
    assert run.audit().ok
    assert np.abs(run.P_F.sum()) == pytest.approx(body.mass * (speed - centre[-1]), rel=1e-9)
    assert np.abs(centre[-1]) < 1e-2


def test_energy_goes_into_the_damping_of_the_material():
    left = []
    for dt in (5e-4, 2.5e-4):
        scene, _, q0, v0 = lying_beam(0.4, 0.1)
        run = nga.simulate(scene, q0, v0, t_end=0.01, dt=dt)
        account = balance(run)
        assert account.joints[-1] < -0.05 * account.scale
        left.append(account.error)
    assert left[0] < 1e-3
    assert np.log2(left[0] / left[1]) > 1.7


def test_beam_rests_with_its_weight():
    scene, body, q0, _ = lying_beam(0.5, 0.0)
    found = nga.static_equilibrium(scene, q0)
    assert found.la_N.sum() == pytest.approx(body.mass * GRAVITY, rel=1e-11)
    run = nga.simulate(scene, q0, t_end=0.01, dt=1e-3)
    assert np.abs(run.q - q0).max() < 1e-12


def rope(pull, mu=0.3, n=5, radius=0.1):
    """A rope over half of a fixed drum, held with 1 N on one side and pulled with `pull` on the other [N]."""
    scene = nga.Scene()
    scene.model.gravity.linear = np.zeros(3)

    def over(xi):
        return radius * np.column_stack((np.cos(np.pi * (1 - xi)), np.sin(np.pi * (1 - xi))))

    scene.add_beam(nga.PlanarBeam(EA=1e3, EI=1e-4, line_density=0.1, elements=n, curve=over, damping=1e-3), "rope")
    axis_along_y = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    for i in range(n + 1):
        scene.add_beam_point(f"p{i}", "rope", i / n)
    start = scene.beams["rope"].points(scene.q_ref, np.linspace(0, 1, n + 1))
    scene.add_geometry("drum", coal.Cylinder(np.linalg.norm(start, axis=1).min(), 1.0), placement=axis_along_y)
    scene.add_contact("p*", "drum", mu=mu)
    scene.add_load(nga.PointLoad("p0", force=(0.0, 0.0, -pull)))
    scene.add_load(nga.PointLoad(f"p{n}", force=(0.0, 0.0, -1.0)))
    return scene


@pytest.mark.parametrize(("part", "slides"), [(0.9, False), (1.15, True)])
def test_rope_on_a_drum_slides_beyond_the_ratio_of_euler_and_eytelwein(part, slides):
    """With contact at every pi / n the ratio is ((1 + mu tan) / (1 - mu tan))^n at half of that angle."""
    n, mu = 5, 0.3
    bound = mu * np.tan(np.pi / n / 2)
    ratio = ((1 + bound) / (1 - bound)) ** n
    assert ratio == pytest.approx(np.exp(mu * np.pi), rel=5e-2)
    run = nga.simulate(
        rope(part * ratio, mu, n), rope(1.0).q_ref, t_end=0.03, dt=1e-3, method=nga.GeneralizedAlpha(0.0)
    )
    # the force comes at once, and waves run along a rope that does not slide that the steps may be too long for
    assert not (only_energy_of_unresolved_motion(run) and slides)
    fast = np.abs(run.gamma_F[-1]).min()
    assert fast > 0.05 if slides else fast < 1e-3


def test_hopper_has_the_parameters_of_the_paper():
    scene, q0, v0 = robots.load("hopper")
    beam = scene.beams["shin"]
    assert (beam.EA, beam.EI, beam.line_density, beam.length) == pytest.approx((1.89e7, 14.2, 0.71, 0.2))
    assert (beam.degree, beam.elements, beam.gauss) == (2, 2, 5)
    assert [inertia.mass for inertia in scene.model.inertias][1:] == pytest.approx([3.0, 1.56])
    assert scene.model.inertias[2].inertia[1, 1] == pytest.approx(8.5e-3)
    assert (q0[0], np.arctan2(q0[2], q0[1])) == pytest.approx((0.31, np.pi / 3))
    assert not v0.any()
    law = scene.contacts[0].law
    assert (law.mu, law.e_N, law.e_F) == (0.2, 0.0, 0.0)
    times = np.linspace(0, 1, 50)
    for angle, expected in ((hopper.alpha, np.pi / 3 - np.pi / 30 * (1 - np.cos(4 * np.pi * times))),):
        assert [angle(t)[0] for t in times] == pytest.approx(expected)
    assert [hopper.beta(t)[0] + 2 * hopper.alpha(t)[0] for t in times] == pytest.approx(np.full(50, np.pi))
    for angle in (hopper.alpha, hopper.beta):
        h = 1e-4
        rate = [(angle(t + h)[0] - angle(t - h)[0]) / (2 * h) for t in times]
        assert [angle(t)[1] for t in times] == pytest.approx(rate, abs=1e-5)
        rate = [(angle(t + h)[1] - angle(t - h)[1]) / (2 * h) for t in times]
        assert [angle(t)[2] for t in times] == pytest.approx(rate, abs=1e-4)
    points = beam.points(q0[scene.slices[beam].q], np.array([0.0, 1.0]))
    assert points == pytest.approx(np.array([[0.2 * np.sin(np.pi / 3), 0.0, 0.21], [0.0, 0.0, 0.11]]))


def test_hopper_stands_with_its_weight():
    scene, q0, _ = robots.load("hopper", height=0.2, moves=False, mu=0.0)
    found = nga.static_equilibrium(scene, q0)
    assert found.la_N[0] == pytest.approx(hopper.MASS * GRAVITY, rel=1e-9)
    run = nga.simulate(scene, found.q, t_end=2e-3, dt=2e-4, method=nga.GeneralizedAlpha(rho_inf=0.0))
    assert run.la_N[-1, 0] == pytest.approx(hopper.MASS * GRAVITY, rel=1e-9)
    with pytest.raises(nga.SceneError, match=r"'foot/ground' would slip, it needs mu = 1\.7"):
        nga.static_equilibrium(robots.load("hopper", height=0.2, moves=False)[0], q0)


def momentum_balance(run):
    """Sum of P_N minus what changed the vertical momentum of body, rod and beam [N s]."""
    upwards = np.zeros(run.v.shape[1])
    upwards[0] = 1.0
    upwards[3::2] = 1.0
    momentum = upwards @ run.system.mass_matrix(run.q[-1]) @ run.v[-1]
    return run.P_N.sum() - hopper.MASS * GRAVITY * run.t[-1] - momentum


def test_hopper_touches_down():
    """From 0.31 m to after the first impacts, with twenty times the step of the paper."""
    scene, q0, v0 = robots.load("hopper")
    dt = 1e-3
    run = nga.simulate(scene, q0, v0, t_end=0.135, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.0))
    first = run.t[np.flatnonzero(run.P_N[:, 0] > 0)[0]]
    assert first == pytest.approx(0.12622, abs=dt)
    assert momentum_balance(run) == pytest.approx(0.0, abs=1e-5 * run.P_N.sum())
    assert (np.abs(run.P_F[:, 0]) <= 0.2 * run.P_N[:, 0] + 1e-15).all()
    assert run.audit().ok


@pytest.mark.long
def test_hopper_with_a_damped_leg_converges_with_second_order_across_two_landings():
    """Without the swing of the leg along its axis nothing is left that steps of 1e-4 s do not resolve."""
    scene, q0, v0 = robots.load("hopper", damping=1e-4)
    before = nga.simulate(scene, q0, v0, t_end=0.12, dt=1.25e-4)
    sizes, runs = [1.25e-4, 6.25e-5, 3.125e-5, 1.5625e-5], []
    for dt in sizes:
        state = initial_state(System(scene), before.q[-1], before.v[-1], 0.12)
        runs.append(nga.simulate(scene, state=state, t_end=0.14, dt=dt))
        assert [event.kind for event in runs[-1].events] == ["impact", "lift-off", "impact"]
    points = MaterialPoints(scene)
    fine = points.positions(runs[-1].q)
    errors = []
    for dt, run in zip(sizes, runs, strict=True):
        errors.append(largest_distance(points.positions(run.q), fine[:: round(dt / sizes[-1])]))
    assert errors[0] < 5e-7
    assert errors[0] > 3.5 * errors[1] > 3.5**2 * errors[2]


@pytest.mark.long
def test_hopper_of_the_paper():
    """dt = 5e-5 as in the footnote, and its double: touch-down, balance, cone, convergence."""
    heights, sums = [], []
    for dt in (1e-4, 5e-5):
        run = nga.simulate(*robots.load("hopper"), t_end=1.0, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.0))
        assert run.t[np.flatnonzero(run.P_N[:, 0] > 0)[0]] == pytest.approx(0.12622, abs=dt)
        assert momentum_balance(run) == pytest.approx(0.0, abs=1e-8 * run.P_N.sum())
        assert (np.abs(run.P_F[:, 0]) <= 0.2 * run.P_N[:, 0] + 1e-15).all()
        heights.append(run.q[-1, 0])
        sums.append(run.P_N.sum())
    assert heights[1] == pytest.approx(heights[0], abs=3e-3)
    assert sums[1] == pytest.approx(sums[0], rel=1e-3)


LIFT = """<robot name="lift"><link name="base"/><link name="boom"><inertial><origin xyz=".25 0 0"/><mass value="1"/>
<inertia ixx=".01" iyy=".05" izz=".05" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 .3"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="10"/></joint>
<joint name="flange" type="fixed"><parent link="boom"/><child link="tool"/><origin xyz=".5 0 0"/></joint></robot>"""


@pytest.mark.parametrize(
    ("elements", "radius", "effort", "t_end"),
    [pytest.param(4, 4e-3, True, 0.6, marks=pytest.mark.long), (8, 3.95e-3, False, 0.15)],
)
def test_rod_on_the_arm_of_a_file_comes_down_and_rests(tmp_path, elements, radius, effort, t_end):
    """Iterates that run away in some of these impacts are given up, and limits of motors know nothing of beams."""
    (tmp_path / "lift.urdf").write_text(LIFT)
    scene = nga.Scene.from_urdf(tmp_path / "lift.urdf")
    area, kp, wanted = np.pi * radius**2, 60.0, 0.5
    section = {"EA": 2e11 * area, "EI": 2e11 * area * radius**2 / 4, "line_density": 7800 * area}
    rod = scene.add_beam(nga.PlanarBeam(0.5, elements=elements, damping=1e-4, **section), "rod")
    scene.add_beam_point("root", "rod", 0.0)
    scene.add_beam_point("tip", "rod", 1.0, radius=radius)
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    scene.add_constraint(nga.Weld("tool", "root", placement_a=upright))
    scene.add_plane("ground")
    scene.add_contact("tip", "ground", mu=0.3)
    q0 = scene.q_ref
    q0[scene.slices[rod].q] = rod.configuration((0.5, 0.3))
    scene.joints = nga.JointLaws(effort=effort)
    scene.add_force(nga.JointPD(np.array([wanted]), kp=kp, kd=4.0))
    run = nga.simulate(scene, q0, t_end=t_end, dt=1e-3)
    assert run.audit().ok, str(run.audit())
    total = run.energy.total  # what rings along the rod after an impact is taken away, and nothing is added
    assert np.diff(total).max() < 1e-2 * run.energy.kinetic.max()
    if t_end < 0.5:
        return
    # moments about the shoulder: the servo and the weights push down what the ground carries
    q, points = run.q[-1, 0], rod.points(run.q[-1, scene.slices[rod].q], np.linspace(0, 1, 101))
    weights = GRAVITY * (0.25 * np.cos(q) + rod.mass * np.trapezoid(points[:, 0], dx=0.01))
    carried = run.la_N[-1, 0] * points[-1, 0] - kp * (wanted - q) - weights
    assert np.abs(carried) == pytest.approx(0.3 * np.linalg.norm(run.la_F[-1]), abs=0.01 * weights)
    assert points[-1, 2] == pytest.approx(radius, abs=1e-9)


def test_compliant_impact_of_a_ball_on_a_beam_has_a_limit_in_the_mesh():
    """A rigid one has none: less and less mass takes part in it. Both ends of the beam are clamped."""
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    largest = []
    for elements in (4, 8):
        model = pin.Model()
        model.addJoint(0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.06])), "ball")
        model.appendBodyToJoint(1, pin.Inertia.FromSphere(0.2, 0.05), pin.SE3.Identity())
        model.addJointFrame(1)
        scene = nga.Scene(model)
        scene.add_beam(nga.PlanarBeam(1.0, EA=1e5, EI=20.0, line_density=0.5, elements=elements, plane=upright), "beam")
        for name, xi in (("root", 0.0), ("middle", 0.5), ("tip", 1.0)):
            scene.add_beam_point(name, "beam", xi)
            end = upright * pin.SE3(np.eye(3), np.array([xi, 0.0, 0.0]))
            if name != "middle":
                scene.add_constraint(nga.Weld("world", name, placement_a=end))
        scene.add_geometry("ball", coal.Sphere(0.05), parent="ball")
        scene.add_contact("middle", "ball", mu=0.2, compliance=nga.KelvinVoigt(5e3, 2.0))
        run = nga.simulate(scene, scene.q_ref, np.eye(1, scene.q_ref.size)[0] * -0.5, t_end=0.05, dt=1e-3)
        assert run.audit().ok, str(run.audit())
        assert run.audit().compliance < 1e-9
        largest.append(run.la_N.max())
    assert largest[0] == pytest.approx(largest[1], rel=2e-2)


def test_compliant_contact_of_a_beam_to_a_chosen_accuracy():
    """A ball hits a beam that floats, against an integration of both with the force of the contact written out."""
    upright, t_end = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3)), 6e-3
    weights, of_x = (
        np.array([0.25, 0.5, 0.25]),
        np.array([3, 5, 7]),
    )  # the middle of two elements is a mean of three points
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    model.addJoint(0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.051])), "ball")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(0.2, 0.05), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_beam(nga.PlanarBeam(1.0, EA=1e3, EI=20.0, line_density=0.5, elements=2, plane=upright), "beam")
    scene.add_beam_point("middle", "beam", 0.5)
    scene.add_geometry("ball", coal.Sphere(0.05), parent="ball")
    scene.add_contact("middle", "ball", mu=0.0, compliance=nga.KelvinVoigt(5e3, 2.0))
    system, q0 = System(scene), scene.q_ref
    v0 = np.eye(1, len(q0))[0] * -0.5

    def rate(t, y):
        q, v = np.split(y, 2)
        dynamics = system.dynamics(t, q, v, np.zeros(len(q)))
        load = dynamics.residual.copy()
        apart = np.array([0.5 - weights @ q[of_x], q[0] + 0.051 - weights @ q[of_x + 1]])
        n, depth = apart / np.linalg.norm(apart), 0.05 - np.linalg.norm(apart)
        approach = n @ [weights @ v[of_x], weights @ v[of_x + 1] - v[0]]
        force = max(5e3 * depth + 2.0 * approach, 0.0) if depth > 0.0 else 0.0
        load[0] -= force * n[1]
        load[of_x] += weights * force * n[0]
        load[of_x + 1] += weights * force * n[1]
        return np.concatenate((v, np.linalg.solve(dense(dynamics.M), -load)))

    right = np.concatenate((q0, v0))
    for part in ((0.0, 2e-3), (2e-3, t_end)):  # the ball arrives at 2 ms
        right = solve_ivp(rate, part, right, "DOP853", rtol=1e-9, atol=1e-10).y[:, -1]
    for rtol in (1e-4, 1e-6):
        run = nga.simulate(scene, q0, v0, t_end=t_end, rtol=rtol)
        assert run.la_N[-1, 0] > 5.0  # it still presses
        assert np.abs(np.concatenate((run.q[-1], run.v[-1])) - right).max() < 10 * rtol
        assert run.audit().ok, str(run.audit())
