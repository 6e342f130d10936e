"""Caps of cylinders and cones on faces and on each other: the common part of a disc and a polygon, or of two discs."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.collision.features import SIDE, WIDTH
from ngalpha_pin.system.system import System

BOX, CONE = coal.Box(0.5, 0.3, 0.2), coal.Cone(0.2, 0.4)
CYLINDER, NARROW = coal.Cylinder(0.2, 0.3), coal.Cylinder(0.15, 0.2)
G, HALF, R = 9.81, 0.1, 0.2
LIFT = 2e-3  # of shapes that touch coal has no exact normal
RESOLVED = 1e-4  # places along a border are so far from each other [m]


def half_height(shape):
    return shape.halfSide[2] if isinstance(shape, coal.Box) else shape.halfLength


def is_over(shape, x, larger=1e-8):
    """Places (n, 2) that are on the flat side of a shape."""
    if isinstance(shape, coal.Box):
        return (np.abs(x) <= shape.halfSide[:2] + larger).all(axis=1)
    return np.hypot(*x.T) <= shape.radius + larger


def border(shape, n=20000):
    """Places along the border of the flat side of a shape, corners among them."""
    angles = 2 * np.pi * np.arange(n) / n
    if not isinstance(shape, coal.Box):
        return shape.radius * np.column_stack((np.cos(angles), np.sin(angles)))
    s, (a, b) = np.linspace(-1, 1, n // 4)[:, None], shape.halfSide[:2]
    along, across = np.hstack((s * a, 0 * s)), np.hstack((0 * s, s * b))
    return np.concatenate((along + [0, b], along - [0, b], across + [a, 0], across - [a, 0]))


def stack(lower, upper, place, yaw, mu=0.6):
    """A fixed shape and a free one of 1 kg on it, its centre above a place."""
    scene = nga.Scene()
    upon = pin.SE3(pin.utils.rotate("z", yaw), np.array([*place, half_height(lower) + half_height(upper)]))
    scene.add_geometry("lower", lower)
    scene.add_body("upper", upper, mass=1.0, placement=upon)
    scene.add_contact("lower", "upper", mu=mu)
    return scene


PAIRS = [(BOX, CYLINDER), (CYLINDER, BOX), (CYLINDER, NARROW), (NARROW, CYLINDER), (BOX, CONE), (CYLINDER, CONE)]


@pytest.mark.parametrize(("lower", "upper"), PAIRS)
def test_points_are_corners_of_the_common_part_and_the_deepest_one(lower, upper):
    """A small tilt in any direction: no place of the common part is deeper than the deepest of the points."""
    rng, none = np.random.default_rng(5), np.zeros((0, WIDTH))
    scene = stack(lower, upper, (0.0, 0.0), 0.0)
    pair = System(scene).slots.pairs[0]
    for i in range(60):
        yaw, at = rng.uniform(-3, 3), rng.uniform(-0.3, 0.3, 2)
        tilt = 10.0 ** rng.uniform(-8, -6) * rng.normal(size=2)
        turn = pin.exp3(np.append(tilt if i % 3 else 0 * tilt, 0.0)) @ pin.utils.rotate("z", yaw)
        X = pin.SE3(turn, np.array([*at, half_height(lower) + half_height(upper) + LIFT]))
        top, below = half_height(lower), half_height(upper)
        # places over both flat sides: of the upper border, and of the lower border on the plane of the upper one
        raised = np.column_stack((border(lower), np.full(20000, top)))
        m = turn[:, 2]
        raised[:, 2] -= ((raised - X.act(np.array([0.0, 0.0, -below]))) @ m) / m[2]
        edge = np.column_stack((border(upper), np.full(20000, -below))) @ turn.T + X.translation
        edge = np.concatenate((edge, raised))
        upper_place = lambda x: ((x - X.translation) @ turn)[:, :2]  # noqa: B023, E731
        edge = edge[is_over(lower, edge[:, :2], 1e-9) & is_over(upper, upper_place(edge), 1e-9)]
        if len(edge) < 20:
            continue
        rows = pair.native.features(X.rotation, X.translation, None, none, none)
        points, gaps = [], []
        for row in rows:
            n, c = row[38:41], [row[:3], X.act(row[SIDE : SIDE + 3])]
            gaps.append(n @ (c[1] - c[0]))
            points.append(c[1] if row[4] or row[6] or row[8] else c[0])  # the one that is no face
        found = np.array(points)
        assert is_over(lower, found[:, :2], 1e-7).all() and is_over(upper, upper_place(found), 1e-7).all()
        assert 2 < len(found) <= 8
        assert min(gaps) == pytest.approx(edge[:, 2].min() - top, abs=1e-11 + RESOLVED * np.abs(tilt).max())


@pytest.mark.parametrize("seed", range(4))
def test_stands(seed):
    """With its centre anywhere over the common part: it rests on the same points, and they carry its weight."""
    rng = np.random.default_rng(seed)
    lower, upper = PAIRS[seed]
    way = rng.uniform(0, 2 * np.pi)
    reach = 0.93 * (0.15 if isinstance(lower, coal.Box) else lower.radius)
    scene = stack(lower, upper, (reach * np.cos(way), reach * np.sin(way)), rng.uniform(-3, 3))
    run = nga.simulate(scene, scene.q_ref, t_end=0.1, dt=2e-3)
    settled = 3  # steps: a point that an arc needs is found in the first one, which remembers it
    assert np.ptp(run.q, axis=0).max() < 1e-7
    assert np.abs(run.v[settled:]).max() < 1e-9 and np.ptp(run.q[settled:], axis=0).max() < 1e-12
    assert run.la_N[1:].sum(axis=1) == pytest.approx(G, rel=1e-5)
    assert run.la_N[settled:].sum(axis=1) == pytest.approx(G, rel=1e-9)
    carries = run.la_N[settled:] > 1e-6
    assert (carries == carries[0]).all()
    audit = run.audit()
    assert audit.ok and audit.penetration < 1e-10, str(audit)


@pytest.mark.parametrize("way", [0.0, 0.4, np.pi / 4])
def test_box_tips_over_a_rim(way):
    """It stands as long as its centre is over the disc: within one per cent of the radius."""
    cube = coal.Box(2 * HALF, 2 * HALF, 2 * HALF)
    for part in (0.99, 1.01):
        place = part * R * np.array([np.cos(way), np.sin(way)])
        scene = stack(CYLINDER, cube, place, way, mu=1.0)
        run = nga.simulate(scene, scene.q_ref, t_end=0.1, dt=2e-3)
        assert run.audit().penetration < 1e-10
        tilt = np.arccos(min(1.0, abs(pin.Quaternion(run.q[-1, 3:]).matrix()[2, 2])))
        if part < 1.0:
            assert tilt < 1e-9 and np.abs(run.v[-1]).max() < 1e-9
        else:  # about the tangent of the rim below it: I theta_ddot = m g (arm + h theta)
            arm = (part - 1.0) * R
            rate = np.sqrt(G * HALF / (2 / 3 * HALF**2 + arm**2 + HALF**2))
            assert tilt == pytest.approx(arm / HALF * (np.cosh(rate * 0.1) - 1.0), rel=0.01)
