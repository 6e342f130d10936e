"""No valid run is accused, whatever law acts: every law of contact, drive and controller, with dt and with rtol."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

BELT = (0.5, 0.0, 0.0)
LAWS = {
    "restitution of Newton": {"mu": 0.3, "e_N": 0.6},
    "tangential restitution": {"mu": 0.3, "e_N": 0.4, "e_F": 0.5},
    "restitution of Poisson": {"mu": 0.3, "e_N": nga.Restitution(0.6, "poisson")},
    "restitution of Stronge": {"mu": 0.3, "e_N": nga.Restitution(0.6, "stronge")},
    "restitution by speed": {"mu": 0.3, "e_N": lambda speed: 1.0 / (1.0 + speed)},
    "spring and damper": {"mu": 0.3, "compliance": nga.KelvinVoigt(2e3, 5.0)},
    "Hunt and Crossley": {"mu": 0.3, "compliance": nga.HuntCrossley(1e5, 0.5)},
    "rolling resistance": {"mu": 0.5, "rolling_resistance": 5e-3},
    "drilling friction": {"mu": 0.3, "contact_radius": 0.02},
    "ellipse": {"mu": nga.FrictionEllipse(0.2, 0.5)},
    "Stribeck": {"mu": nga.Stribeck(0.4, 0.2, 0.1)},
    "belt": {"mu": 0.4, "e_N": 0.4, "surface_velocity": BELT},
    "belt with a spring": {"mu": 0.4, "compliance": nga.KelvinVoigt(2e3, 5.0), "surface_velocity": BELT},
    "belt with rolling resistance": {"mu": 0.4, "rolling_resistance": 5e-3, "surface_velocity": BELT},
    "adhesion": {"mu": 0.3, "adhesion": 2.0},
}


QUICK = {"restitution of Stronge", "Hunt and Crossley", "rolling resistance", "belt", "adhesion"}
ACCURACY = {"dt": {"dt": 1e-3}, "rtol": {"rtol": 1e-5}}


def case(*what, quick):
    """A case by its names, the last of them that of its accuracy."""
    return pytest.param(*what[:-1], ACCURACY[what[-1]], id="-".join(what), marks=() if quick else pytest.mark.long)


CASES = [
    case(shape, name, accuracy, quick=name in QUICK and (shape, accuracy) == ("ball", "dt"))
    for shape in ("ball", "box") for name in LAWS for accuracy in ACCURACY
]  # fmt: skip


def thrown(shape, **laws):
    """A ball or a box that is thrown on the ground, turning."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    solid = coal.Sphere(0.1) if shape == "ball" else coal.Box(0.2, 0.2, 0.2)
    inertia = pin.Inertia.FromSphere(1.0, 0.1) if shape == "ball" else pin.Inertia.FromBox(1.0, 0.2, 0.2, 0.2)
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("body", solid, parent="body")
    scene.add_contact("body", "ground", **laws)
    return scene


@pytest.mark.parametrize(("shape", "name", "accuracy"), CASES)
def test_law_of_contact(shape, name, accuracy):
    q0 = np.array([0.0, 0.0, 0.11 if shape == "ball" else 0.19, 0.1, 0.2, 0.05, 0.97])
    q0[3:] /= np.linalg.norm(q0[3:])
    run = nga.simulate(
        thrown(shape, **LAWS[name]), q0, np.array([0.6, 0.2, -0.3, 1.0, 2.0, 4.0]), t_end=0.15, **accuracy
    )
    assert run.audit().ok, str(run.audit())


def pendulum(**limits):
    """Two links with joints as a model says."""
    model, joint = pin.Model(), 0
    for i in range(2):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 if i else 0.0]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"joint_{i}")
        centre = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.15]))
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.5, 0.02, 0.02, 0.3), centre)
    for name, value in limits.items():
        setattr(model, name, np.full(2, value))
    return nga.Scene(model)


def sampled(t, q, v, forces, integral):
    return -8.0 * q - 0.4 * v - integral, integral + 0.01 * q


DRIVES = {
    "dry friction": ({"lowerDryFrictionLimit": -0.05, "upperDryFrictionLimit": 0.05}, None),
    "limits": ({"lowerPositionLimit": -0.3, "upperPositionLimit": 0.7}, None),
    "motors that saturate": ({"lowerEffortLimit": -0.5, "upperEffortLimit": 0.5}, nga.JointPD(np.zeros(2), 20.0, 0.5)),
    "sampled control": ({}, nga.SampledControl(sampled, rate=100.0, state=np.zeros(2))),
    "control": ({}, nga.Control(lambda t, q, v: 0.3 * np.sin(9.0 * t) * np.ones(2))),
    "springs": ({}, nga.JointSpring("joint_1", stiffness=5.0)),
}


