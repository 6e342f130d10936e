"""Corners that carry a force stay what a shape rests on; where one vanishes, its successor is there from the start."""

from dataclasses import replace
from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest
from shape_scenes import two_bodies

import ngalpha_pin as nga
from ngalpha_pin.collision.features import SIDE, VANISHED, WIDTH
from ngalpha_pin.collision.polytope import polytope
from ngalpha_pin.collision.shapes import Wall
from ngalpha_pin.system.contact_search import load_slots, successors
from ngalpha_pin.system.system import System

SIDES, HEIGHT = 40, 0.1  # corners enough in a face for places whose features are chosen in every step


def prism_corners():
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    rim = np.column_stack((0.2 * np.cos(angles), 0.2 * np.sin(angles)))
    return np.concatenate([np.column_stack((rim, np.full(SIDES, z))) for z in (-HEIGHT / 2, HEIGHT / 2)])


def prism_on_plane():
    """A prism of 40 sides at rest on the ground, and its q0."""
    points = coal.StdVec_Vec3s()
    for p in prism_corners():
        points.append(p)
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "prism")
    model.appendBodyToJoint(joint, pin.Inertia.FromCylinder(1.0, 0.2, HEIGHT), pin.SE3.Identity())
    geometries = pin.GeometryModel()
    shape = coal.Convex.convexHull(points, True, "Qt")
    geometries.addGeometryObject(pin.GeometryObject("prism", joint, pin.SE3.Identity(), shape))
    scene = nga.Scene(model, geometries)
    scene.add_plane("ground")
    scene.add_contact("prism", "ground", mu=0.3)
    q0 = pin.neutral(model)
    q0[2] = HEIGHT / 2
    return scene, q0


def test_corners_that_carry_are_kept():
    shape, up = polytope(prism_corners(), 0.0, pin.SE3.Identity()), np.array([0.0, 0.0, 1.0])
    ground, body = Wall(up, np.array([0.0, 0.0, -HEIGHT / 2]), False).native, shape.native
    chosen = set(map(tuple, ground.resting(up, body, np.zeros((0, 3)))))
    others = [c for c in body.corners(-up, None) if tuple(c) not in chosen][:3]
    nowhere = np.array([0.05, 0.0, -HEIGHT / 2])
    kept = set(map(tuple, ground.resting(up, body, np.array([*others, nowhere]))))
    assert len(chosen) == 4
    assert kept == chosen | {tuple(c) for c in others}


def test_successor_of_a_corner_that_has_vanished():
    """A force that is remembered for a corner that is not there any more: the corner in its stead carries at once."""
    scene, q0 = prism_on_plane()
    simulator = nga.Simulator(scene, dt=1e-3)
    state = simulator.initial_state(q0)
    for _ in range(3):
        state = simulator.step(state)
    system, slots = simulator.system, state.slots.copy()
    assert len(successors(system, state)) == 0
    carries = int(state.contacts[np.argmax(state.la_N)] - system.contacts.n_fixed)
    row = int(np.flatnonzero(slots[:, 0] == carries)[0])
    slots[row, 1 + SIDE : 4 + SIDE] += [0.3, 0.0, 0.0]
    changed = replace(state, slots=slots)
    load_slots(system, changed, 1e-3)
    assert system.slots.packed[carries, VANISHED] > 0.0
    found = successors(system, changed)
    assert len(found) >= 1 and not np.isin(found, state.contacts[state.la_N > 0.0]).all()
    result = simulator.method.step(system, changed, 1e-3)
    assert result.converged and result.n_iter <= 8
    assert result.state.P_N.sum() == pytest.approx(9.81e-3, rel=1e-9)
    assert np.abs(result.state.v).max() < 1e-9


def vertices(rectangle, other):
    """Corners of the common part of two rectangles, by what is inside of both and by crossings of all sides."""
    inside = lambda p, q: (np.abs(q[1].T @ (p - q[0])) <= q[2] + 1e-9).all()  # noqa: E731
    corners = [
        [q[0] + q[1] @ (q[2] * sign) for sign in ([-1, -1], [1, -1], [1, 1], [-1, 1])] for q in (rectangle, other)
    ]
    found = [p for points, q in zip(corners, (other, rectangle), strict=True) for p in points if inside(p, q)]
    for a, b in product(*(zip(x, np.roll(x, -1, axis=0), strict=True) for x in corners)):
        A = np.column_stack((a[1] - a[0], b[0] - b[1]))
        if abs(np.linalg.det(A)) > 1e-12:
            s = np.linalg.solve(A, b[0] - a[0])
            if (s >= 0.0).all() and (s <= 1.0).all():
                found.append(a[0] + s[0] * (a[1] - a[0]))
    return np.array(found)


def test_a_box_rests_on_corners_of_the_common_part_of_two_faces():
    rng = np.random.default_rng(3)
    scene = two_bodies(coal.Box(0.6, 0.4, 0.2), coal.Box(0.5, 0.3, 0.1))
    system = System(scene)
    pair = system.slots.pairs[0]
    counts = set()
    for _ in range(100):
        yaw, at = rng.uniform(-np.pi, np.pi), rng.uniform(-0.3, 0.3, size=2)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        common = vertices((np.zeros(2), np.eye(2), np.array([0.3, 0.2])), (at, turn, np.array([0.25, 0.15])))
        upon = pin.SE3(pin.exp3(np.array([0.0, 0.0, yaw])), np.array([*at, 0.15]))
        X = pair.placements[0] * upon * pair.placements[1].inverse()
        rows = pair.native.features(X.rotation, X.translation, None, np.zeros((0, WIDTH)), np.zeros((0, WIDTH)))
        points = [pair.placements[0].actInv(X.act(row[SIDE : SIDE + 3])) for row in rows]
        away = np.array([np.abs(common - p[:2]).max(axis=1) for p in points])
        assert away.min(axis=1).max() < 1e-8 and np.abs(np.array(points)[:, 2] - 0.1).max() < 1e-14
        assert 3 <= len(points) <= 4 if len(common) > 4 else away.min(axis=0).max() < 1e-8
        counts.add(len(common))
    assert {3, 4, 5, 6} <= counts
