"""Contacts are compiled once for what is declared, and anew for whatever of it has changed."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.collision.shapes import Round
from ngalpha_pin.contact import compiled_contacts as of
from ngalpha_pin.system.system import System


@pytest.fixture
def compiled(monkeypatch):
    """A list that grows with every compilation."""
    found, compile_ = [], of._compile

    def counted(scene, *rest):
        found.append(scene)
        return compile_(scene, *rest)

    monkeypatch.setattr(of, "_compile", counted)
    monkeypatch.setattr(of, "_kept", type(of._kept)())
    return found


def corners(size=0.1):
    points = coal.StdVec_Vec3s()
    for sign in np.array(np.meshgrid(*3 * [[-1.0, 1.0]])).reshape(3, -1).T:
        points.append(size * sign)
    return coal.Convex.convexHull(points, True, "Qt")


def falling():
    """A body of several shapes over a plane, and one beside it."""
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0, placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3])))
    scene.add_body("box", coal.Box(0.2, 0.2, 0.2), mass=1.0, placement=pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.3])))
    scene.add_geometry("peg", corners(), parent="box", placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])))
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.3, e_N=0.5)
    scene.add_contact("ball", "peg", mu=0.1)
    return scene


def test_what_is_declared_is_compiled_once(compiled):
    scene, dt = falling(), 1e-3
    q0 = pin.neutral(scene.model)
    runs = [nga.simulate(scene, q0, t_end=0.02, dt=dt) for _ in range(2)]
    simulator = nga.Simulator(scene, dt)
    simulator.step(simulator.initial_state(q0))
    nga.simulate(falling(), q0, t_end=dt, dt=dt)  # read again
    nga.simulate_many(scene, q0, mass={"ball": [1.0, 2.0, 3.0]}, t_end=dt, dt=dt, threads=2)
    assert len(compiled) == 1
    assert all(np.array_equal(*pair) for pair in zip(*((run.q, run.v, run.la_N) for run in runs), strict=True))


def wider(scene):
    scene.geometry("ball").geometry.radius = 0.12


def moved(scene):
    scene.geometry("ball").placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01]))


def other_corners(scene):
    scene.geometry("peg").geometry = corners(0.11)


def other_joint(scene):
    scene.model.jointPlacements[1] = pin.SE3(np.eye(3), np.array([0.0, 0.5, 0.0]))


def other_law(scene):
    scene.contacts = scene.varied(mu=0.4).contacts


def welded(scene):
    scene.add_constraint(nga.Weld("ball", "box"))


CHANGES = (wider, moved, other_corners, other_joint, other_law, welded)


@pytest.mark.parametrize("change", CHANGES, ids=[change.__name__ for change in CHANGES])
def test_what_has_changed_is_compiled_anew(compiled, change):
    scene = falling()
    before = System(scene)
    change(scene)
    after = System(scene)
    assert len(compiled) == 2
    of._kept.clear()
    anew = System(scene)
    # what is found is what a scene that was never compiled has, and the first system has kept what it had
    for name in ("point", "radius", "mu", "e_N", "reach", "tangents", "n_F"):
        assert np.array_equal(getattr(after.contacts, name), getattr(anew.contacts, name))
    assert after.contacts.names == anew.contacts.names
    of._kept.clear()
    again = System(falling())
    for name in ("point", "radius", "mu"):
        assert np.array_equal(getattr(before.contacts, name), getattr(again.contacts, name))


def test_a_shape_that_is_changed_leaves_what_was_compiled(compiled):
    """A second scene of the old shape gets the table of the first one, whose shape is another one by now."""
    first, second = falling(), falling()
    System(first)
    wider(first)
    system = System(second)
    assert len(compiled) == 1
    pair = next(pair for pair in system.slots.pairs if "peg" in pair.name)
    assert {solid.r for solid in pair.solids if isinstance(solid, Round)} == {0.1}


def test_systems_do_not_share_what_they_write(compiled):
    scene = falling()
    a, b = System(scene), System(scene)
    index = np.arange(3)
    assert len(compiled) == 1
    assert a.contacts.subset(index) is not b.contacts.subset(index)
    assert not np.shares_memory(a.slots.packed, b.slots.packed)
    with pytest.raises(ValueError, match="read-only"):
        a.contacts.mu[:] = 0.0
    a.place(pin.neutral(scene.model))
    a.slots.proximity.within(a.data, 10.0)
    assert a.slots.proximity.native.seen and not b.slots.proximity.native.seen


def test_few_scenes_are_kept(compiled):
    scene = falling()
    for mu in np.linspace(0.1, 0.5, of.KEPT + 4):
        System(scene.varied(mu=float(mu)))
    assert len(of._kept) == of.KEPT
