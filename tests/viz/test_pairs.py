"""Contacts by pair of geometries: gaps against the closed form of a fall, forces and friction against statics."""

from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import free_ball

import ngalpha_pin as nga
from ngalpha_pin.viz.curves import MAX_PAIRS, panels
from ngalpha_pin.viz.pairs import busiest, contact_pairs, friction_impulse, pair_events, pair_gap, pair_names

HALF, HEIGHT = 0.1, 0.05
SLOPE = 0.3


def falling_box(on, tilt=0.0, t_end=0.3, mu=0.5):
    """A cube of 1 kg that falls on a plane or on a fixed slab, both with the top at z = 0."""
    scene = nga.Scene(free_ball())
    scene.add_geometry("box", coal.Box(2 * HALF, 2 * HALF, 2 * HALF), parent="body")
    if on == "plane":
        scene.add_plane("ground")
    else:
        scene.add_geometry("ground", coal.Box(2, 2, 0.2), placement=pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.1])))
    scene.add_contact("box", "ground", mu=mu)
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(tilt, 0.0, 0.0)).coeffs()
    corner = HALF * (np.cos(tilt) + np.sin(tilt))
    q0 = np.concatenate(([0.0, 0.0, corner + HEIGHT], turn))
    return nga.simulate(scene, q0, np.zeros(6), t_end=t_end, dt=1e-3), corner


@pytest.mark.parametrize("on", ["plane", "slab"])
@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_the_gap_of_a_pair_is_that_of_the_fall_and_does_not_jump(on, tilt):
    run, corner = falling_box(on, tilt)
    pairs = contact_pairs(run)
    assert list(pairs) == ["box/ground"]
    assert len(pairs["box/ground"]) > 1  # several corners, one pair
    gap = pair_gap(run, pairs["box/ground"])
    flight = run.t < np.sqrt(2 * HEIGHT / 9.81)
    np.testing.assert_allclose(gap[flight], run.q[flight, 2] - corner, atol=1e-7)
    speed = np.sqrt(2 * 9.81 * HEIGHT) + 2 * HALF * np.abs(run.v[:, 3:]).sum(axis=1).max()
    assert (np.abs(np.diff(gap)) <= 1e-3 * speed + 1e-7).all()
    assert gap.min() > -1e-7


@pytest.mark.parametrize("on", ["plane", "slab"])
def test_forces_of_corners_are_summed(on):
    run, _ = falling_box(on)
    found = {panel.key: panel for panel in panels(run)}
    (force,), (impulse,) = found["force"].curves, found["impulse"].curves
    assert force.label == impulse.label == "box/ground"
    assert force.y[-1] == pytest.approx(9.81, rel=1e-6)
    assert impulse.y.sum() == pytest.approx(9.81 * run.t[-1], rel=1e-6)  # all momentum of the fall, and the weight
    assert [(kind, pair) for _, kind, pair, _ in pair_events(run)] == [("impact", "box/ground")]
    assert pair_events(run)[0][3] == pytest.approx(np.sqrt(2 * 9.81 * HEIGHT), rel=1e-6)


def test_a_corner_that_leaves_is_no_lift_off_of_its_pair():
    run, _ = falling_box("plane", tilt=0.1, t_end=0.5)
    events, pair = pair_events(run), "box/ground"
    names = pair_names(run)
    assert set(names) == {pair}
    of_corners = [event.kind for event in run.events]
    kinds = [kind for _, kind, _, _ in events]
    assert kinds.count("lift-off") < of_corners.count("lift-off") or "lift-off" not in of_corners
    touches = (run.g_N <= 1e-9 * run.system.contacts.length).any(axis=1)
    left = np.flatnonzero(touches[:-1] & ~touches[1:]) + 1
    at = np.searchsorted(run.t, [t for t, kind, _, _ in events if kind == "lift-off"])
    assert set(at) <= set(left)
    for a, b in pairwise(kind for kind in kinds if kind in ("lift-off", "closed")):
        assert a != b


def test_friction_of_a_pair_is_a_vector_in_the_world():
    scene = nga.Scene(free_ball())
    normal = np.array([-np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    scene.add_plane("ground", normal=normal)
    scene.add_geometry("box", coal.Box(0.2, 0.2, 0.2), parent="body")
    scene.add_contact("box", "ground", mu=1.0)
    R = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, -SLOPE, 0.0)).coeffs()
    run = nga.simulate(scene, np.concatenate((0.1 * normal, R)), np.zeros(6), t_end=0.02, dt=1e-3)
    P = friction_impulse(run, contact_pairs(run))["box/ground"]
    uphill = np.array([np.cos(SLOPE), 0.0, np.sin(SLOPE)])
    np.testing.assert_allclose(P[2:], 1e-3 * 9.81 * np.sin(SLOPE) * np.tile(uphill, (len(P) - 2, 1)), atol=1e-9)


def test_many_pairs_are_those_that_carry_most_and_the_others_together():
    model, scene = pin.Model(), None
    for n in range(MAX_PAIRS + 3):
        joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([n, 0.0, 0.0])), f"slide{n}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0 + n, 0.1), pin.SE3.Identity())
        model.addBodyFrame(f"ball{n}", joint, pin.SE3.Identity(), 0)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for n in range(MAX_PAIRS + 3):
        scene.add_geometry(f"b{n}", coal.Sphere(0.1), parent=f"ball{n}")
        scene.add_contact(f"b{n}", "ground", mu=0.0)
    run = nga.simulate(scene, np.full(model.nq, 0.1), np.zeros(model.nv), t_end=0.01, dt=1e-3)
    assert busiest(run, contact_pairs(run), MAX_PAIRS) == [f"b{n}/ground" for n in range(3, MAX_PAIRS + 3)]
    force = next(panel for panel in panels(run) if panel.key == "force")
    assert force.curves[-1].label == "3 other pairs together"
    assert len(force.curves) == MAX_PAIRS + 1
    assert force.curves[-1].y[-1] == pytest.approx(9.81 * (1 + 2 + 3))
