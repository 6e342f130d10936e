"""Who touches whom: patterns, neighbours, SRDF, overlaps at the start, surfaces with a combination rule."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import chain, free_flyers

import ngalpha_pin as nga
from ngalpha_pin.collision.broad_phase import Proximity
from ngalpha_pin.system.system import System


def names(scene):
    return {frozenset((p.geometry_a, p.geometry_b)) for p in scene.contacts}


def test_everything_against_everything_but_neighbours():
    scene = chain()
    scene.add_plane("ground", point=(0, 0, -3))
    scene.add_plane("wall", point=(-3, 0, 0), normal=(1, 0, 0))
    scene.add_contact("*", "*", mu=0.3)
    links = {("link_0", "link_2"), ("link_0", "link_3"), ("link_1", "link_3")}
    world = {(f"link_{i}", side) for i in range(4) for side in ("ground", "wall")}
    assert names(scene) == {frozenset(p) for p in links | world}


def test_what_is_named_keeps_its_law():
    scene = chain()
    scene.add_contact("link_0", "link_3", mu=0.9)
    scene.add_contact("*", "*", mu=0.1)
    assert [p.law.mu for p in scene.contacts if p.key == frozenset(("link_0", "link_3"))] == [0.9]
    with pytest.raises(nga.SceneError, match="declared already"):
        scene.add_contact("link_0", "link_2")


def test_srdf_disables_pairs():
    scene = chain()
    for i in range(4):
        scene.model.addBodyFrame(f"body_{i}", scene.model.getJointId(f"hinge_{i}"), pin.SE3.Identity(), 0)
        geometry = scene.collision_model.geometryObjects[i]
        geometry.parentFrame = scene.model.getFrameId(f"body_{i}")
    scene.add_contact("*", "*")
    scene.disable_contacts('<robot name="chain"><disable_collisions link1="body_0" link2="body_2"/></robot>')
    assert names(scene) == {frozenset(("link_0", "link_3")), frozenset(("link_1", "link_3"))}
    with pytest.raises(nga.SceneError, match="no SRDF file"):
        scene.disable_contacts("nowhere.srdf")


def test_overlaps_at_the_start_are_left_out_with_a_warning():
    scene = chain(gap=0.08)
    scene.add_contact("*", "*")
    with pytest.warns(UserWarning, match="at q0 and are left out of the contacts: link_0/link_2, link_1/link_3"):
        run = nga.simulate(scene, np.zeros(4), t_end=0.01, dt=1e-3)
    assert run.success
    assert names(scene) == {frozenset(("link_0", "link_3"))}
    assert len(scene.left_out) == 2
    named = chain(gap=0.08)
    named.add_contact("link_0", "link_2")
    with pytest.raises(nga.Penetration, match="link_0/link_2"):
        nga.simulate(named, np.zeros(4), t_end=0.01, dt=1e-3)


def test_law_between_two_surfaces():
    scene = chain()
    scene.set_surface("link_*", mu=1.0, e_N=0.5)
    scene.set_surface("link_3", mu=0.25, e_N=0.2, contact_radius=0.01)
    pair = scene.add_contact("link_0", "link_3")[0]
    assert pair.law == nga.ContactLaw(0.5, 0.2, 0.0, 0.01)
    assert scene.add_contact("link_0", "link_2", mu=0.1)[0].law == nga.ContactLaw(0.1, 0.5)


def test_order_of_declaration_does_not_change_the_motion():
    runs = []
    for order in ((0, 1), (1, 0)):
        scene = chain(gap=0.35)
        scene.add_geometry("floor", coal.Box(4, 4, 1), placement=pin.SE3(np.eye(3), np.array([0, 0, -0.75])))
        pairs = [("link_*", "floor"), ("link_0", "link_2")]
        for i in order:
            scene.add_contact(*pairs[i], mu=0.4)
        run = nga.simulate(scene, np.array([-0.1, 0.05, 0.1, 0.1]), t_end=0.3, dt=5e-3)
        assert run.P_N.any()
        runs.append(run.q)
    assert np.abs(runs[0] - runs[1]).max() < 1e-9


def test_what_is_remembered_of_distances_never_changes_what_is_found():
    rng, n = np.random.default_rng(0), 6
    scene = nga.Scene(free_flyers(n))
    for i in range(n):
        shape = coal.Box(0.3, 0.2, 0.1) if i % 2 else coal.Cylinder(0.1, 0.3)
        placement = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        scene.add_geometry(f"body_{i}", shape, parent=f"body_{i}", placement=placement)
    scene.add_geometry("side", coal.Halfspace(np.array([0.0, 0.0, 1.0]), -1.0), parent="body_0")
    scene.add_plane("ground", point=(0, 0, -2))
    scene.add_contact("*", "*")
    system = System(scene)
    remembers, pairs = system.slots.proximity, system.slots.proximity.pairs
    q, v = pin.integrate(scene.model, pin.neutral(scene.model), 2 * rng.normal(size=6 * n)), rng.normal(size=6 * n)
    found = 0
    for _ in range(60):
        q, v = pin.integrate(scene.model, q, 2e-2 * v), v + 0.1 * rng.normal(size=6 * n)
        system.place_moving(q, v)
        for reach, ahead in ((0.0, 1e-2), (1e-10, 0.0), (0.05, 0.0)):
            fresh = Proximity(pairs)
            to = reach + ahead * fresh.speeds(system.data, np.arange(len(pairs)))
            near = [i for i in range(len(pairs)) if not fresh.look(system.data, i) > to[i]]
            assert remembers.within(system.data, reach, ahead).tolist() == near
            found += len(near)
    assert found > 20
