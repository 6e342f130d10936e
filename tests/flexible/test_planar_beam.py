"""The planar beam alone: derivatives, rigid motions, closed forms of statics and of small vibrations."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

import ngalpha_pin as nga
from ngalpha_pin.numerics.band import BandMatrix

CIRCLE = 2.0


def arc(xi):
    """A quarter of a circle, not at uniform speed."""
    angle = np.pi / 2 * (0.8 * xi + 0.2 * xi**2)
    return CIRCLE * np.column_stack((np.cos(angle), np.sin(angle)))


BEAMS = {
    "quadratic": {"length": 2.0, "degree": 2, "elements": 2, "gauss": 5},
    "cubic": {"length": 2.0, "degree": 3, "elements": 5},
    "curved": {"curve": arc, "degree": 3, "elements": 4},
}


def beam(kind, **parameters):
    return nga.PlanarBeam(EA=300.0, EI=14.0, line_density=0.7, **{**BEAMS[kind], **parameters})


def deformed(body, seed):
    rng = np.random.default_rng(seed)
    return body.q_ref + 0.05 * rng.normal(size=body.nv), rng.normal(size=body.nv)


def derivative(f, n, h=1e-3):
    """Central differences of order six, shape (n, n)."""
    columns = []
    for e in np.eye(n):
        d1, d2, d3 = ((f(k * h * e) - f(-k * h * e)) / (2 * h) for k in (1, 2, 3))
        columns.append(1.5 * d1 - 0.3 * d2 + d3 / 30)
    return np.array(columns).T


@pytest.mark.parametrize("kind", BEAMS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_stiffness_is_the_derivative_of_the_forces_and_symmetric(kind, seed):
    body = beam(kind)
    q, v = deformed(body, seed)
    K = BandMatrix(body.internal_forces(q, v).K).toarray()
    differences = derivative(lambda d: body.internal_forces(q + d, v).f, body.nv)
    assert np.abs(K - differences).max() < 1e-7 * np.abs(K).max()
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()


@pytest.mark.parametrize("kind", BEAMS)
def test_forces_are_the_gradient_of_the_strain_energy(kind):
    body = beam(kind)
    q, v = deformed(body, 3)
    f = body.internal_forces(q, v).f
    gradient = derivative(lambda d: np.array([body.strain_energy(q + d)]), body.nv)[0]
    assert np.abs(f - gradient).max() < 1e-7 * np.abs(f).max()


def test_damping_takes_the_power_of_kelvin_and_voigt_and_has_its_derivatives():
    body, elastic = beam("cubic", damping=0.02), beam("cubic")
    q, v = deformed(body, 4)
    forces = body.internal_forces(q, v)
    K, D = BandMatrix(forces.K).toarray(), BandMatrix(forces.D).toarray()
    assert np.abs(K - derivative(lambda d: body.internal_forces(q + d, v).f, body.nv)).max() < 1e-7 * np.abs(K).max()
    assert np.abs(D - derivative(lambda d: body.internal_forces(q, v + d).f, body.nv)).max() < 1e-10 * np.abs(D).max()
    assert v @ forces.f - v @ elastic.internal_forces(q, v).f == pytest.approx(v @ D @ v)
    assert np.linalg.eigvalsh(D).min() > -1e-10 * np.abs(D).max()
    assert np.allclose(D @ body.rigid_velocity(q, (1.0, 2.0), 3.0), 0.0, atol=1e-10 * np.abs(D).max())


@pytest.mark.parametrize("kind", BEAMS)
def test_rigid_motion_costs_nothing(kind):
    body = beam(kind)
    q = body.configuration((0.3, -0.7), angle=2.2)
    assert body.strain_energy(q) < 1e-25
    assert np.abs(body.internal_forces(q, q).f).max() < 1e-11
    section = body.section_forces(q, q, np.linspace(0, 1, 7))
    assert np.abs(section.N).max() < 1e-11
    assert np.abs(section.M).max() < 1e-11
    # momentum, and angular momentum about the origin, of a rigid rod or arc
    v = body.rigid_velocity(q, (1.0, -2.0), 0.5)
    x = body.centreline(q, np.linspace(0, 1, 20001))
    ds = np.linalg.norm(np.gradient(x, axis=0), axis=1)
    ds[[0, -1]] /= 2
    centre = ds @ x / ds.sum()
    momentum = (body.M @ v).reshape(-1, 2).sum(axis=0)
    expected = body.mass * (np.array([1.0, -2.0]) + 0.5 * np.array([-centre[1], centre[0]]))
    assert momentum == pytest.approx(expected, rel=1e-6)
    assert body.kinetic_energy(body.rigid_velocity(q, angular=1.0)) == pytest.approx(
        0.5 * body.line_density * ds @ (x**2).sum(axis=1), rel=1e-6
    )
    assert body.node_mass.sum() == pytest.approx(body.mass)


def test_length_and_mass_of_a_curve():
    assert beam("curved", elements=12).length == pytest.approx(CIRCLE * np.pi / 2, rel=1e-6)
    assert beam("cubic").mass == pytest.approx(1.4)


def clamped(load=None, **parameters):
    """A cantilever of unit length along x without gravity, its beam, and its static equilibrium."""
    scene = nga.Scene()
    scene.model.gravity.linear = np.zeros(3)
    body = scene.add_beam(nga.PlanarBeam(1.0, EI=1.0, line_density=1.0, **parameters), "beam")
    scene.add_beam_point("root", "beam", 0.0)
    scene.add_beam_point("tip", "beam", 1.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=body.plane))
    if load is not None:
        scene.add_load(load)
    return scene, body


def tip_of(scene, body):
    return body.points(nga.static_equilibrium(scene, scene.q_ref).q, np.array([1.0]))[0]


@pytest.mark.parametrize("degree", [2, 3])
def test_tip_moment_closes_the_cantilever_to_a_circle(degree):
    errors = []
    for elements in (4, 8):
        load = nga.PointLoad("tip", moment=2 * np.pi)
        errors.append(np.linalg.norm(tip_of(*clamped(load, EA=100.0, degree=degree, elements=elements))))
    assert np.log2(errors[0] / errors[1]) >= 2 * degree - 2
    assert errors[1] < 0.02


def elastica(load):
    """Tip of an inextensible cantilever under P L^2 / EI: horizontal and vertical displacement over L.

    Bisshopp and Drucker: with p = k and the tip angle phi_0, L sqrt(P / EI) = K(k) - F(theta, k).
    """

    def misfit(k):
        theta = np.arcsin(1 / (k * np.sqrt(2)))
        return ellipk(k * k) - ellipkinc(theta, k * k) - np.sqrt(load)

    k = brentq(misfit, np.sqrt(0.5) + 1e-12, 1 - 1e-12)
    sin_tip = 2 * k * k - 1
    horizontal = 1 - np.sqrt(2 * sin_tip / load)

    def slope(phi):
        return np.sin(phi) / np.sqrt(2 * load * (sin_tip - np.sin(phi)))

    tip = np.arcsin(sin_tip)
    # the square root at the end of the range is taken out by phi = tip - s^2
    vertical = quad(lambda s: 2 * s * slope(tip - s * s), 0, np.sqrt(tip))[0]
    return horizontal, vertical


def test_tip_force_follows_the_elastica():
    horizontal, vertical = elastica(10.0)
    assert (horizontal, vertical) == pytest.approx((0.5550, 0.8106), abs=1e-4)
    load = nga.PointLoad("tip", force=(0.0, 0.0, -10.0))
    tip = tip_of(*clamped(load, EA=1e6, degree=4, elements=16))
    assert 1 - tip[0] == pytest.approx(horizontal, abs=5e-5)
    assert -tip[2] == pytest.approx(vertical, abs=5e-5)


CLAMPED = np.array([1.875104068711961, 4.694091132974175, 7.854757438237612])
FREE = np.array([4.730040744862704, 7.853204624095838, 10.995607838001671])


def frequencies(scene):
    return np.sqrt(np.maximum(nga.eigenmodes(scene, scene.q_ref).omega_squared, 0.0))


def test_eigenfrequencies_of_a_cantilever():
    scene, _ = clamped(EA=1e8)
    assert frequencies(scene)[:3] == pytest.approx(CLAMPED**2, rel=1e-3)


@pytest.mark.parametrize(("elements", "modes"), [(8, 2), (12, 3)])
def test_eigenfrequencies_of_a_free_beam(elements, modes):
    """The third one of eight cubic elements is off by 0.38 %, which is what Galerkin's method has there."""
    scene = nga.Scene()
    scene.add_beam(nga.PlanarBeam(1.0, EA=1e8, EI=1.0, line_density=1.0, elements=elements), "beam")
    scene.model.gravity.linear = np.zeros(3)
    found = frequencies(scene)
    assert found[:3] == pytest.approx(np.zeros(3), abs=1e-2)  # rigid motions
    assert found[3 : 3 + modes] == pytest.approx(FREE[:modes] ** 2, rel=1e-3)


