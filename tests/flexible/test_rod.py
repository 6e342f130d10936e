"""The rod alone: derivatives, invariance, closed forms of its energy, forces and small vibrations."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.flexible.rod import carried
from ngalpha_pin.scene.strands import StrandForce, strand_model

H = 1e-6


def full_section():
    """Every strain coupled with every other one."""
    A = np.random.default_rng(3).normal(size=(6, 6))
    stiffness = np.diag([5.0, 3.0, 4.0, 1.0, 2.0, 1.5]) + 0.1 * (A + A.T)
    return nga.Section(stiffness=stiffness, line_density=1.0, line_inertia=(2e-2, 1e-2, 1e-2))


def helix(xi):
    return np.column_stack((np.cos(xi), np.sin(xi), 0.3 * xi))


def cusp(xi):
    return np.column_stack(((xi - 0.5) ** 3, (xi - 0.5) ** 2, 0 * xi))


RODS = {
    "thin": lambda damping: nga.Rod(1.0, nga.Section.round(5e-5, 2e11, 0.3, 7850), 2, damping=damping),
    "thick": lambda damping: nga.Rod(1.0, nga.Section.round(5e-2, 2e11, 0.3, 7850), 2, damping=damping),
    "curved": lambda damping: nga.Rod(section=full_section(), elements=3, curve=helix, damping=damping, twist=0.5),
}


class Placed:
    """A rod and its model."""

    def __init__(self, rod):
        self.model, self.law = strand_model("rod", rod), StrandForce("rod", rod)
        self.law.check(self)
        self.rod = rod

    def force(self, q, v):
        n = self.model.nv
        tau, K, D = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
        self.law.add_to(0.0, q, v, tau, K, D)
        return tau, K, D

    def random(self, seed):
        """Far from the undeformed rod: elements turned by 100 degrees and more."""
        rng = np.random.default_rng(seed)
        turn = 0.5 * rng.normal(size=(self.rod.nodes, 6)) * np.repeat([0.1, 1.0], 3)
        turn[:, 3] += np.linspace(0.0, 1.75 * self.rod.elements, self.rod.nodes)
        q = pin.integrate(self.model, self.rod.configuration(), turn.ravel())
        return q, rng.normal(size=self.model.nv)


@pytest.mark.parametrize("kind", RODS)
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_derivatives_are_those_of_the_forces_and_these_of_the_energy(kind, damping):
    at = Placed(RODS[kind](damping))
    q, v = at.random(1)
    _, K, D = at.force(q, v)
    by_q, by_v, work = np.zeros_like(K), np.zeros_like(D), np.zeros(len(v))
    for i, e in enumerate(H * np.eye(len(v))):
        plus, minus = pin.integrate(at.model, q, e), pin.integrate(at.model, q, -e)
        by_q[:, i] = (at.force(plus, v)[0] - at.force(minus, v)[0]) / (2 * H)
        by_v[:, i] = (at.force(q, v + e)[0] - at.force(q, v - e)[0]) / (2 * H)
        work[i] = (at.law.energy(plus) - at.law.energy(minus)) / (2 * H)
    elastic = at.force(q, np.zeros_like(v))[0]
    assert np.abs(K - by_q).max() < 1e-8 * np.abs(K).max()
    assert np.abs(D - by_v).max() <= 1e-8 * np.abs(K).max()
    assert np.abs(elastic + work).max() < 1e-8 * np.abs(elastic).max()
    viscous = at.force(q, v)[0] - elastic
    assert viscous @ v == pytest.approx(at.rod.forces.damping_power(q, v), rel=1e-9)
    assert (viscous @ v < 0.0) == (damping > 0.0)


@pytest.mark.parametrize("kind", RODS)
def test_internal_forces_have_neither_a_sum_nor_a_moment(kind):
    at = Placed(RODS[kind](0.1))
    q, v = at.random(2)
    forces = at.force(q, v)[0].reshape(-1, 6)
    nodes = q.reshape(-1, 7)
    moments = [
        np.cross(node[:3], f[:3]) + pin.Quaternion(node[3:]).toRotationMatrix() @ f[3:]
        for node, f in zip(nodes, forces, strict=True)
    ]
    size = np.abs(forces).max()
    assert np.abs(forces[:, :3].sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.sum(moments, axis=0)).max() < 1e-12 * size


@pytest.mark.parametrize("kind", RODS)
def test_moving_and_turning_everything_changes_no_force(kind):
    at = Placed(RODS[kind](0.0))
    rod, (q, v) = at.rod, at.random(3)
    placement = pin.SE3(pin.utils.rpyToMatrix(0.7, -2.0, 1.1), np.array([3.0, -2.0, 5.0]))
    moved = q.reshape(-1, 7).copy()
    for node in moved:
        node[:3] = placement.act(node[:3])
        node[3:] = (pin.Quaternion(placement.rotation) * pin.Quaternion(node[3:])).coeffs()
    moved[1::2, 3:] *= -1.0  # a quaternion and its opposite are one orientation
    still = np.zeros_like(v)
    forces, others = (at.force(x, still)[0].reshape(-1, 6) for x in (q, moved.ravel()))
    size = np.abs(forces).max()
    assert np.abs(forces[:, :3] @ placement.rotation.T - others[:, :3]).max() < 1e-12 * size
    assert np.abs(forces[:, 3:] - others[:, 3:]).max() < 1e-12 * size
    undeformed = rod.configuration(placement)
    assert rod.strain_energy(undeformed) < 1e-24 * rod.section.stiffness[0, 0]


def slope(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:]).min()


@pytest.mark.parametrize("radius", [5e-5, 5e-2])
def test_energy_of_a_helix_is_of_order_four_in_the_mesh(radius):
    """A straight rod on a helix without stretch, its sections carried without twist: bending alone."""
    section, R, pitch = nga.Section.round(radius, 2e11, 0.3, 7850), 0.1, 0.03
    speed = np.hypot(2 * np.pi * R, pitch)
    bending = R * (2 * np.pi / speed) ** 2
    exact = 0.5 * section.stiffness[4, 4] * bending**2 * speed

    def curve(xi):
        return np.column_stack((R * np.cos(2 * np.pi * xi), R * np.sin(2 * np.pi * xi), pitch * xi))

    errors = []
    for elements in (8, 16, 32):
        rod = nga.Rod(speed, section, elements)
        q = rod.through(curve)
        errors.append(abs(rod.strain_energy(q) / exact - 1.0))
        M = np.hypot(*rod.section_forces(q, np.zeros(rod.nv), np.array([0.5]))[4:])
        assert M == pytest.approx(section.stiffness[4, 4] * bending, rel=30 * elements**-2.0)
    # interpolation errors stretch a thin rod, which costs more than it bends: order four all the same
    assert slope(errors) > 3.8


@pytest.mark.parametrize("slenderness", [10, 10_000])
def test_small_deflection_of_a_cantilever_is_that_of_timoshenko(slenderness):
    section = nga.Section.round(0.5 / slenderness, 2e11, 0.3, 7850)
    exact = 1 / (3 * section.stiffness[4, 4]) + 1 / section.stiffness[2, 2]
    for elements in (1, 4):
        at = Placed(nga.Rod(1.0, section, elements))
        K = -at.force(at.rod.q_ref, np.zeros(at.rod.nv))[1][6:, 6:]
        force = np.zeros(len(K))
        force[-4] = 1.0
        assert np.linalg.solve(K, force)[-4] == pytest.approx(exact, rel=1e-6)


def test_frequencies_of_a_cantilever():
    section = nga.Section.round(1e-3, 2e11, 0.3, 7850)
    bending = np.sqrt(section.stiffness[4, 4] / section.line_density) / (2 * np.pi)
    errors = []
    for elements in (4, 8):
        scene = nga.Scene()
        scene.model.gravity.linear[:] = 0.0
        scene.add_rod(nga.Rod(1.0, section, elements), "rod")
        scene.add_constraint(nga.Weld("world", "rod 0"))
        found = nga.eigenmodes(scene, scene.q_ref)
        assert not np.any(found.unstable)
        exact = np.repeat([1.8751040687119611**2, 4.694091132974175**2], 2) * bending
        errors.append(np.abs(found.frequencies[:4] / exact - 1.0))
    assert errors[1][0] < 4e-6 and errors[1][2] < 2e-4
    assert np.log2(errors[0] / errors[1]).min() > 3.7  # lumped inertia, Lobatto weights


def test_frames_are_carried_without_twist():
    s = np.linspace(0.0, 4 * np.pi, 2001)
    points = np.column_stack((np.cos(s), np.sin(s), 0.5 * s))
    t = np.column_stack((-np.sin(s), np.cos(s), 0.5 + 0 * s)) / np.hypot(1, 0.5)
    first = np.array([1.0, 0.0, 0.0])
    z = carried(points, t, first)
    assert np.abs(np.linalg.norm(z, axis=1) - 1).max() < 1e-14 and np.abs(np.sum(z * t, axis=1)).max() < 1e-14
    # against the Frenet frame it turns by minus the torsion, 0.5 / (1 + 0.25) per length
    normal = -np.column_stack((np.cos(s), np.sin(s), 0 * s))
    angle = np.unwrap(np.arctan2(np.sum(np.cross(t, normal) * z, axis=1), np.sum(normal * z, axis=1)))
    assert angle[-1] - angle[0] == pytest.approx(-0.5 / 1.25 * s[-1] * np.hypot(1, 0.5), rel=1e-6)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: nga.Section(1.0, (1.0, -1.0), 1.0, (1.0, 1.0), line_density=1, line_inertia=(2, 1, 1)), "GA"),
        (lambda: nga.Section(1.0, (1.0, 1.0), 1.0, line_density=1, line_inertia=(2, 1, 1)), "EI is missing"),
        (lambda: nga.Section(1.0, (1, 1), 1.0, (1, 1), line_density=1, line_inertia=(3, 1, 1)), "line_inertia"),
        (lambda: nga.Section(stiffness=-np.eye(6), line_density=1, line_inertia=(2, 1, 1)), "positive definite"),
        (lambda: nga.Section.tube(1.0, 1.0, 1.0, 0.3, 1.0), "inner radius"),
        (lambda: nga.Section.round(1.0, 1.0, 0.7, 1.0), "nu"),
        (lambda: nga.Rod(1.0), "section"),
        (lambda: nga.Rod(section=full_section()), "either its length or its curve"),
        (lambda: nga.Rod(1.0, full_section(), elements=0), "elements"),
        (lambda: nga.Rod(1.0, full_section(), 2, boundaries=(0.0, 0.7, 0.6)), "boundaries"),
        (lambda: nga.Rod(section=full_section(), curve=lambda x: np.zeros((len(x), 3))), "stands still"),
        (lambda: nga.Rod(section=full_section(), curve=cusp), "cusp"),
        (lambda: nga.Rod(section=full_section(), elements=2, curve=lambda x: helix(8 * x)), "more elements"),
        (lambda: nga.Rod(1.0, full_section(), normal=(1.0, 0.0, 0.0)), "across"),
    ],
)  # fmt: skip
def test_what_is_no_rod_is_said(make, said):
    with pytest.raises(nga.SceneError, match=said):
        make()
