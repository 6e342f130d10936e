"""A contact that sticks stays where it is, to rounding, whatever the load on it does."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga

M, G, MU, PUSH, HALF, END = 1.0, 9.81, 0.8, 3.0, 0.025, 0.12
STILL = 1e-15  # what rounding moves a body of this size [m]


def push(t):
    """On and off every 25 ms, well inside of the cone of 7.8 N."""
    return PUSH if int(np.floor(t / HALF)) % 2 else 0.0


def on_a_plane(shape):
    """A body that rests on a plane, and its place: a point without rotation, or a box on its corners."""
    scene = nga.Scene()
    if shape == "point":
        model = pin.Model()
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "body")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(M, 0.05), pin.SE3.Identity())
        scene = nga.Scene(model)
        scene.add_geometry("foot", coal.Sphere(0.05), parent="body")
    else:
        scene.add_body("body", coal.Box(0.2, 0.2, 0.1), mass=M)
    scene.add_plane("plane")
    scene.add_contact("foot" if shape == "point" else "body", "plane", mu=MU)
    return scene, np.array([0.0, 0.0, 0.05]) if shape == "point" else scene.place_on("plane", scene.reference())


def stays(run, q0):
    """Nothing has moved along the plane, and no one says that it has slipped."""
    assert run.audit().ok is True
    assert np.abs(run.q[:, :2] - q0[:2]).max() <= STILL
    assert not [event for event in run.events if event.kind in ("slip", "stick") and "body" in event.contact]


@pytest.mark.parametrize("shape", ["point", "box"])
@pytest.mark.parametrize(
    ("dt", "declared"),
    [(4e-3, True), (5e-3, True), (4e-3, False)],
    ids=["breakpoints within steps", "breakpoints at their ends", "no breakpoints"],
)
def test_a_load_that_jumps_moves_nothing(shape, dt, declared):
    scene, q0 = on_a_plane(shape)
    # a moment earlier than declared by rounding: the force at the end of a part may be that of the next one
    early = 1e-11
    breakpoints = tuple(HALF * np.arange(1, round(END / HALF))) if declared else ()
    scene.add_force(nga.Wrench("body", force=lambda t: (push(t + early), 0.0, 0.0), breakpoints=breakpoints))
    stays(nga.simulate(scene, q0, t_end=END, dt=dt), q0)


def test_a_load_that_is_not_smooth_in_any_step_moves_nothing():
    scene, q0 = on_a_plane("box")
    force = np.random.default_rng(3).uniform(-PUSH, PUSH, 1000)
    scene.add_force(nga.Wrench("body", force=lambda t: (force[int(t / 1.3e-3)], force[-1 - int(t / 1.7e-3)], 0.0)))
    stays(nga.simulate(scene, q0, t_end=END, dt=4e-3), q0)


def test_a_force_that_is_held_and_changes_moves_nothing():
    scene, q0 = on_a_plane("point")
    simulator = nga.Simulator(scene, dt=4e-3, record=True)
    state = simulator.initial_state(q0)
    for i in range(40):
        state = simulator.step(state, tau=np.array([push(1.7e-2 * i), -push(2.3e-2 * i), 0.0]))
    assert np.abs(state.q[:2] - q0[:2]).max() <= STILL


def test_samples_within_steps_move_nothing():
    scene, q0 = on_a_plane("point")
    scene.add_force(nga.SampledControl(lambda t, q, v, forces: np.array([push(t), 0.0, 0.0]), rate=130.0))
    stays(nga.simulate(scene, q0, t_end=END, dt=4e-3), q0)


def test_impacts_and_ends_of_slip_in_the_same_step_move_nothing():
    scene, _ = on_a_plane("box")
    scene.add_body("ball", coal.Sphere(0.05), mass=0.5)
    scene.add_body("hit", coal.Sphere(0.05), mass=0.1)
    scene.add_body("slider", coal.Box(0.1, 0.1, 0.1), mass=0.2)
    scene.add_contact("ball", "plane", mu=0.3, e_N=0.5)
    scene.add_contact("slider", "plane", mu=0.2)
    scene.add_contact("hit", "body", mu=0.0, e_N=0.3)  # pushes the body down where it lands
    scene.add_force(nga.Wrench("body", force=lambda t: (push(t), 0.0, 0.0), breakpoints=(0.025, 0.05, 0.075)))
    q0, v0, model = scene.reference(), np.zeros(scene.model.nv), scene.model
    places = {"body": (0, 0, 0.05), "ball": (1, 0, 0.07), "hit": (0.03, 0.02, 0.17), "slider": (2, 0, 0.05)}
    for name, place in places.items():
        i = model.idx_qs[model.getJointId(name)]
        q0[i : i + 3] = place
    v0[model.idx_vs[model.getJointId("slider")]] = 0.1
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=4e-3)
    assert {event.kind for event in run.events} >= {"impact", "stick"}
    hit = (run.impacts.P_N > 0.0).any(axis=0)
    assert hit.sum() >= 2
    stays(run, q0)


def test_contacts_that_open_move_none_that_stick():
    """A box is pushed against a wall; in the middle of a step it is pulled away from it, and sticks."""
    scene, q0 = on_a_plane("box")
    scene.add_plane("wall", point=(0.1, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    scene.add_contact("body", "wall", mu=0.3)
    scene.add_force(nga.Wrench("body", force=lambda t: (12.0 if t < 0.0213 else -2.0, PUSH, 0.0)))
    run = nga.simulate(scene, q0, t_end=0.05, dt=4e-3)
    # forces of so many corners are not unique: some may go on to press on each other
    assert ((run.la_N[3] > 1.0) & (run.la_N[-1] < 1e-9)).any()
    stays(run, q0)


def test_slip_between_two_rests_is_of_second_order():
    """Under F sin(w t) a point slips from where F sin(w t) = mu m g until its velocity, in closed form, vanishes."""
    F, w, friction = 12.0, 10.0, MU * M * G
    begins = np.arcsin(friction / F) / w

    def velocity(t):
        return F / w * (np.cos(w * begins) - np.cos(w * t)) - friction * (t - begins)

    ends = brentq(velocity, begins + 0.05, 0.4)
    slip = ends - begins
    way = F / w * (np.cos(w * begins) * slip - (np.sin(w * ends) - np.sin(w * begins)) / w) - friction * slip**2 / 2
    scene, q0 = on_a_plane("point")
    scene.add_force(nga.Wrench("body", force=lambda t: (F * np.sin(w * t), 0.0, 0.0)))
    runs = [nga.simulate(scene, q0, t_end=ends + 0.02, dt=dt) for dt in (8e-3, 4e-3, 2e-3)]
    errors = np.array([abs(run.q[-1, 0] - way) for run in runs])
    assert errors[0] < 0.01 * way
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.7
    assert [event.kind for event in runs[0].events] == ["slip", "stick"]
