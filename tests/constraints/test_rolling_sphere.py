"""Spheres that roll without slip: down an incline, in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.rolling_sphere import spheres


def ball_on(tilt, shape):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("ball", shape, parent="ball")
    scene.add_plane("slope", normal=(np.sin(tilt), 0.0, np.cos(tilt)))
    scene.add_constraint(nga.RollingSphere("ball", "slope"))
    return scene


def test_rolls_down_with_five_sevenths():
    tilt, t = 0.3, 1.0
    scene = ball_on(tilt, coal.Sphere(0.1))
    normal, down = np.array([np.sin(tilt), 0.0, np.cos(tilt)]), np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    q0 = pin.neutral(scene.model)
    q0[:3] = 0.1 * normal
    way, error = 0.5 * (5 / 7) * 9.81 * np.sin(tilt) * t**2, []
    for dt in (4e-3, 2e-3):  # the velocity turns in the frame of the ball, so that the way is not exact
        run = nga.simulate(scene, q0, t_end=t, dt=dt)
        error.append(np.linalg.norm(run.q[-1, :3] - 0.1 * normal - way * down))
        assert run.q[-1, :3] @ normal == pytest.approx(0.1, abs=1e-11)
        assert run.v[-1, 4] == pytest.approx(5 / 7 * 9.81 * np.sin(tilt) * t / 0.1, rel=2e-3)
    assert error[1] < 1e-3 and 3.5 < error[0] / error[1] < 4.5


def test_only_spheres_roll():
    scene = ball_on(0.0, coal.Sphere(0.1))
    assert spheres(scene, scene.model).names_g == (scene.constraints[0].name,)
    box = ball_on(0.0, coal.Box(0.1, 0.1, 0.1))
    with pytest.raises(nga.SceneError, match="must be a coal.Sphere"):
        spheres(box, box.model)
    box.constraints.clear()
    assert spheres(box, box.model) is None
