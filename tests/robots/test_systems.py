"""Every system loads, is the one of the paper, and starts without penetration."""

import builtins
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

PLANAR_BALLS = ("rotating_ball", "ball_in_corner", "ball_in_cylinder")
LEGGED = {"quadruped": 12.0, "anymal": 30.475397, "solo12": 2.5000028, "go2": 16.085}


@pytest.fixture(scope="module", params=robots.names())
def system(request):
    return robots.load(request.param)


def placements(scene, q):
    data, placed = scene.model.createData(), pin.GeometryData(scene.collision_model)
    pin.updateGeometryPlacements(scene.model, data, scene.collision_model, placed, q)
    return placed.oMg


def gaps(scene, q):
    """Distance of the declared pairs of a sphere and a plane, by hand [m]."""
    placed, found = placements(scene, q), {}
    for pair in scene.contacts:
        a, b = scene.geometry(pair.geometry_a), scene.geometry(pair.geometry_b)
        pose_a, pose_b = (placed[scene.collision_model.getGeometryId(g.name)] for g in (a, b))
        n = pose_b.rotation @ b.geometry.n
        found[a.name, b.name] = n @ (pose_a.translation - pose_b.translation) - a.geometry.radius
    return found


def test_names_are_the_modules():
    folder = Path(robots.__file__).parent
    assert robots.names() == tuple(sorted(path.stem for path in folder.glob("[!_]*.py")))


def test_unknown_system_and_parameter():
    with pytest.raises(nga.SceneError, match="did you mean 'solo12'"):
        robots.load("solo")
    with pytest.raises(nga.SceneError, match="no parameter 'friction'; it takes omega, e_N, mu"):
        robots.load("rotating_ball", friction=0.3)


def test_every_system_is_complete(system):
    scene, q0, v0 = system
    assert q0.shape == scene.q_ref.shape
    assert v0.shape == (scene.model.nv + sum(beam.nv for beam in scene.beams.values()),)
    assert pin.isNormalized(scene.model, q0[: scene.model.nq], 1e-12)
    drawn = [shape for model in (scene.visual_model, scene.collision_model) if model for shape in model.geometryObjects]
    assert scene.beams or any(shape.parentJoint > 0 for shape in drawn)
    for inertia in scene.model.inertias[1:]:
        x, y, z = np.linalg.eigvalsh(inertia.inertia)
        assert x >= 0
        assert z <= x + y + 1e-12


def test_every_load_gives_its_own_scene():
    (a, q_a, _), (b, q_b, _) = robots.load("rotating_ball"), robots.load("rotating_ball", height=2.0)
    assert a.model is not b.model
    assert (q_a[1], q_b[1]) == (1.0, 2.0)


@pytest.mark.parametrize("name", PLANAR_BALLS)
def test_planar_ball_is_the_papers(name):
    scene, q0, v0 = robots.load(name)
    model = scene.model
    assert (model.name, model.nq) == (name, 4)
    assert np.diag(pin.crba(model, model.createData(), q0)) == pytest.approx([1, 1, 0.4 * 0.1**2])
    assert model.gravity.linear == pytest.approx([0, 0, -9.81])
    assert scene.geometry("ball_0").geometry.radius == 0.1
    assert v0.tolist() == [0, 0, 50 if name == "rotating_ball" else 0]
    # no joint limits
    assert (model.upperPositionLimit[:2] == np.finfo(float).max).all()
    assert (model.lowerPositionLimit[:2] == -np.finfo(float).max).all()


def test_planar_ball_turns_as_in_the_paper():
    """gamma_F = u_x + R u_phi (148)."""
    scene, q0, _ = robots.load("rotating_ball")
    data, v = scene.model.createData(), np.array([2.0, 3.0, 5.0])
    pin.forwardKinematics(scene.model, data, q0, v)
    body = pin.getVelocity(scene.model, data, 3, pin.LOCAL_WORLD_ALIGNED)
    lowest = body.linear + np.cross(body.angular, [0, 0, -0.1])
    assert lowest == pytest.approx([2.0 + 0.1 * 5.0, 0, 3.0])


def test_gaps_of_the_paper():
    scene, q0, _ = robots.load("rotating_ball")
    assert gaps(scene, q0) == pytest.approx({("ball_0", "ground"): 0.9})
    # (149)
    scene, q0, _ = robots.load("ball_in_corner", alpha=0.5, beta=0.7)
    right = 0.5 * np.sin(0.5) + np.cos(0.5) - 0.1
    left = -0.5 * np.sin(0.7) + np.cos(0.7) - 0.1
    assert gaps(scene, q0) == pytest.approx({("ball_0", "right"): right, ("ball_0", "left"): left})
    # (152): the tip is on the ground
    scene, q0, v0 = robots.load("painleve_rod")
    assert gaps(scene, q0) == {("tip", "ground"): 0.0}
    assert v0.tolist() == [30, 0, 0]
    # (156): z_0 leaves 1.25e-8 m
    scene, q0, _ = robots.load("tippe_top")
    found = gaps(scene, q0)
    assert found["top_0", "ground"] == pytest.approx(1.25e-8, rel=1e-2)
    assert found["top_1", "ground"] == pytest.approx(1.2015e-2 + 1.6e-2 * np.cos(0.1) - 5e-3)


