"""Scenes with given features in the places of their one pair of solids."""

import coal
import numpy as np
import pinocchio as pin
from contact_scenes import POSE_A, POSE_B, free_flyers, random_state

import ngalpha_pin as nga
from ngalpha_pin.collision.features import NORMAL, Feature, face, line, pack, rim
from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.system.system import System

U, W = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.28, 0.96])
C, D = np.array([0.1, -0.2, 0.3]), np.array([-0.2, 0.1, 0.15])
A = {
    "corner": Feature(C),
    "ball": Feature(C, r=0.3),
    "inside": Feature(C, r=-9.0),
    "edge": line(C, U),
    "side": line(C, U, 0.25),
    "rim": rim(C, U, 0.4),
    "ellipsoid": Feature(C, Q=np.diag([0.04, 0.09, 0.16])),
    "face": face(C, U, 0.02),
}
B = {
    "corner": Feature(D),
    "ball": Feature(D, r=0.2),
    "edge": line(D, W),
    "side": line(D, W, 0.15),
    "rim": rim(D, W, 0.3, 0.05),
    "ellipsoid": Feature(D, Q=np.diag([0.09, 0.05, 0.02]), r=0.1),
    "face": face(D, W),
}
STRAIGHT = ("edge", "side", "face")
"""Of which one may meet a face only along itself, where nothing fixes the point."""
ALL = [(a, b) for a in A for b in B if not ("face" in (a, b) and a in STRAIGHT and b in STRAIGHT)]
ALL += ALL[: -len(ALL) % SLOTS]


def feature_system(pairs, arrangement, seed, names=("b", "a"), **law):
    """A scene with the given features in the places of its one pair of solids, and a state of size one."""
    if arrangement == "humanoid":
        model = pin.buildSampleModelHumanoid()
        parents = "rleg_shoulder3_joint", "larm_wrist2_joint"
    else:
        model = free_flyers(1 if arrangement == "fixed" else 2)
        parents = (None if arrangement == "fixed" else "body_1"), "body_0"
    scene = nga.Scene(model)
    scene.add_geometry("a", coal.Box(1, 1, 1), parent=parents[0], placement=POSE_A)
    scene.add_geometry("b", coal.Box(1, 1, 1), parent=parents[1], placement=POSE_B)
    scene.add_contact(*names, **(law or {"mu": 0.4, "contact_radius": 0.2}))
    scene.joints = nga.JointLaws(limits=False)
    system, state = System(scene), random_state(model, seed)
    if arrangement == "humanoid":  # one body is on the deeper joint, the order of the sides stays
        assert system.slots.pairs[0].joints[0] != 0
    # a normal that the iterations find from any nearby state: first that of the centres, then their own
    q = state[0]
    pin.forwardKinematics(model, system.data, q)
    X = system.slots.pose(system.data, 0)
    guess = X.act(D) - C
    for place, (a, b) in enumerate(pairs):
        system.slots.packed[place] = pack(A[a], B[b], guess / np.linalg.norm(guess))
    R = system.data.oMi[system.slots.pairs[0].joints[0]].rotation
    for _ in range(3):
        system.slots.packed[:, NORMAL] = system.rows_of_gaps(system.contacts.subset(np.arange(SLOTS)), q).normals @ R
    return system, *state