@pytest.mark.parametrize(("name", "accuracy"), [case(n, a, quick=True) for n in DRIVES for a in ACCURACY])
def test_law_of_joints(name, accuracy):
    limits, force = DRIVES[name]
    scene = pendulum(**limits)
    if force is not None:
        scene.add_force(force)
    run = nga.simulate(scene, np.array([0.6, 0.4]), t_end=0.3, **accuracy)
    assert run.audit().ok, str(run.audit())


@pytest.mark.long
@pytest.mark.parametrize("accuracy", [{"dt": 2e-4}, {"rtol": 1e-6}], ids=["dt", "rtol"])
def test_pin_in_a_hole_that_is_shaken(accuracy):
    """The drive of the hole does work in impacts, and while the pin runs around in it."""
    model = pin.Model()
    bearing = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "bearing")
    model.appendBodyToJoint(bearing, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    turn = model.addJoint(z, pin.JointModelRY(), pin.SE3.Identity(), "pendulum")
    model.appendBodyToJoint(turn, pin.Inertia(1.0, np.array([0, 0, -0.5]), np.diag([0, 5e-2, 0])), pin.SE3.Identity())
    scene = nga.Scene(model)
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    scene.add_geometry("hole", nga.Hollow(coal.Cylinder(0.011, 0.1)), parent="bearing", placement=upright)
    scene.add_geometry("pin", coal.Sphere(0.01), parent="pendulum")
    scene.add_contact("pin", "hole", mu=0.0)
    shaken = nga.JointTrajectory(
        "bearing", lambda t: (0.02 * np.sin(20 * t), 0.4 * np.cos(20 * t), -8.0 * np.sin(20 * t))
    )
    scene.add_constraint(shaken)
    run = nga.simulate(scene, np.array([0.0, 0.0, -1e-3, 0.3]), np.array([0.4, 0.0, 0.0, 0.0]), t_end=0.12, **accuracy)
    assert len(run.impacts.t) and run.audit().ok, str(run.audit())


def rod_that_falls():
    """A rod whose middle is as low as its ends, with a sphere at every node."""
    scene = nga.Scene(pin.Model())
    section = nga.Section.round(5e-3, E=1e7, nu=0.3, density=1200)
    wire = scene.add_rod(nga.Rod(0.3, section, elements=2, damping=1e-3), "wire")
    scene.add_plane("ground")
    scene.add_contact("wire", "ground", mu=0.4)
    q0 = scene.q_ref
    q0[scene.slices[wire].q] = wire.configuration(pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.03])))
    return scene, q0, None


def welded_bodies():
    """Two boxes that a weld holds together come down on an edge."""
    model = pin.Model()
    for name in ("one", "two"):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for name in ("one", "two"):
        scene.add_geometry(name, coal.Box(0.1, 0.1, 0.1), parent=name)
        scene.add_contact(name, "ground", mu=0.4, e_N=0.3)
    beside = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    scene.add_constraint(nga.Weld("one", "two", placement_a=beside))
    turned = pin.SE3(pin.utils.rotate("y", 0.4), np.array([0.0, 0.0, 0.12]))
    q0 = np.concatenate([pin.SE3ToXYZQUAT(place) for place in (turned, turned * beside)])
    return scene, q0, np.zeros(12)


def motor_with_a_current():
    """A link whose motor has a current of its own."""
    scene = pendulum()
    scene.add_state(
        "current",
        lambda t, q, v, i: (2.0 - 3.0 * i - 0.2 * v[0]) / 0.05,
        start=0.5,
        force=lambda t, q, v, i: np.array([0.2 * float(i[0]), 0.0]),
    )
    return scene, np.array([0.6, 0.4]), np.zeros(2)


KINDS = {"rod": rod_that_falls, "weld": welded_bodies, "state of the first order": motor_with_a_current}


@pytest.mark.parametrize("accuracy", ACCURACY)
@pytest.mark.parametrize("name", KINDS)
def test_kinds_of_systems(name, accuracy):
    scene, q0, v0 = KINDS[name]()
    run = nga.simulate(scene, q0, v0, t_end=0.12, **ACCURACY[accuracy])
    assert run.audit().ok, str(run.audit())


@pytest.mark.long
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("shape", ["ball", "box"])
def test_random_throws(shape, name, number):
    """Every law from other starts, with the step and the accuracy that come next: 120 runs."""
    rng = np.random.default_rng([number, list(LAWS).index(name)])
    turn = rng.normal(size=4)
    q0 = np.concatenate(([0.0, 0.0, 0.11 if shape == "ball" else 0.19], turn / np.linalg.norm(turn)))
    v0 = rng.normal(size=6) * [0.5, 0.5, 0.5, 4.0, 4.0, 4.0]
    how = ({"dt": 2e-3}, {"rtol": 1e-3}, {"dt": 5e-4}, {"rtol": 1e-7})[number]
    run = nga.simulate(thrown(shape, **LAWS[name]), q0, v0, t_end=0.25, **how)
    assert run.audit().ok, str(run.audit())