def test_axial_eigenfrequencies():
    scene, _ = clamped(EA=4.0, elements=12)
    axial = np.pi / 2 * 2.0 * np.array([1, 3])
    found = frequencies(scene)
    for value in axial:
        assert np.abs(found - value).min() < 1e-4 * value


def test_line_load_bends_as_its_closed_form():
    scene, body = clamped(nga.LineLoad("beam", (0.0, 0.0, -1e-3)), EA=1e6, elements=16)
    assert tip_of(scene, body)[2] == pytest.approx(-1e-3 / 8, rel=1e-5)
    found = nga.static_equilibrium(scene, scene.q_ref)
    section = body.section_forces(found.q, 0 * found.q, np.array([0.0, 0.5]))
    assert section.M == pytest.approx([-1e-3 / 2, -1e-3 / 8], rel=5e-3)


def test_gravity_acts_in_the_plane_of_the_beam():
    plane = pin.SE3(pin.utils.rotate("y", 0.4) @ pin.utils.rotate("x", np.pi / 2), np.array([0.1, 0.2, 0.3]))
    scene = nga.Scene()
    body = scene.add_beam(nga.PlanarBeam(1.0, EA=1e3, EI=1.0, line_density=2.0, plane=plane), "beam")
    run = nga.simulate(scene, scene.q_ref, t_end=0.02, dt=1e-3)
    fall = body.points(run.q[-1], np.array([0.0, 1.0])) - body.points(run.q[0], np.array([0.0, 1.0]))
    assert fall == pytest.approx(np.tile([0.0, 0.0, -9.81 * 0.02**2 / 2], (2, 1)), abs=1e-12)
    assert run.energy.total == pytest.approx(run.energy.total[0], rel=1e-9)


