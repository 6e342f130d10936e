"""Corners and edges of polytopes: which of them a plane may touch, however thin the shape is."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import ngalpha_pin as nga
from ngalpha_pin.collision.polytope import largest_face, polytope


def free_body(inertia):
    model = pin.Model()
    model.appendBodyToJoint(
        model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body"), inertia, pin.SE3.Identity()
    )
    model.addJointFrame(1)
    return model


UNIT = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def test_edges_of_a_box_and_of_random_hulls():
    box = polytope(UNIT, 0.0, pin.SE3.Identity())
    assert len(box.edges) == 12
    np.testing.assert_allclose(np.linalg.norm(box.V[box.edges[:, 0]] - box.V[box.edges[:, 1]], axis=1), 1.0)
    rng = np.random.default_rng(0)
    for n in (5, 20, 100):
        hull = polytope(rng.normal(size=(n, 3)), 0.0, pin.SE3.Identity())
        assert len(hull.V) - len(hull.edges) + len(hull.normals) == 2  # Euler
        for a, b, f, g in hull.edges:
            assert {a, b} <= set(hull.members[f]) & set(hull.members[g])


def test_corners_of_faces_go_around_their_normals():
    rng = np.random.default_rng(3)
    pose = pin.SE3.Random()
    flat = polytope(np.array([[0.0, 0, 0], [1, 0, 0], [1.5, 1, 0], [0, 1, 0]]), 0.0, pose)
    hulls = [polytope(rng.normal(size=(n, 3)), 0.0, pose) for n in (4, 30, 300)]
    for piece in (polytope(UNIT, 0.0, pose), flat, *hulls):
        for i, (normal, corners) in enumerate(zip(piece.normals, piece.members, strict=True)):
            if len(corners) > 2:
                loop = piece.side(i)
                turns = np.cross(
                    np.roll(loop, -1, axis=0) - loop, np.roll(loop, -2, axis=0) - np.roll(loop, -1, axis=0)
                )
                assert len(np.unique(corners)) == len(corners) and (turns @ normal > 0.0).all()


def test_the_largest_face_of_a_prism_is_its_end():
    for n, turn in ((40, 0.0), (17, 0.6)):
        angle = 2.0 * np.pi * np.arange(n) / n
        ring = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(n)))
        prism = np.vstack((ring, ring + [0.0, 0.0, 0.3])) @ pin.exp3(np.array([turn, 0.2, 0.0])).T
        assert largest_face(prism) == max(map(len, polytope(prism, 0.0, pin.SE3.Identity()).members)) == n
        assert largest_face(ring) == n
    assert largest_face(UNIT) == 4


def test_edges_of_a_triangle_belong_to_both_of_its_sides():
    flat = polytope(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), 0.0, pin.SE3.Identity())
    assert len(flat.edges) == 6 and len(np.unique(flat.edges[:, :2], axis=0)) == 3


@pytest.mark.parametrize("thick", [1.0, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("turn", [None, np.array([0.0, 0.05, 0.0])])
def test_a_plate_touches_with_one_of_its_faces(thick, turn):
    plate = polytope(UNIT * [1.0, 0.7, thick], 0.0, pin.SE3.Identity())
    corners = plate.native.corners(np.array([0.0, 0.0, -1.0]), turn)
    assert len(corners) == 4 and (corners[:, 2] < 0.0).all()


def test_the_corner_that_is_lowest_after_a_turn_is_among_those_that_may_touch():
    rng = np.random.default_rng(1)
    for _ in range(300):
        points = rng.normal(size=(int(rng.integers(6, 200)), 3)) * 10.0 ** rng.uniform(-3, 0, size=3)
        hull = polytope(points, 0.0, pin.SE3.Identity())
        m = hull.normals[rng.integers(len(hull.normals))] + rng.normal(size=3) * 0.05
        m /= np.linalg.norm(m)
        turn = rng.normal(size=3)
        turn *= rng.uniform(0.0, 0.1) / np.linalg.norm(turn)
        found = hull.native.corners(m, turn)
        lowest = hull.native.support(pin.exp3(-turn) @ m)  # as the body, which turns, sees the plane at the end
        assert (found == lowest).all(axis=1).any()
        assert len(found) <= len(ConvexHull(points).vertices)


@pytest.mark.parametrize(
    "under, upon, at",
    [
        ((40.0, 0.5, 1e-3), (0.3, 0.2, 0.1), (15.0, 0.1)),  # a belt
        ((0.09, 0.06, 1e-4), (0.02, 0.02, 0.02), (0.01, 0.0)),  # a card
        ((1.0, 1.0, 0.1), (1e-4, 0.5, 1e-4), (0.01, 0.0)),  # under a needle
    ],
)
def test_what_falls_on_a_thin_plate_rests_on_it(under, upon, at):
    """One face of either takes part: the gap closes at rest, without a bounce or a turn."""
    scene = nga.Scene(free_body(pin.Inertia.FromBox(0.1, *upon)))
    scene.add_geometry("plate", coal.Box(*under))
    scene.add_geometry("load", coal.Box(*upon), parent="body")
    scene.add_contact("load", "plate", mu=0.5)
    q0 = pin.neutral(scene.model)
    height = 0.5 * (under[2] + upon[2])
    q0[:3] = *at, height + 1e-4
    run = nga.simulate(scene, q0, t_end=0.02, dt=1e-3)
    np.testing.assert_allclose(run.q[-1], [*at, height, 0, 0, 0, 1], rtol=0, atol=1e-12)
    assert np.abs(run.v[-1]).max() < 1e-9 and run.audit().ok
