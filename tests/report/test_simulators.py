"""Other simulators as lines of the report: each against its own scheme in closed form, or the true motion."""

import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.report import lines
from ngalpha_pin.report.cases import chosen_cases, pendulum
from ngalpha_pin.report.lines import Start
from ngalpha_pin.report.points import MaterialPoints, largest_distance
from ngalpha_pin.simulators import pinocchio_admm

G, DT = 9.81, 1e-2


def point_mass(z, mu=0.0, e_N=0.0, push=0.0):
    """A ball of 1 kg and 0.1 m on a translating joint above the ground; a constant force along x."""
    scene = balls(1, mu=mu, e_N=e_N)
    if push:
        scene.add_force(nga.Control(lambda t, q, v: np.array([push, 0.0, 0.0])))
    return scene, np.array([0.0, 0.0, z])


def arm_with(damping=0.0, friction=0.0, lower=-10.0, upper=10.0):
    """A pendulum with its centre of mass 1 m below the joint."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0.0, 0.0, -1.0]), np.eye(3)), pin.SE3.Identity())
    model.damping = np.array([damping])
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-friction]), np.array([friction])
    model.lowerPositionLimit, model.upperPositionLimit = np.array([lower]), np.array([upper])
    return nga.Scene(model), np.array([0.65]), np.zeros(1)


def run(line, scene, q0, v0, dt, t_end):
    done = line.run(Start(scene, np.asarray(q0, dtype=float), np.asarray(v0, dtype=float), 0.0, dt, round(t_end / dt)))
    assert done.message == ""
    assert done.seconds > 0 and done.setup > 0
    assert len(done.q) == round(t_end / dt) + 1
    return done


def orders(line, scene, q0, v0, t_end, sizes=(2e-3, 1e-3)):
    """Errors against a fine run of this package, and the order that the two show."""
    points, fine = MaterialPoints(scene), min(sizes) / 2
    exact = points.positions(nga.simulate(scene, q0, v0, t_end=t_end, dt=fine).q)
    errors = []
    for dt in sizes:
        q = run(line, scene, q0, v0, dt, t_end).q
        errors.append(largest_distance(points.positions(q), exact[:: round(dt / fine)]))
    return errors, np.log(errors[0] / errors[1]) / np.log(sizes[0] / sizes[1])


# the loop over Pinocchio's solver: closed forms of semi-implicit Euler


def test_admm_falls_as_semi_implicit_euler_does_and_stops_at_the_ground():
    scene, q0 = point_mass(0.3)
    done = run(pinocchio_admm.line(), scene, q0, np.zeros(3), DT, 0.5)
    n = np.arange(51)
    fall = 0.3 - G * DT**2 * n * (n + 1) / 2
    flies = fall > 0.1
    assert done.q[flies, 2] == pytest.approx(fall[flies], abs=1e-14)
    assert done.q[~flies, 2] == pytest.approx(0.1, abs=1e-10)
    assert done.rungs["free"] + done.rungs["ADMM"] == 50


def test_admm_slides_and_sticks_by_coulombs_law():
    mu, speed = 0.3, 1.0
    scene, q0 = point_mass(0.1, mu)
    x = run(pinocchio_admm.line(), scene, q0, np.array([speed, 0.0, 0.0]), DT, 0.5).q[:, 0]
    n = np.arange(51)
    velocity = np.maximum(speed - mu * G * DT * n, 0.0)
    assert x == pytest.approx(DT * (np.cumsum(velocity) - velocity[0]), abs=1e-7)
    held = point_mass(0.1, mu, push=0.99 * mu * G)[0]
    assert np.abs(run(pinocchio_admm.line(), held, q0, np.zeros(3), DT, 0.5).q[-1, 0]) < 1e-9
    pulled = point_mass(0.1, mu, push=1.01 * mu * G)[0]
    moved = run(pinocchio_admm.line(), pulled, q0, np.zeros(3), DT, 0.5).q[-1, 0]
    assert moved == pytest.approx(0.01 * mu * G * DT**2 * 50 * 51 / 2, rel=1e-6)


def test_admm_bounces_by_newtons_law():
    scene, q0 = point_mass(0.3, e_N=0.5)
    z = run(pinocchio_admm.line(), scene, q0, np.zeros(3), DT, 0.4).q[:, 2]
    i = int(np.argmin(z))
    before, after = (z[i] - z[i - 1]) / DT, (z[i + 1] - z[i]) / DT
    assert after == pytest.approx(-0.5 * before, rel=1e-6)


@pytest.mark.parametrize("laws", [{}, {"damping": 0.5}, {"friction": 2.0}, {"lower": -0.3}, {"upper": 0.7}])
def test_admm_keeps_the_laws_of_joints(laws):
    (coarse, _), order = orders(pinocchio_admm.line(), *arm_with(**laws), 1.0)
    assert order == pytest.approx(1.0, abs=0.15)
    assert coarse < 0.02


def test_admm_closes_loops_and_carries_forces():
    # two errors of opposite sign: their order comes down to 1 from above
    errors, order = orders(pinocchio_admm.line(), *robots.load("four_bar"), 0.1)
    assert 0.9 < order < 2.0 and errors[0] < 0.02
    errors, order = orders(pinocchio_admm.line(), *robots.load("arm", kp=50.0, kd=1.0), 0.1)
    assert order == pytest.approx(1.0, abs=0.15) and errors[0] < 0.01


def test_admm_stands_on_the_corners_of_a_box():
    scene, q0, v0 = chosen_cases("box_on_incline")[0].start()
    done = run(pinocchio_admm.line(), scene, q0, v0, 5e-3, 0.3)
    exact = chosen_cases("box_on_incline")[0].reference(5e-3 * np.arange(61))[0]
    assert np.abs(done.q[:, :3] - exact[:, :3]).max() < 4e-3
    assert np.abs(done.q[:, 2] - exact[:, 2]).max() < 1e-8


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("ball_in_cylinder", "touched from its inside"),
        ("tippe_top", "drilling friction"),
        ("hopper", "beams"),
        ("rolling_disc", "no counterpart of RollingDisc"),
    ],
)
def test_admm_says_what_it_cannot_express(name, says):
    with pytest.raises(nga.SceneError, match=says):
        pinocchio_admm.line().run(Start(*robots.load(name), 0.0, DT, 1))


# the packages of the extra `bench`, where they are installed


def test_line_of_a_package_that_is_not_installed_is_told(monkeypatch):
    original = lines.importlib.import_module

    def missing(name):
        if name.endswith("exudyn"):
            raise ModuleNotFoundError("No module named 'exudyn'", name="exudyn")
        return original(name)

    monkeypatch.setattr(lines.importlib, "import_module", missing)
    found, absent = lines.installed_simulators()
    assert "Exudyn" not in [line.label for line in found]
    assert "Pinocchio ADMM" in [line.label for line in found]
    assert "pip install" in absent["exudyn"] and "bench" in absent["exudyn"]


def test_simulator_that_is_there_but_fails_to_load_is_not_told_as_missing(monkeypatch):
    def fails(name):
        raise ImportError("initialization failed")

    monkeypatch.setattr(lines.importlib, "import_module", fails)
    found, absent = lines.installed_simulators()
    assert not found and set(absent.values()) == {"it cannot be imported: initialization failed"}


def test_mujoco_keeps_limits_and_falls():
    mujoco = pytest.importorskip("ngalpha_pin.simulators.mujoco", exc_type=ImportError)
    scene, q0 = point_mass(0.3)
    z = run(mujoco.line(), scene, q0, np.zeros(3), DT, 0.15).q[:, 2]
    n = np.arange(16)
    assert z == pytest.approx(0.3 - G * DT**2 * n * (n + 1) / 2, abs=1e-12)
    held = run(mujoco.line(), *arm_with(lower=0.2), 1e-3, 1.0).q
    assert 0.1 < held.min() < 0.21
    with pytest.raises(nga.SceneError, match="mjMINVAL"):
        mujoco.line().run(Start(*pendulum(), 0.0, DT, 1))


@pytest.mark.parametrize("laws", [{}, {"damping": 0.5}, {"friction": 2.0}])
def test_pybullet_converges_to_the_motion_of_a_joint(laws):
    pybullet = pytest.importorskip("ngalpha_pin.simulators.pybullet", exc_type=ImportError)
    errors, order = orders(pybullet.line(), *arm_with(**laws), 1.0)
    assert order == pytest.approx(1.0, abs=0.15) and errors[0] < 0.01


def test_pybullet_reads_trees_free_bodies_and_contacts():
    pybullet = pytest.importorskip("ngalpha_pin.simulators.pybullet", exc_type=ImportError)
    for scene, q0, v0, t_end in (
        (*robots.load("arm"), 0.2), (*spinning(True), 0.2), (*spinning(False), 0.2),
        (*robots.load("rotating_ball"), 0.8),
    ):  # fmt: skip
        errors, order = orders(pybullet.line(), scene, q0, v0, t_end)
        assert order == pytest.approx(1.0, abs=0.2) and errors[0] < 0.01


def test_pybullet_says_what_it_cannot_express():
    pybullet = pytest.importorskip("ngalpha_pin.simulators.pybullet", exc_type=ImportError)
    for name, says in (("four_bar", "constraints"), ("tippe_top", "Contensou"), ("ball_in_cylinder", "inside")):
        with pytest.raises(nga.SceneError, match=says):
            pybullet.line().run(Start(*robots.load(name), 0.0, DT, 1))


def test_exudyn_is_of_second_order_without_contact():
    exudyn = pytest.importorskip("ngalpha_pin.simulators.exudyn", exc_type=ImportError)
    for scene, q0, v0 in (robots.load("arm"), spinning(False), robots.load("four_bar")):
        errors, _ = orders(exudyn.line(), scene, q0, v0, 0.2, (8e-3, 4e-3))
        assert errors[1] < errors[0] / 3.0
        assert errors[0] < 1e-2
    t = 4e-3 * np.arange(51)
    scene, q0, v0 = spinning(True)
    points = MaterialPoints(scene)
    exact = points.positions(nga.simulate(scene, q0, v0, t_end=0.2, rtol=1e-9, t_eval=t[1:]).q)
    found = points.positions(run(exudyn.line(), scene, q0, v0, 4e-3, 0.2).q)
    assert largest_distance(found, exact) < 2e-6


def test_exudyn_comes_to_rest_on_the_ground():
    exudyn = pytest.importorskip("ngalpha_pin.simulators.exudyn", exc_type=ImportError)
    q = run(exudyn.line(), *robots.load("rotating_ball"), 1e-4, 1.0).q
    exact = nga.simulate(*robots.load("rotating_ball"), t_end=1.0, dt=1e-3).q
    assert np.abs(q[::10, :2] - exact[:, :2]).max() < 0.02
    with pytest.raises(nga.SceneError, match="lower limit"):
        exudyn.line().run(Start(*arm_with(lower=-0.1), 0.0, 1e-3, 1000))


def test_damping_of_exudyns_contact_gives_the_restitution():
    exudyn = pytest.importorskip("ngalpha_pin.simulators.exudyn", exc_type=ImportError)
    for e_N in (0.1, 0.5, 0.9):
        ratio = exudyn.damping_ratio(e_N)
        # one contact with frequency 1, by time integration: it lets go where the force would pull
        from scipy.integrate import solve_ivp

        def force(t, y, ratio=ratio):
            return y[0] + 2 * ratio * y[1]

        force.terminal, force.direction = True, 1.0
        contact = solve_ivp(lambda t, y, f=force: [y[1], -f(t, y)], (0, 10), [-0.0, -1.0], events=force, rtol=1e-10)
        assert contact.y[1, -1] == pytest.approx(e_N, rel=1e-6)


def spinning(flyer):
    """A body that turns and flies, with its centre of mass beside its frame on a free flyer."""
    model, moments = pin.Model(), np.array([[0.3, 0.05, 0.0], [0.05, 0.4, 0.02], [0.0, 0.02, 0.5]])
    if flyer:
        place = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.1, 0.0, 0.2]))
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), place, "body")
    else:
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "centre")
        joint = model.addJoint(joint, pin.JointModelSpherical(), pin.SE3.Identity(), "body")
    lever = np.array([0.1, 0.05, -0.1]) if flyer else np.zeros(3)
    model.appendBodyToJoint(joint, pin.Inertia(2.0, lever, moments), pin.SE3.Identity())
    return nga.Scene(model), pin.neutral(model), np.array([1.0, 0.2, 0.0, 0.5, 2.0, 0.3])


def test_drake_falls_slides_and_keeps_joints():
    drake = pytest.importorskip("ngalpha_pin.simulators.drake", exc_type=ImportError)
    scene, q0 = point_mass(0.3)
    n = np.arange(16)
    z = run(drake.line(), scene, q0, np.zeros(3), DT, 0.15).q[:, 2]
    assert z == pytest.approx(0.3 - G * DT**2 * n * (n + 1) / 2, abs=1e-12)
    scene, q0 = point_mass(0.1, mu=0.3)
    x = run(drake.line(), scene, q0, np.array([1.0, 0.0, 0.0]), 1e-3, 0.4).q[-1, 0]
    assert x == pytest.approx(1 / (2 * 0.3 * G), rel=0.01)
    assert run(drake.line(), *arm_with(lower=0.2), 1e-3, 1.0).q.min() == pytest.approx(0.2, abs=1e-4)
    for case in (arm_with(damping=0.5), robots.load("arm"), spinning(True)):
        errors, order = orders(drake.line(), *case, 0.2)
        assert order == pytest.approx(1.0, abs=0.1) and errors[0] < 0.01
    with pytest.raises(nga.SceneError, match="dry friction"):
        drake.line().run(Start(*arm_with(friction=1.0), 0.0, DT, 1))


@pytest.mark.parametrize("name", ["mujoco", "drake", "pybullet", "exudyn", "pinocchio_admm"])
def test_the_velocity_at_the_end_is_told_for_the_energy(name):
    module = pytest.importorskip(f"ngalpha_pin.simulators.{name}", exc_type=ImportError)
    for scene, q0, v0 in (robots.load("arm"), spinning(True)):
        done = run(module.line(), scene, q0, v0, 1e-3, 0.2)
        right = nga.simulate(scene, q0, v0, t_end=0.2, dt=1e-3)
        points = MaterialPoints(scene)
        assert points.energy(done.q[-1], done.v) == pytest.approx(points.energy(right.q[-1], right.v[-1]), abs=0.05)
        np.testing.assert_allclose(done.v, right.v[-1], atol=0.02 * np.abs(right.v[-1]).max())
