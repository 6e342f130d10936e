"""Springs of ball joints and free joints: value, derivatives, energy, a closed form, and the way to a file and back."""

import pickle
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators.native_forces import NativeForces
from ngalpha_pin.integrators.plain_steps import _engine
from ngalpha_pin.scene.mjcf.compiler import compiled
from ngalpha_pin.system.actuation import NO_ACTUATION
from ngalpha_pin.system.system import System

FILE = Path(__file__).parent / "mjcf" / "pose_springs.xml"
REST = np.array([0.3, -0.1, 0.2, *pin.Quaternion(pin.exp3(np.array([0.4, 1.0, -0.3]))).coeffs()])
STEP = 1e-6  # of differences


def scene_of(joint=None, spring=(), inertia=(0.02, 0.03, 0.04)):
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    at = model.addJoint(0, joint or pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(at, pin.Inertia(2.0, np.zeros(3), np.diag(inertia)), pin.SE3.Identity())
    scene = nga.Scene(model)
    if spring:
        scene.add_force(nga.PoseSpring("body", *spring))
    return scene


def added(law, q):
    n = law._v + (6 if law._moves else 3)
    tau, K, D = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    law.add_to(0.0, q, np.zeros(n), tau, K, D)
    assert not D.any()
    return tau, K


@pytest.mark.parametrize("turn", [0.0, 1e-9, 0.02, 0.099, 0.101, 1.0, 3.0, 3.1415])
@pytest.mark.parametrize("ball", [False, True])
def test_the_force_is_the_gradient_of_the_energy_and_K_its_derivative(ball, turn):
    """On both sides of the angle at which the formula changes, and up to half a turn."""
    rest = REST[3:] if ball else REST
    scene = scene_of(pin.JointModelSpherical() if ball else None, (7.0, rest))
    law, model = scene.forces[0], scene.model
    axis = np.array([0.6, 0.0, -0.8])
    way = turn * axis if ball else np.array([0.2, 0.4, -0.3, *(turn * axis)])
    q = pin.integrate(model, rest, way)
    tau, K = added(law, q)
    np.testing.assert_allclose(tau[-3:], -7.0 * turn * axis, atol=1e-14 if turn < 3.0 else 1e-12)
    assert law.energy(q) == pytest.approx(3.5 * (turn**2 + (0.0 if ball else np.sum((q[:3] - REST[:3]) ** 2))))
    for j, e in enumerate(STEP * np.eye(model.nv)):
        plus, minus = (pin.integrate(model, q, s * e) for s in (1, -1))
        np.testing.assert_allclose(K[:, j], (added(law, plus)[0] - added(law, minus)[0]) / (2 * STEP), atol=1e-6)
        assert tau[j] == pytest.approx(-(law.energy(plus) - law.energy(minus)) / (2 * STEP), abs=1e-7)


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
def test_the_engine_has_the_same_numbers():
    system = System(nga.Scene.from_mjcf(FILE))
    model, engine, rng = system.model, _engine(system), np.random.default_rng(0)
    found = NativeForces(system, engine, np.full(model.nv, -1)).loads(system, NO_ACTUATION)
    assert not callable(found)
    for size in np.geomspace(1e-8, 3.0, 40):
        q = pin.integrate(model, pin.neutral(model), size * rng.normal(size=model.nv))
        v = rng.normal(size=model.nv)
        for own, numpy in zip(engine.loads(found, 0.0, q, v), system.loads_there(0.0, q, v, NO_ACTUATION), strict=True):
            assert np.abs(own - numpy).max() <= 1e-13 * max(1.0, np.abs(numpy).max())


def test_forces_are_those_of_mujoco():
    """qfrc_passive, springs and damping, at random states; `quantities` of test_against_mujoco have the whole."""
    scene, rng = nga.Scene.from_mjcf(FILE), np.random.default_rng(1)
    m, _ = compiled(FILE)
    d, system, model = mujoco.MjData(m), System(scene), scene.model
    for _ in range(20):
        q, v = pin.integrate(model, pin.neutral(model), 2.0 * rng.normal(size=model.nv)), rng.normal(size=model.nv)
        d.qpos[:], d.qvel[:] = nga.q_to_mujoco(model, q), nga.v_to_mujoco(model, q, v)
        mujoco.mj_forward(m, d)
        ours = -model.damping * v
        for force in system.forces:
            force.add_to(0.0, q, v, ours, np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv)))
        assert np.abs(nga.v_to_mujoco(model, q, ours) - d.qfrc_passive).max() <= 1e-12 * np.abs(d.qfrc_passive).max()


