"""Boxes that are nearly flush, and edges that cross at small angles: the features are where the boxes touch."""

from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.system.contact_search import smallest_gap
from ngalpha_pin.system.system import System

SIDES = np.array([0.2, 0.1, 0.1])
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3))) * SIDES


def boxes():
    """A fixed box and a free one of the same size."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, *SIDES), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("below", coal.Box(*SIDES))
    scene.add_geometry("above", coal.Box(*SIDES), parent="body")
    scene.add_contact("below", "above")
    return System(scene)


def separation(pose):
    """Distance of the box at a pose from the fixed one, negative where they overlap: the largest along any normal of a
    face, or of an edge of each (separating axes); boxes whose corners face each other are further apart."""
    R = pose.rotation
    axes = [*np.eye(3), *R.T, *(np.cross(e, f) for e, f in product(np.eye(3), R.T))]
    found = []
    for n in (s * n / np.linalg.norm(n) for n in axes for s in (-1, 1) if np.linalg.norm(n) > 1e-9):
        found.append(((CORNERS @ R.T + pose.translation) @ n).min() - (CORNERS @ n).max())
    return max(found)


def lifted(pose, gap):
    """The pose moved up or down until the boxes are this far apart."""
    found = pose.copy()
    for _ in range(50):
        found.translation[2] += gap - separation(found)
    assert abs(separation(found) - gap) < 1e-15
    return found


def features(system, pose):
    """Gaps, normals and points of the features at a pose."""
    q = pin.SE3ToXYZQUAT(pose)
    system.place_moving(q, np.zeros(6))
    slots = system.slots
    slots.load(system.data, slots.contents()[:0], np.zeros(0, dtype=int), 0.0, np.inf)
    return system.point_rows(system.contacts.subset(np.flatnonzero(slots.loaded)))


def check_proof(system, pose, gap):
    """The audit knows the gap without features in their places as well."""
    system.slots.restore(system.slots.contents()[:0])
    assert smallest_gap(system, pin.SE3ToXYZQUAT(pose)) == pytest.approx(gap / system.contacts.length, abs=2e-10)


@pytest.mark.parametrize("seed", range(10))
def test_boxes_that_are_nearly_flush_touch_where_they_are(seed):
    """Tilted by 1e-6 to 3e-4, where coal's normal is between those of the two faces, or along one of them."""
    rng, system = np.random.default_rng(seed), boxes()
    tilt = 10 ** rng.uniform(-6, -3.5)
    a = rng.uniform(0, 2 * np.pi)
    turn = pin.exp3(rng.uniform(-0.1, 0.1) * np.array([0, 0, 1.0])) @ pin.exp3(
        tilt * np.array([np.cos(a), np.sin(a), 0])
    )
    for gap in (0.0, 1e-6):
        pose = lifted(pin.SE3(turn, np.array([rng.uniform(-0.1, 0.1), rng.uniform(-2e-3, 2e-3), 0.1])), gap)
        rows = features(system, pose)
        heights = rows.g_N
        # corners of either box that hang over are cut off, by no more than they hang over
        assert heights.min() == pytest.approx(gap, abs=tilt * tilt * 0.2 + 1e-12)
        assert heights.max() < gap + 3 * tilt * 0.2
        assert (np.abs(rows.normals[:, 2]) > 1 - tilt * tilt).all()
        if gap == 0.0:  # apart, it is a bound
            check_proof(system, pose, gap)


@pytest.mark.parametrize("seed", range(10))
def test_edges_that_cross_touch_in_one_point(seed):
    """A box stands with its long edge along the edge of another one, turned by a small angle."""
    rng, system = np.random.default_rng(seed), boxes()
    lean, angle = rng.uniform(0.1, 1.0), 10 ** rng.uniform(-2.3, -1.6)
    turn = pin.exp3(np.array([lean, 0, 0])) @ pin.exp3(np.array([0, angle * rng.uniform(-0.3, 0.3), angle]))
    corner = np.array([0.0, -0.05, -0.05])
    for gap in (0.0, 1e-6):
        pose = lifted(pin.SE3(turn, np.array([rng.uniform(-0.02, 0.02), -0.05, 0.05]) - turn @ corner), gap)
        rows = features(system, pose)
        assert rows.g_N.min() == pytest.approx(gap, abs=1e-12)
        check_proof(system, pose, gap)