def test_laws_of_the_paper():
    def laws(name, **parameters):
        return [p.law for p in robots.load(name, **parameters)[0].contacts]

    assert laws("rotating_ball", e_N=0.5) == [nga.ContactLaw(mu=0.2, e_N=0.5)]
    assert laws("ball_in_corner") == [nga.ContactLaw(mu=0.3, e_N=0.5), nga.ContactLaw(mu=0.3, e_N=0.0)]
    assert laws("ball_in_cylinder") == [nga.ContactLaw(mu=0.1)]
    assert laws("painleve_rod") == [nga.ContactLaw(mu=5 / 3)]
    assert laws("tippe_top") == 2 * [nga.ContactLaw(mu=0.3, contact_radius=5e-4)]


def test_ball_touches_the_inside_of_the_tube():
    scene, q0, _ = robots.load("ball_in_cylinder")
    placed = placements(scene, q0)
    ball, tube = (placed[scene.collision_model.getGeometryId(n)] for n in ("ball_0", "tube"))
    assert scene.hollow == {"tube"}
    assert isinstance(scene.geometry("tube").geometry, coal.Cylinder)
    # the axis of the tube is perpendicular to the plane of motion
    assert np.abs(tube.rotation[:, 2]) == pytest.approx([0, 1, 0], abs=1e-15)
    assert tube.translation == pytest.approx([0, 0, 1])
    assert ball.translation - tube.translation == pytest.approx([-0.9, 0, 0], abs=1e-15)


def test_painleve_rod_is_the_papers():
    scene, q0, _ = robots.load("painleve_rod")
    model, data = scene.model, scene.model.createData()
    assert np.diag(pin.crba(model, data, q0)) == pytest.approx([1, 1, 1 / 3])
    assert model.gravity.linear == pytest.approx([0, 0, -10])
    # gamma_F = u_x - l u_phi sin phi, g_N_dot = u_y - l u_phi cos phi
    v, phi = np.array([2.0, 3.0, 5.0]), np.radians(31)
    pin.forwardKinematics(model, data, q0, v)
    rod = pin.getVelocity(model, data, 3, pin.LOCAL_WORLD_ALIGNED)
    tip = rod.linear + np.cross(rod.angular, [np.cos(phi), 0, -np.sin(phi)])
    assert tip == pytest.approx([2 - 5 * np.sin(phi), 0, 3 - 5 * np.cos(phi)])


def test_tippe_top_is_the_papers():
    scene, q0, v0 = robots.load("tippe_top")
    inertia = scene.model.inertias[2]
    assert inertia.mass == 6e-3
    assert inertia.lever.tolist() == [0, 0, 0]
    assert np.diag(inertia.inertia) == pytest.approx([8e-7, 8e-7, 7e-7])
    assert [scene.geometry(n).geometry.radius for n in ("top_0", "top_1")] == [1.5e-2, 5e-3]
    assert [scene.geometry(n).placement.translation[2] for n in ("top_0", "top_1")] == [3e-3, 1.6e-2]
    assert v0.tolist() == [0, 0, 0, 0, 0, 180]
    inclination = robots.tippe_top.inclination
    assert inclination(q0) == pytest.approx(0.1)
    turned = np.stack([q0, [0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, np.sin(0.4), np.cos(0.4)]])
    assert inclination(turned) == pytest.approx([0.1, np.pi, 0])


@pytest.mark.parametrize("name", LEGGED)
def test_legged_robot_hangs_above_the_ground(name):
    scene, q0, v0 = robots.load(name, height=0.07)
    model = scene.model
    assert pin.computeTotalMass(model) == pytest.approx(LEGGED[name], rel=1e-6)
    assert (model.nq, model.nv) == (19, 18)
    feet = [pair.geometry_a for pair in scene.contacts]
    assert len(feet) == 4
    assert not v0.any()
    # the lowest point of the feet, found by looking at all of their points
    placed, lowest = placements(scene, q0), []
    for foot in feet:
        shape, pose = scene.geometry(foot).geometry, placed[scene.collision_model.getGeometryId(foot)]
        if isinstance(shape, coal.Sphere):
            lowest.append(pose.translation[2] - shape.radius)
        else:
            lowest.append((shape.vertices() @ pose.rotation[2]).min() + pose.translation[2])
    assert min(lowest) == pytest.approx(0.07, abs=1e-12)
    # all four stand, and nothing else is as low
    assert max(lowest) < 0.07 + 5e-3
    assert (q0[7:] >= model.lowerPositionLimit[7:]).all()
    assert (q0[7:] <= model.upperPositionLimit[7:]).all()
    (hold,) = scene.forces
    assert isinstance(hold, nga.JointPD)
    assert not hold.kp[:6].any()
    assert (hold.kp[6:] > 0).all()


def test_quadruped_has_its_weight_above_its_feet():
    scene, q0, _ = robots.load("quadruped")
    centre = pin.centerOfMass(scene.model, scene.model.createData(), q0)
    feet = [
        placements(scene, q0)[scene.collision_model.getGeometryId(p.geometry_a)].translation for p in scene.contacts
    ]
    assert centre[:2] == pytest.approx(np.mean(feet, axis=0)[:2], abs=5e-3)


def test_arm_swings_freely_unless_held():
    free, q0, _ = robots.load("arm")
    held, _, _ = robots.load("arm", kp=100.0, kd=10.0)
    assert not free.forces
    assert isinstance(held.forces[0], nga.JointPD)
    assert free.model.nq == free.model.nv == 7
    assert pin.computeTotalMass(free.model) == pytest.approx(14.0)
    assert (np.abs(q0) < free.model.upperPositionLimit).all()


def test_missing_descriptions_name_the_package(monkeypatch):
    original = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("example_robot_data"):
            raise ImportError(name)
        return original(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(nga.SceneError, match="pip install example-robot-data-loaders"):
        robots.load("solo12")