def test_a_ball_on_a_spring_swings_by_its_frequency():
    """About an axis of equal moments theta(t) = theta0 cos(sqrt(k / I) t), about the shorter way through the rest."""
    scene = scene_of(pin.JointModelSpherical(), (0.5, REST[3:]), inertia=(0.02, 0.02, 0.02))
    start = 2.8 * np.array([0.0, 0.6, 0.8])
    run = nga.simulate(scene, pin.integrate(scene.model, REST[3:], start), t_end=3.0, rtol=1e-10, atol=1e-12)
    wanted = pin.integrate(scene.model, REST[3:], start * np.cos(np.sqrt(0.5 / 0.02) * 3.0))
    assert np.abs(pin.difference(scene.model, run.q[-1], wanted)).max() < 1e-8


def test_energy_is_kept_and_counted():
    scene = scene_of(spring=(40.0, REST))
    start = pin.integrate(scene.model, REST, np.array([0.1, -0.2, 0.3, 1.0, 0.5, -0.7]))
    run = nga.simulate(scene, start, np.array([0.0, 1.0, 0.0, 2.0, 0.0, -3.0]), t_end=0.5, rtol=1e-10)
    energy = run.energy
    assert energy.conserved and run.audit().ok
    assert energy.elastic[0] == pytest.approx(scene.forces[0].energy(start)) and np.ptp(energy.elastic) > 5.0
    assert np.ptp(energy.total) < 1e-8 * energy.total[0]


def test_it_goes_along_with_its_model_and_through_pickle():
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing of the file is left out
        part = nga.Scene.from_mjcf(FILE)
    scene = nga.Scene()
    scene.add_model(part, "a", pin.SE3(np.eye(3), np.array([1.0, 2.0, 0.0])))
    scene.add_model(part, "b")
    scene = pickle.loads(pickle.dumps(scene))
    assert [f.joint for f in scene.forces if isinstance(f, nga.PoseSpring)] == [
        f"{p}{name}" for p in ("a/", "b/") for name in ("root", "neck", "hook")
    ]
    system, one = System(scene), System(part)
    q = pin.integrate(part.model, pin.neutral(part.model), np.linspace(-0.4, 0.5, part.model.nv))
    v = np.zeros(part.model.nv)
    alone = one.loads_there(0.0, q, v, NO_ACTUATION)[0]
    found = system.loads_there(0.0, np.concatenate((q, q)), np.concatenate((v, v)), NO_ACTUATION)[0]
    np.testing.assert_array_equal(found, np.concatenate((alone, alone)))


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: nga.PoseSpring("elbow", 1.0), "no joint named 'elbow'"),
        (lambda: nga.PoseSpring("body", -1.0), "not negative"),
        (lambda: nga.PoseSpring("body", np.nan), "finite"),
        (lambda: nga.PoseSpring("body", 1.0, [0.0, 0.0, 0.0, 1.0]), "rest has shape"),
        (lambda: nga.PoseSpring("body", 1.0, np.zeros(7)), "expected a unit quaternion"),
        (lambda: nga.PoseSpring("body", 1.0, [np.inf] * 7), "finite"),
    ],
)
def test_what_does_not_fit_is_refused(make, message):
    with pytest.raises(nga.SceneError, match=message):
        scene_of().add_force(make())


def test_a_hinge_takes_a_joint_spring():
    with pytest.raises(nga.SceneError, match="expected a ball joint .*, not a JointModelRX, which takes a JointSpring"):
        scene_of(pin.JointModelRX()).add_force(nga.PoseSpring("body", 1.0))
