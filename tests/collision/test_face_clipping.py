"""Corners that carry a force stay what a shape rests on; where one vanishes, its successor is there from the start."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.collision.face_clipping import resting_points
from ngalpha_pin.collision.features import SIDE, VANISHED, Look
from ngalpha_pin.collision.polytope import polytope
from ngalpha_pin.collision.shapes import Wall
from ngalpha_pin.system.contact_search import load_slots, successors

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
    ground = Wall(up, np.array([0.0, 0.0, -HEIGHT / 2]), False).face(up)
    corners = shape.corners(-up, Look(None, np.zeros((0, 3))))
    chosen = {tuple(f.c) for f in resting_points(ground, corners)}
    others = [c for c in corners.c if tuple(c) not in chosen][:3]
    nowhere = np.array([0.05, 0.0, -HEIGHT / 2])
    kept = {tuple(f.c) for f in resting_points(ground, corners, [*others, nowhere])}
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
