"""Rods in a scene: names, places, files, removal, contact, and motion against invariants and the planar beam."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.cli.info import _scene_rows as scene_rows
from ngalpha_pin.scene.strands import StrandForce
from ngalpha_pin.system.system import System

SOFT = nga.Section.round(1e-2, 1e7, 0.3, 1000)


def with_rod(elements=2, **parameters):
    scene = nga.Scene()
    rod = scene.add_rod(nga.Rod(1.0, SOFT, elements, **parameters), "wire")
    return scene, rod


def test_a_rod_has_bodies_frames_geometries_and_places():
    scene, rod = with_rod()
    place = scene.slices[rod]
    assert (place.q, place.v) == (slice(0, 35), slice(0, 30))
    assert scene.geometries("wire") == [f"wire {i}" for i in range(5)]
    assert np.array_equal(scene.q_ref[place.q], rod.configuration())
    assert scene.add_rod_point("tip", "wire", 1.0) == "tip"
    assert scene.frame("tip").parentJoint == scene.frame("wire 4").parentJoint
    mass = sum(inertia.mass for inertia in scene.model.inertias)
    assert mass == pytest.approx(rod.mass) == pytest.approx(1000 * np.pi * 1e-4)
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    assert scene.slices[rod] == place and len(scene.q_ref) == 42
    bare = nga.Scene()
    bare.add_rod(nga.Rod(1.0, SOFT, 1), "string", radius=0.0)
    assert not bare.declared_shapes.ngeoms


def test_info_counts_rods():
    scene, rod = with_rod()
    rows = dict(scene_rows(System(scene)))
    assert rows["rods"] == f"1 with 5 nodes, {rod.mass:.6g} kg"


def test_what_does_not_fit_is_said():
    scene, rod = with_rod()
    with pytest.raises(nga.SceneError, match="already"):
        scene.add_rod(rod, "other")
    with pytest.raises(nga.SceneError, match="already"):
        scene.add_rod(nga.Rod(1.0, SOFT), "wire")
    with pytest.raises(nga.SceneError, match=r"no node at xi = 0.3; the nearest is at 0.25"):
        scene.add_rod_point("here", "wire", 0.3)
    with pytest.raises(nga.UnknownName, match="rope"):
        scene.add_rod_point("here", "rope", 0.5)
    with pytest.raises(nga.SceneError, match="a node of it is gone"):
        scene.remove("wire 3")
    with pytest.raises(nga.UnknownName, match="wire"):
        scene.add_load(nga.LineLoad("rope", (0, 0, 1.0)))
    scene.add_rod_point("tip", "wire", 1.0)
    with pytest.raises(nga.SceneError, match="already"):
        scene.add_rod_point("tip", "wire", 0.0)
    scene.add_load(nga.LineLoad("wire", (0, 0, 1.0)))
    scene.remove("wire")
    assert not scene.rods and not scene.forces and not scene.model.nv and not scene.declared_shapes.ngeoms


def test_a_scene_with_a_rod_goes_to_another_process_and_into_a_file(tmp_path):
    scene, rod = with_rod(damping=1e-3)
    scene.add_load(nga.LineLoad("wire", (0.0, 1.0, 0.0)))
    q, v = scene.q_ref, 0.1 * np.sin(np.arange(rod.nv))
    run = nga.simulate(scene, q, v, t_end=2e-3, dt=5e-4)
    again = nga.simulate(pickle.loads(pickle.dumps(scene)), q, v, t_end=2e-3, dt=5e-4)
    assert np.array_equal(run.q, again.q) and np.array_equal(run.v, again.v)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    other = loaded.scene.rods["wire"]
    assert np.array_equal(other.reference, rod.reference)
    assert np.array_equal(other.section.stiffness, rod.section.stiffness) and other.damping == rod.damping
    assert loaded.audit().ok and run.audit().ok


def test_a_part_with_a_rod_has_its_prefix():
    part, rod = with_rod()
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_model(part, "left")
    assert list(scene.rods) == ["left/wire"] and scene.slices[scene.rods["left/wire"]].v.start == 6


def test_engine_and_python_have_the_same_forces():
    scene, rod = with_rod(damping=1e-3)
    system, n = System(scene), rod.nv
    rng = np.random.default_rng(0)
    q, v = pin.integrate(scene.model, scene.q_ref, 0.1 * rng.normal(size=n)), rng.normal(size=n)
    found = system.dynamics(0.0, q, v, np.zeros(n))
    law = next(force for force in scene.forces if isinstance(force, StrandForce))
    tau, K, D = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    law.add_to(0.0, q, v, tau, K, D)
    assert np.allclose(found.residual, pin.rnea(scene.model, scene.model.createData(), q, v, 0 * v) - tau, atol=1e-12)
    own, other = (nga.simulate(s, q, 0 * v, t_end=1e-3, dt=1e-4) for s in (scene, with_control(scene)))
    assert np.abs(own.q - other.q).max() < 1e-12  # the second one goes the way of Python


def with_control(scene):
    other = pickle.loads(pickle.dumps(scene))
    other.add_force(nga.Control(nothing))
    return other


def nothing(t, q, v):
    return np.zeros(30)


def momenta(model, q, v):
    data = model.createData()
    pin.computeCentroidalMomentum(model, data, q, v)
    h, centre = data.hg, data.com[0]
    return np.concatenate((h.linear, h.angular + np.cross(centre, h.linear)))


def test_a_free_rod_keeps_momentum_and_energy_to_the_order_of_the_step():
    scene, rod = with_rod()
    scene.model.gravity.linear[:] = 0.0
    q = rod.through(lambda xi: np.column_stack((xi, 0.02 * np.sin(3 * xi), 0.01 * xi**2)))
    v, drift, spin = rod.rigid_velocity(q, (1.0, 0.0, 0.5), (0.5, 3.0, 1.0)), [], []
    for dt in (4e-5, 2e-5):
        run = nga.simulate(scene, q, v, t_end=0.008, dt=dt)
        h = np.array([momenta(scene.model, *pair) for pair in zip(run.q[::20], run.v[::20], strict=True)])
        assert np.abs(h[:, :3] - h[0, :3]).max() < 1e-13
        spin.append(np.abs(h[:, 3:] - h[0, 3:]).max())
        drift.append(np.abs(run.energy.total - run.energy.total[0]).max())
    assert np.log2(drift[0] / drift[1]) > 1.9 and np.log2(spin[0] / spin[1]) > 1.9


def test_a_rod_in_the_plane_is_the_planar_beam():
    """A hinged soft rod that falls; the beam knows no shear, which is 1e-4 of the deflection here."""
    beam = nga.PlanarBeam(
        1.0, EA=SOFT.stiffness[0, 0], EI=SOFT.stiffness[4, 4], line_density=SOFT.line_density, elements=8
    )
    plane, tips = nga.Scene(), []
    plane.add_beam(beam, "wire")
    plane.add_beam_point("grip", "wire", 0.0)
    plane.add_constraint(nga.PointJoint("world", "grip"))
    run = nga.simulate(plane, plane.q_ref, t_end=0.15, dt=1e-3)
    reference = beam.points(run.q[-1], np.array([1.0]))[0]
    for elements in (1, 2, 4):
        scene, rod = with_rod(elements)
        scene.add_constraint(nga.RevoluteJoint("world", "wire 0", axis=(0, 1, 0)))
        run = nga.simulate(scene, scene.q_ref, t_end=0.15, dt=1e-3)
        assert run.success and np.abs(run.q[-1].reshape(-1, 7)[:, 1]).max() < 1e-12
        tips.append(np.abs(rod.points(run.q[-1], np.array([1.0]))[0] - reference).max())
    assert tips[0] > 10 * tips[1] > 20 * tips[2] and tips[2] < 4e-4  # what is left is the error of the beam's mesh


def test_a_rod_falls_and_lies_still():
    scene, rod = with_rod(damping=5e-3)
    scene.add_plane("ground")
    scene.add_contact("wire", "ground", mu=0.3)
    q = rod.configuration(pin.SE3(pin.utils.rotate("y", -0.1), np.array([0.0, 0.0, 0.03])))
    run = nga.simulate(scene, q, t_end=0.2, dt=1e-3)
    assert run.success and run.g_N.min() > -1e-12
    assert run.audit().ok, str(run.audit())
    assert np.abs(run.v[-1]).max() < 1e-3
    assert run.la_N[-1].sum() == pytest.approx(9.81 * rod.mass, rel=1e-3)
