"""Derivatives by parameters against central differences of whole runs."""

import numpy as np
import pinocchio as pin
import pytest
from central_differences import EXACT, agreed, by_parameters, end
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.errors import SceneError
from ngalpha_pin.sensitivities.parameters import parameters_of, scene_with
from ngalpha_pin.system.system import System


def same_as_differences(scene, q0, v0, names, tolerance=1e-6, **how):
    """The derivatives along two random directions of the parameters are those of differences; the run."""
    how = {"method": EXACT, **how}
    run = nga.simulate(scene, q0, v0, sensitivities=nga.Sensitivities(parameters=names), **how)
    values = np.concatenate([p.values for p in parameters_of(scene, names)])
    along = np.random.default_rng(0).normal(size=(len(values), 2)) * np.maximum(np.abs(values), 1e-2)[:, None]
    expected, allowed = agreed(lambda h: by_parameters(scene, q0, v0, names, along, h, **how), tolerance)
    np.testing.assert_allclose(end(run) @ along, expected, rtol=0, atol=allowed)
    return run


def tilted_quadruped():
    scene, q0, v0 = nga.robots.load("quadruped", height=0.03)
    turn = np.zeros(18)
    turn[3:6] = 0.05, 0.12, 0.03
    v0 = v0.copy()
    v0[:3] = 1.0, 0.2, -0.5
    return scene, System(scene).integrate(q0, turn), v0


def test_mu_and_restitution_of_a_ball_that_spins():
    scene, q0, v0 = nga.robots.load("rotating_ball", omega=50.0, e_N=0.5, e_F=0.2, height=0.5)
    names = ["mu[ball_0]", "e_N[*]", "e_F[ball_0]", "mass[ball]", "placement[ball_0]", "placement[ground]"]
    run = same_as_differences(scene, q0, v0, names, t_end=0.5, dt=1e-2)
    assert {"placement[ground] x", "placement[ball_0] y"} <= set(run.derivatives.vanishing)


def test_gains_and_inertias_of_an_arm():
    scene, q0, v0 = nga.robots.load("arm", kp=80.0, kd=3.0)
    q0 = q0 + 0.1  # away from where it is held
    same_as_differences(scene, q0, v0, ["kp", "kd", "mass[joint_2]", "inertia[joint_5]"], t_end=0.05, dt=5e-3)


@pytest.mark.long
def test_masses_gains_and_placements_of_a_robot_that_lands():
    names = ["mu", "kp", "kd", "mass[base]", "inertia[FL_hip_pitch]", "placement[FR_foot_0]"]
    run = same_as_differences(*tilted_quadruped(), names, t_end=0.04, dt=2e-3)
    assert "impact" in run.derivatives.status


def test_a_scene_with_other_values_has_them():
    scene, _, _ = nga.robots.load("quadruped")
    names = ["mu", "kp", "kd", "mass[base]", "inertia[FL_hip_pitch]", "placement[FR_foot_0]"]
    found = parameters_of(scene, names)
    values = np.concatenate([p.values for p in found]) * 1.25
    again = np.concatenate([p.values for p in parameters_of(scene_with(scene, found, values), names)])
    np.testing.assert_allclose(again, values, rtol=1e-14)
    np.testing.assert_array_equal(np.concatenate([p.values for p in parameters_of(scene, names)]) * 1.25, values)


@pytest.mark.parametrize(
    ("names", "said"),
    (
        (["mu[nothing]"], "nothing"),
        (["mass[ghost]"], "ghost"),
        (["mass[universe]"], "fixed to the world"),
        (["kp"], "no JointPD"),
        (["stiffness"], "parameters"),
        (["mass"], "parameters"),
        (["kp[x]"], "parameters"),
        (["placement[ghost]"], "ghost"),
        (["mu", "mu"], "twice"),
        ("mu", "list of names"),
    ),
)
def test_what_is_no_parameter_is_named_before_the_run(names, said):
    with pytest.raises(SceneError, match=said):
        nga.simulate(
            balls(1, mu=0.3), np.array([0.0, 0.0, 0.3]), t_end=1e9, dt=1e-3,
            sensitivities=nga.Sensitivities(parameters=names),
        )  # fmt: skip


def test_coefficients_without_a_derivative_are_named():
    with pytest.raises(SceneError, match="zero"):
        parameters_of(balls(1, mu=0.0), ["mu"])
    scene = balls(2, mu=0.3)
    with pytest.raises(SceneError, match=r"different values \(0.3, 0.4\)"):
        parameters_of(scene.varied(mu={"g1": 0.4}), ["mu"])
    assert parameters_of(scene.varied(mu={"g1": 0.4}), ["mu[g1]"])[0].values[0] == 0.4
    with pytest.raises(SceneError, match="curve"):
        parameters_of(balls(1, mu=nga.Stribeck(0.2, 0.4, 0.1)), ["mu"])


def test_placements_of_round_surfaces_and_features_are_refused():
    scene, q0, _ = nga.robots.load("ball_in_cylinder")
    names = [g.name for g in scene.collision_model.geometryObjects]
    with pytest.raises(SceneError, match="placement"):
        nga.simulate(
            scene, q0, t_end=0.1, dt=1e-3, sensitivities=nga.Sensitivities(parameters=[f"placement[{names[0]}]"])
        )


def test_a_mass_of_a_model_with_one_degree_of_freedom():
    """A push of 3 N takes 2 kg to x = F t^2 / 2 m, of which the derivative by m is -x / m."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    roll = nga.Rollout(nga.Scene(model), np.zeros(1), np.zeros(1), dt=0.01, n=10, parameters=["mass[cart]"])
    push = np.full((10, 1), 3.0)
    jacobian = roll.jac_of(lambda run: run.q[:, 0], push)(roll.values)
    x = roll(push, roll.values).q[:, 0]
    np.testing.assert_allclose(jacobian[:, 0], -x / 2.0, rtol=1e-9, atol=1e-12)
    assert x[-1] == pytest.approx(3.0 * 0.1**2 / 4.0)