BAD = {
    "EA": ({"EA": 0.0}, "EA = 0.0: expected a positive number"),
    "EI": ({"EI": -1.0}, "EI = -1.0: expected a positive number"),
    "density": ({"line_density": float("nan")}, "line_density = nan: expected a positive number"),
    "length": ({"length": 0.0}, "length = 0.0: expected a positive number of metres"),
    "degree": ({"degree": 1}, "degree = 1: expected an integer of at least 2"),
    "elements": ({"elements": 0}, "elements = 0: expected an integer of at least 1"),
    "few": ({"elements": 1, "degree": 4, "gauss": 3}, "1 elements with 3 Gauss points are too few for degree 4"),
    "damping": ({"damping": -1e-3}, "damping = -0.001: expected a finite number of seconds"),
    "both": ({"curve": arc}, "either the length of a straight beam or a curve"),
    "curve": (
        {"length": None, "curve": lambda xi: xi},
        r"curve has shape \(11,\): expected a matrix of shape \(11, 2\)",
    ),
    "point": ({"length": None, "curve": lambda xi: np.zeros((len(xi), 2))}, "stands still"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_beams_are_refused(case):
    change, message = BAD[case]
    parameters = {"length": 1.0, "EA": 1.0, "EI": 1.0, "line_density": 1.0} | change
    with pytest.raises(nga.SceneError, match=message):
        nga.PlanarBeam(**parameters)


def test_bad_points_loads_and_names_are_refused():
    scene, body = clamped(EA=100.0)
    with pytest.raises(nga.SceneError, match=r"xi = 1.2: expected a finite number in \[0, 1\]"):
        scene.add_beam_point("beyond", "beam", 1.2)
    with pytest.raises(nga.UnknownName, match="no beam named 'beem'; did you mean 'beam'"):
        scene.add_beam_point("point", "beem", 0.5)
    with pytest.raises(nga.SceneError, match="frame or joint named 'tip' already"):
        scene.add_beam_point("tip", "beam", 0.5)
    with pytest.raises(nga.SceneError, match="the scene has this beam or the name"):
        scene.add_beam(body, "other")
    with pytest.raises(nga.UnknownName, match="no beam point named 'top'"):
        scene.add_load(nga.PointLoad("top"))
    with pytest.raises(nga.UnknownName, match="no beam, rod or cable named 'bean'"):
        scene.add_load(nga.LineLoad("bean", (0, 0, 1)))
    with pytest.raises(nga.SceneError, match="vector of shape"):
        nga.LineLoad("beam", (0, 1))
    with pytest.raises(nga.SceneError, match=r"q0 has shape \(3,\): expected a vector of shape \(22,\)"):
        nga.simulate(scene, np.zeros(3), t_end=1.0, dt=0.1)


def test_a_beam_that_nothing_holds_has_no_equilibrium():
    scene = nga.Scene()
    scene.add_beam(nga.PlanarBeam(1.0, EA=100.0, EI=1.0, line_density=1.0), "beam")
    with pytest.raises(nga.SceneError, match="no static equilibrium near q0"):
        nga.static_equilibrium(scene, scene.q_ref)
