"""What is said of surfaces that move along themselves: checks, rates, and what a file keeps."""

import json
import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import free_flyers
from scipy.interpolate import CubicSpline

import ngalpha_pin as nga
from ngalpha_pin.scene.breakpoints import completed, declared
from ngalpha_pin.scene.serialization import scene_from_dict, scene_to_dict
from ngalpha_pin.scene.surface_velocity import moving_surface


def two_shapes():
    scene = nga.Scene(free_flyers(1))
    scene.add_plane("belt")
    scene.add_geometry("box", coal.Box(0.1, 0.1, 0.1), parent="body_0")
    return scene


@pytest.mark.parametrize(
    ("given", "words"),
    [((1.0, 2.0), "shape"), (lambda t: t, "direction"), (("a", 0, 0), "numbers"), ((np.nan, 0, 0), "finite")],
)
def test_what_cannot_be_used_is_said(given, words):
    with pytest.raises(nga.SceneError, match=words):
        two_shapes().add_contact("box", "belt", mu=0.3, surface_velocity=given)


@pytest.mark.parametrize(
    ("speed", "words"), [(lambda t: (t, 1.0, 2.0), "shape"), (lambda t: 1 / 0, "failed"), ("fast", "number")]
)
def test_speed_that_cannot_be_used_is_said(speed, words):
    with pytest.raises(nga.SceneError, match=f"speed.*{words}"):
        nga.SurfaceVelocity(linear=(1, 0, 0), speed=speed)


TIMES = np.linspace(0.0, 3.0, 200)


@pytest.mark.parametrize(
    "speed", [lambda t: np.sin(t), lambda t: (np.sin(t), np.cos(t)), CubicSpline(TIMES, np.sin(TIMES))]
)
def test_rate_of_the_speed(speed):
    assert nga.SurfaceVelocity(speed=speed).law()(0.7) == pytest.approx((np.sin(0.7), np.cos(0.7)), abs=1e-6)


def test_twist_in_the_joint():
    """The velocity of a point of the surface, in the axes of the joint that carries its geometry."""
    place = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.9])), np.array([0.2, 0.1, -0.4]))
    geometry = pin.GeometryObject("drum", 0, place, coal.Sphere(1.0))
    given = nga.SurfaceVelocity(linear=(1, 2, 3), angular=(0.4, -0.5, 0.6), centre=(0.7, 0.8, 0.9))
    found, x = moving_surface(given, geometry, False), np.array([0.3, 0.6, -0.2])
    w = np.array(given.linear) + np.cross(given.angular, x - np.array(given.centre))
    at = found.twist[:3] + np.cross(found.twist[3:], place.act(x))
    assert at == pytest.approx(place.rotation @ w, abs=1e-14)


def test_breakpoints_of_the_speed_are_found_and_declared():
    for given, known in (({"breakpoints": (0.3,)}, [0.3]), ({}, [])):
        scene = two_shapes()
        velocity = nga.SurfaceVelocity(linear=(1, 0, 0), speed=lambda t: float(t > 0.3), **given)
        scene.add_contact("box", "belt", mu=0.3, surface_velocity=velocity)
        assert declared(scene).tolist() == known
        assert declared(completed(scene, 0.0, 1.0)) == pytest.approx([0.3])
        assert declared(scene).tolist() == known  # the scene of the user is not changed


def test_surface_velocities_in_files_and_pickles():
    scene = two_shapes()
    scene.add_contact("box", "belt", mu=0.3, surface_velocity=nga.SurfaceVelocity(linear=(1, 0, 0), speed=np.sin))
    law = scene.contacts[0].law.surface_velocity
    again = pickle.loads(pickle.dumps(scene)).contacts[0].law.surface_velocity
    assert again == law
    times = np.linspace(0.0, 1.0, 11)
    kept = scene_from_dict(json.loads(json.dumps(scene_to_dict(scene, times)))).contacts[0].law.surface_velocity
    for t in (0.0, 0.23, 0.5, 1.0):
        assert kept.law()(t) == pytest.approx(law.law()(t), abs=1e-5 if t == 0.23 else 1e-9)
    with pytest.raises(nga.SceneError, match="beyond"):
        kept.law()(1.2)
