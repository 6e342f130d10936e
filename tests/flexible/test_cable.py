"""Cables: derivatives, the elastic catenary, ropes that go taut with and without stretch, and what does not fit."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin.flexible.strand import StrandNodes
from ngalpha_pin.scene.strands import StrandForce, strand_model

G = 9.81
H = 1e-6


class Placed:
    """A cable and its model."""

    def __init__(self, cable):
        self.model, self.law = strand_model("rope", cable), StrandForce("rope", cable)
        self.law.check(self)

    def force(self, q, v):
        n = self.model.nv
        tau, K, D = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
        self.law.add_to(0.0, q, v, tau, K, D)
        return tau, K, D


@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(3))
def test_forces_are_the_gradient_of_the_energy_and_have_their_derivatives(damping, seed):
    cable = nga.Cable(1.0, 50.0, 0.1, elements=6, damping=damping)
    placed, rng = Placed(cable), np.random.default_rng(seed)
    # some segments are slack, some taut
    q, v = cable.q_ref + 0.06 * rng.normal(size=cable.nq), 0.3 * rng.normal(size=cable.nv)
    tensions = cable.section_forces(q, v, 0.5 * (cable.places[1:] + cable.places[:-1])).N
    assert tensions.min() == 0.0 < tensions.max()
    still = placed.force(q, 0.0 * v)[0]
    tau, K, D = placed.force(q, v)
    for i, e in enumerate(H * np.eye(cable.nv)):
        assert -(cable.strain_energy(q + e) - cable.strain_energy(q - e)) / (2 * H) == pytest.approx(still[i], abs=1e-7)
        assert np.allclose((placed.force(q + e, v)[0] - placed.force(q - e, v)[0]) / (2 * H), K[:, i], atol=1e-5)
        assert np.allclose((placed.force(q, v + e)[0] - placed.force(q, v - e)[0]) / (2 * H), D[:, i], atol=1e-7)
    assert np.allclose(tau.reshape(-1, 3).sum(axis=0), 0.0, atol=1e-13)
    assert np.allclose(np.cross(q.reshape(-1, 3), tau.reshape(-1, 3)).sum(axis=0), 0.0, atol=1e-12)
    assert cable.forces.damping_power(q, v) == pytest.approx((tau - still) @ v, abs=1e-13) and (tau - still) @ v <= 0.0


def hung(cable, span):
    """A cable between two points of the world at one height."""
    scene = nga.Scene()
    scene.add_cable(cable, "rope")
    for name, xi, x in (("left", 0.0, 0.0), ("right", 1.0, span)):
        scene.add_cable_point(name, "rope", xi)
        scene.add_constraint(nga.PointJoint("world", name, placement_a=pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))))
    return scene


def elastic_catenary(length, span, EA, weight):
    """Horizontal force and sag; H. M. Irvine, Cable Structures."""
    half = weight * length / 2

    def too_long(x):
        return x * length / EA + 2 * x / weight * np.arcsinh(half / x) - span

    force = brentq(too_long, 1e-3, 1e3)
    sag = half * length / (4 * EA) + force / weight * (np.hypot(1.0, half / force) - 1.0)
    return force, sag


def test_a_hanging_cable_is_the_elastic_catenary_to_the_second_order_of_its_segments():
    force, sag = elastic_catenary(1.2, 1.0, 50.0, 0.5 * G)
    off = []
    for elements in (8, 16):
        cable = nga.Cable(1.2, 50.0, 0.5, elements=elements)
        scene = hung(cable, 1.0)
        q0 = cable.through(lambda xi: np.column_stack((xi, 0 * xi, -0.25 * np.sin(np.pi * xi))))
        rest = nga.static_equilibrium(scene, q0)
        assert rest.stable
        middle = np.array([0.5])
        tension = cable.section_forces(rest.q, 0 * rest.q, middle).N[0]
        off.append((-cable.points(rest.q, middle)[0, 2] - sag, tension - force))
    assert np.abs(off[1]).max() < 0.01
    assert np.log2(np.array(off[0]) / off[1]).min() > 1.9
    run = nga.simulate(scene, rest.q, t_end=0.02, dt=1e-3)
    assert np.abs(run.q - rest.q).max() < 1e-11 and run.audit().ok
    assert run.section_forces("rope", middle).N[-1, 0] == pytest.approx(force + off[1][1], abs=1e-9)


def weight_on(cable, mass=2.0):
    """A ball on a rope that is tied to the world."""
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.05), mass=mass)
    scene.add_cable(cable, "rope")
    for name, xi, body in (("fixed", 0.0, "world"), ("moved", 1.0, "ball")):
        scene.add_cable_point(name, "rope", xi)
        scene.add_constraint(nga.PointJoint(body, name))
    return scene


def start(scene, cable, depth):
    """Ball and rope below the fixed end, the nodes evenly."""
    q = scene.q_ref
    q[2] = -depth
    q[scene.slices[cable].q] = np.outer(cable.places, (0.0, 0.0, -depth)).ravel()
    return q


@pytest.mark.parametrize("elements", [1, 8])
def test_a_rope_that_does_not_stretch_stops_what_falls_where_it_goes_taut(elements):
    cable = nga.Cable(1.0, np.inf, 0.1, elements=elements)
    scene = weight_on(cable)
    run = nga.simulate(scene, start(scene, cable, 0.5), t_end=0.4, dt=2e-3)
    assert run.q[-1, 2] == pytest.approx(-1.0, abs=1e-11) and np.abs(run.v[-1]).max() < 1e-11
    last = max(event.t for event in run.events if event.kind == "impact")
    assert last == pytest.approx(np.sqrt(2 * 0.5 / G), abs=1e-9)
    # below the middle of a segment hang the ball and the nodes behind it
    carried = 2.0 + 0.1 * (1.0 - 0.5 / elements)
    assert run.section_forces("rope", np.array([0.0])).N[-1, 0] == pytest.approx(carried * G, rel=1e-9)
    assert run.audit().ok


def test_a_rope_that_stretches_throws_back_what_falls_into_it():
    """Free fall, half a period about the sagged place, free fall: closed form, order 2."""
    EA, mass, depth = 400.0, 2.0, 0.5
    cable = nga.Cable(1.0, EA, 1e-9, elements=1)
    scene = weight_on(cable, mass)
    m = mass + cable.node_mass[1]
    taut, speed, omega = np.sqrt(2 * (1.0 - depth) / G), np.sqrt(2 * G * (1.0 - depth)), np.sqrt(EA / m)
    sag = m * G / EA
    end = 1.2  # before it goes taut again

    def place(t):
        if t < taut:
            return depth + G * t**2 / 2
        s = t - taut
        turning = 2 * (np.pi - np.arctan2(speed / omega, sag)) / omega
        if s < turning:
            return 1.0 + sag - sag * np.cos(omega * s) + speed / omega * np.sin(omega * s)
        return 1.0 - speed * (s - turning) + G * (s - turning) ** 2 / 2

    off = []
    for dt in (4e-3, 2e-3, 1e-3):
        run = nga.simulate(scene, start(scene, cable, depth), t_end=end, dt=dt)
        off.append(np.sqrt(np.mean((run.q[:, 2] + [place(t) for t in run.t]) ** 2)))
    assert np.ptp(run.energy.total) < 2e-3
    assert off[2] < 1e-4 and np.log2(off[0] / off[2]) / 2 > 1.7
    tight = nga.simulate(scene, start(scene, cable, depth), t_end=end, rtol=1e-6)
    assert abs(tight.q[-1, 2] + place(end)) < 1e-5 and tight.audit().ok


def test_a_free_rope_keeps_its_momenta():
    cable = nga.Cable(1.0, 100.0, 0.2, elements=5)
    scene = nga.Scene()
    scene.model.gravity.linear = np.zeros(3)
    scene.add_cable(cable, "rope")
    rng = np.random.default_rng(1)
    run = nga.simulate(scene, cable.q_ref, rng.normal(size=cable.nv), t_end=0.2, dt=1e-3)
    p = run.v.reshape(len(run.t), -1, 3) * cable.node_mass[:, None]
    spin = np.cross(run.q.reshape(p.shape), p).sum(axis=1)
    assert np.ptp(p.sum(axis=1), axis=0).max() < 1e-12 and np.ptp(spin, axis=0).max() < 1e-4
    assert run.audit().ok


@pytest.mark.parametrize("EA", [100.0, np.inf])
def test_a_scene_with_a_cable_goes_to_another_process_and_into_a_file(EA, tmp_path):
    cable = nga.Cable(1.0, EA, 0.2, radius=0.01, elements=4, damping=1e-3)
    scene = weight_on(cable)
    scene.add_load(nga.LineLoad("rope", (0.0, 0.1, 0.0)))
    scene.add_plane("ground", point=(0.0, 0.0, -2.0))
    scene.add_contact("rope", "ground", mu=0.3)
    q = start(scene, cable, 0.9)
    run = nga.simulate(scene, q, t_end=2e-2, dt=2e-3)
    again = nga.simulate(pickle.loads(pickle.dumps(scene)), q, t_end=2e-2, dt=2e-3)
    assert np.array_equal(run.q, again.q)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert loaded.scene.cables["rope"].to_plain() == cable.to_plain() and loaded.audit().ok
    assert [name for name, *_ in run.tubes] == ["rope"]
    scene.constraints = []
    scene.remove("rope")
    assert not scene.cables and not scene.forces and scene.model.nv == 6 and not scene.contacts


def test_what_does_not_fit_is_said():
    for arguments, what in (((0.0, 1.0, 1.0), "length"), ((1.0, 0.0, 1.0), "EA"), ((1.0, 1.0, -1.0), "line_density")):
        with pytest.raises(nga.SceneError, match=f"Cable: {what}"):
            nga.Cable(*arguments)
    with pytest.raises(nga.SceneError, match="from 0 to 1"):
        nga.Cable(1.0, 1.0, 1.0, elements=2, boundaries=(0.0, 0.5, 0.9))
    scene, cable = nga.Scene(), nga.Cable(1.0, 1.0, 1.0, elements=4)
    scene.add_cable(cable, "rope")
    with pytest.raises(nga.SceneError, match="already"):
        scene.add_cable(cable, "other")
    with pytest.raises(nga.SceneError, match=r"the cable has no node at xi = 0.3; the nearest is at 0.25"):
        scene.add_cable_point("here", "rope", 0.3)
    assert isinstance(cable, StrandNodes) and cable.node(0.25 + 1e-10) == cable.node(0.25) == 1
    with pytest.raises(nga.UnknownName, match="wire"):
        scene.add_cable_point("here", "wire", 0.5)
    with pytest.raises(nga.SceneError, match="Cable: points"):
        cable.through(np.zeros((3, 3)))
