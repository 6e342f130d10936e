"""Friction ellipses as they are declared, and which body of a pair carries their axes."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.friction_ellipse import placed_ellipse
from ngalpha_pin.system.system import System

TURN = pin.utils.rotate("z", 0.3)


def sledges(**ellipse):
    """Two balls on a plate that is turned, with one declaration for both."""
    scene = nga.Scene()
    scene.add_geometry("ice", coal.Halfspace(0, 0, 1, 0), placement=pin.SE3(TURN, np.zeros(3)))
    for i in range(2):
        placement = pin.SE3(np.eye(3), np.array([float(i), 0.0, 0.1]))
        scene.add_body(f"sledge_{i}", coal.Sphere(0.1), mass=1.0, placement=placement)
    scene.add_contact("sledge_*", "ice", mu=nga.FrictionEllipse(0.1, 0.4, **ellipse))
    return scene


def test_axes_of_the_second_geometry_or_of_a_frame():
    scene = sledges(axis=(2.0, 0.0, 0.0))
    table = System(scene).contacts
    np.testing.assert_array_equal(table.mu, [0.4, 0.4])
    for pair in scene.contacts:
        geometries = scene.geometry(pair.geometry_a), scene.geometry(pair.geometry_b)
        placed = placed_ellipse(scene, pair.law, geometries, geometries[0])
        assert not placed.on_b and placed.axis == pytest.approx(TURN[:, 0])
        assert placed.scale == pytest.approx([0.25, 1.0])
    assert placed_ellipse(scene, nga.ContactLaw(mu=0.3), geometries, geometries[0]) is None
    scene.contacts.clear()
    scene.add_contact("sledge_0", "ice", mu=nga.FrictionEllipse(0.4, 0.1, (0, 1, 0), "sledge_0"))
    geometries = scene.geometry("sledge_0"), scene.geometry("ice")
    placed = placed_ellipse(scene, scene.contacts[0].law, geometries, geometries[0])
    assert placed.on_b and placed.axis == pytest.approx([0.0, 1.0, 0.0]) and placed.scale == pytest.approx([1.0, 0.25])


def test_a_frame_of_another_body_is_refused():
    with pytest.raises(nga.SceneError, match="'sledge_0' is on neither of the bodies of 'sledge_1' and 'ice'"):
        sledges(frame="sledge_0")
    with pytest.raises(nga.UnknownName, match="slegde"):
        sledges(frame="slegde")
