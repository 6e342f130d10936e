import numpy as np
import pinocchio as pin
import pytest
from constraint_scenes import tree
from contact_scenes import pair_scene

import ngalpha_pin as nga
from ngalpha_pin.numerics.finite_differences import first_derivative
from ngalpha_pin.sensitivities import configuration
from ngalpha_pin.sensitivities.configuration import Geometry
from ngalpha_pin.system.system import System


def random_rows(scene, seed=1):
    """A compiled scene with a random motion, all contacts that are points, and forces of size one."""
    system, rng = System(scene), np.random.default_rng(seed)
    q = system.integrate(pin.neutral(scene.model), 0.1 * rng.normal(size=system.nv))
    v, a = rng.normal(size=(2, system.nv))
    sub = system.contacts.subset(np.arange(system.contacts.n_fixed))
    return system, sub, (q, v, a), rng.normal(size=(3, system.layout(sub).rows))


def both(scene, monkeypatch):
    """Derivatives as they are, and by differences alone."""
    system, sub, motion, forces = random_rows(scene)
    exact = Geometry(system).rows(0.0, sub, *motion, forces)
    monkeypatch.setattr(configuration, "_arms_of", lambda part, system: None)
    return exact, Geometry(system).rows(0.0, sub, *motion, forces)


@pytest.mark.parametrize("arrangement", ("fixed", "moving", "humanoid"))
def test_points_on_planes_change_as_their_differences_say(arrangement, monkeypatch):
    exact, by_differences = both(pair_scene("vertex-plane", arrangement, mu=0.5, contact_radius=0.1), monkeypatch)
    for name in ("forces", "acceleration"):
        x, y = (getattr(rows, name) for rows in (exact, by_differences))
        assert np.abs(x - y).max() <= 1e-11 * max(1.0, np.abs(y).max())


@pytest.mark.parametrize("name", ("four_bar", "bricard", "slider_crank"))
def test_joints_between_frames_change_as_their_differences_say(name, monkeypatch):
    exact, by_differences = both(nga.robots.load(name)[0], monkeypatch)
    for name in ("forces", "acceleration"):
        x, y = (getattr(rows, name) for rows in (exact, by_differences))
        assert np.abs(x - y).max() <= 1e-11 * max(1.0, np.abs(y).max())


def test_every_kind_of_row_between_frames_is_there(monkeypatch):
    scene = nga.Scene(tree())
    a, b = [frame.name for frame in scene.model.frames if frame.parentJoint > 0][:2]
    scene.add_constraint(nga.Distance(a, b, length=1.0))
    scene.add_constraint(nga.KnifeEdge(b, across=(0.6, 0.8, 0.0), relative_to=a))
    scene.add_constraint(nga.UniversalJoint(a, b))
    exact, by_differences = both(scene, monkeypatch)
    for name in ("forces", "acceleration"):
        x, y = (getattr(rows, name) for rows in (exact, by_differences))
        assert np.abs(x - y).max() <= 1e-10 * max(1.0, np.abs(y).max())


def test_momentum_changes_as_its_differences_say():
    system = System(nga.robots.load("quadruped")[0])
    rng = np.random.default_rng(0)
    q, u = system.integrate(pin.neutral(system.model), rng.normal(size=system.nv)), rng.normal(size=system.nv)
    found = Geometry(system).momentum(q, u)
    for j, e in enumerate(np.eye(system.nv)):
        column = first_derivative(lambda s, e=e: system.mass_matrix(system.integrate(q, s * e)) @ u, 1e-3)
        np.testing.assert_allclose(found[:, j], column, atol=1e-11)
