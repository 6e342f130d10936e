"""No valid run is accused: every kind of system, all methods, sampled times and continued runs."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

OWN, PAPER, MOREAU = nga.GeneralizedAlpha(), nga.GeneralizedAlpha(laws="paper"), nga.MoreauJean()
# end of the run and a step that resolves its motion [s]; Moreau's method takes half of the step
SYSTEMS = {
    "andrews": (0.01, 1e-4),
    "arm": (0.4, 2e-3),
    "ball_in_corner": (0.8, 2e-3),
    "ball_in_cylinder": (0.4, 2e-3),
    "belt": (0.3, 2e-3),
    "box_on_incline": (0.5, 2e-3),
    "bricard": (0.2, 2e-3),
    "cradle": (0.6, 2e-3),
    "four_bar": (0.3, 2e-3),
    "n_four_bar": (0.2, 2e-3),
    "painleve_rod": (0.6, 2e-3),
    "quadruped": (0.3, 2e-3),
    "rocking_block": (0.5, 2e-3),
    "rolling_disc": (0.2, 2e-3),
    "rotating_ball": (1.2, 2e-3),
    "slider_crank": (0.3, 1e-3),
    "tippe_top": (0.5, 2e-3),
    "turntable": (0.2, 2e-3),
    "wheel_in_shell": (0.3, 2e-3),
}
SLOW = {
    "anymal": (0.4, 2e-3),
    "balls_in_box": (0.2, 2e-3),
    "cantilever": (0.02, 5e-5),
    "go2": (0.4, 2e-3),
    "governor": (0.3, 2e-3),
    "hopper": (0.2, 2e-4),
    "solo12": (0.5, 1e-3),
}
# few seconds each
QUICK = {"ball_in_corner", "cradle", "box_on_incline", "quadruped", "rocking_block", "rotating_ball", "tippe_top"}
every = [
    pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in sorted({**SYSTEMS, **SLOW})
]  # fmt: skip
adaptive = [
    pytest.param(name, marks=() if name in QUICK - {"quadruped"} else pytest.mark.long) for name in sorted(SYSTEMS)
]
without_beams = [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in sorted(SYSTEMS)]


def accepted(run):
    audit = run.audit()
    assert audit.ok is True, str(audit)
    return run


def system(name):
    return robots.load(name), *{**SYSTEMS, **SLOW}[name]


@pytest.mark.parametrize("name", every)
def test_steps_of_the_method(name):
    (scene, q0, v0), t_end, dt = system(name)
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=OWN))


@pytest.mark.parametrize("name", without_beams)
def test_laws_of_the_paper(name):
    (scene, q0, v0), t_end, dt = system(name)
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=PAPER))


@pytest.mark.parametrize("name", without_beams)
def test_moreaus_method(name):
    (scene, q0, v0), t_end, dt = system(name)
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, dt=dt / 2, method=MOREAU))


@pytest.mark.parametrize("name", adaptive)
def test_chosen_accuracy_with_every_step_and_with_sampled_times(name):
    (scene, q0, v0), t_end, _ = system(name)
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, rtol=1e-5))
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, rtol=1e-5, t_eval=np.linspace(0.0, t_end, 17)))


@pytest.mark.parametrize("name", without_beams)
def test_continued_run(name):
    (scene, q0, v0), t_end, dt = system(name)
    half = nga.simulate(scene, q0, v0, t_end=t_end / 2, dt=dt)
    accepted(nga.simulate(scene, state=half.final_state, t_end=t_end, dt=dt))


@pytest.mark.parametrize("laws", ["second-order", "paper"])
@pytest.mark.parametrize("rho_inf", [0.0, 0.9, 1.0])
@pytest.mark.parametrize("name", ["arm", "rotating_ball", "tippe_top"])
def test_other_parameters(name, rho_inf, laws):
    (scene, q0, v0), t_end, dt = system(name)
    method = nga.GeneralizedAlpha(rho_inf=rho_inf, laws=laws)
    accepted(nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method))


def test_hanging_chain_at_rest():
    """What is at rest is not judged by the rounding of its velocities."""
    import pinocchio as pin

    model, joint = pin.Model(), 0
    for i in range(4):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 if i else 0.0]))
        joint = model.addJoint(joint, pin.JointModelSpherical(), place, f"link_{i}")
        centre = np.array([0.0, 0.0, -0.15])
        model.appendBodyToJoint(joint, pin.Inertia(0.2, centre, 1e-3 * np.eye(3)), pin.SE3.Identity())
    end = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3]))
    model.addFrame(pin.Frame("end", joint, end, pin.FrameType.OP_FRAME))
    scene = nga.Scene(model)
    scene.add_constraint(nga.PointJoint("end", "world", placement_b=pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.2]))))
    run = accepted(nga.simulate(scene, pin.neutral(model), t_end=0.1, dt=1e-3))
    assert np.abs(run.v).max() < 1e-8


def test_file_without_forces_and_constraints_is_not_accused(tmp_path):
    for name in ("four_bar", "quadruped"):
        (scene, q0, v0), _, dt = system(name)
        nga.simulate(scene, q0, v0, t_end=0.05, dt=dt).save(tmp_path / "run.npz")
        run = accepted(nga.Trajectory.load(tmp_path / "run.npz"))
        assert "not known" in str(run.audit())
