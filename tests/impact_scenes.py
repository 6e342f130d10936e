"""Scenes with many impacts and their event-driven references: a rocking block and Newton's cradle with gaps."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import ngalpha_pin as nga

GRAVITY = 9.81
PRECISE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True}
HALF_WIDTH, HALF_HEIGHT, TILT = 0.1, 0.4, 0.15
RADIUS, LENGTH, GAP, RESTITUTION, RAISED = 0.1, 1.0, 2e-3, 0.9, 0.5


def rocking_block(tilt: float = TILT) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """A slender block of 2 kg in the plane, at rest on its right corner, which does not slip; q = (x, z, angle)."""
    model = pin.Model()
    joint = 0
    for kind, name in ((pin.JointModelPX(), "x"), (pin.JointModelPZ(), "z"), (pin.JointModelRY(), "tilt")):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(2.0, 2 * HALF_WIDTH, 0.1, 2 * HALF_HEIGHT), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for side, name in ((1, "right"), (-1, "left")):
        corner = pin.SE3(np.eye(3), np.array([side * HALF_WIDTH, 0.0, -HALF_HEIGHT]))
        scene.add_geometry(name, coal.Sphere(0.0), parent="tilt", placement=corner)
    scene.add_contact("*t", "ground", mu=0.8)
    return scene, block_pose(np.array([tilt]))[0], np.zeros(3)


def block_pose(tilt: np.ndarray) -> np.ndarray:
    """(x, z, angle) of the block whose lower corner does not move; both corners are on the ground at tilt 0."""
    side = np.where(tilt >= 0.0, 1.0, -1.0)
    c, s = np.cos(tilt), np.sin(tilt)
    x = side * HALF_WIDTH - (side * HALF_WIDTH * c - HALF_HEIGHT * s)
    return np.column_stack([x, side * HALF_WIDTH * s + HALF_HEIGHT * c, tilt])


def rocking_block_reference(t: np.ndarray, tilt: float = TILT) -> np.ndarray:
    """Housner's block: rotation about one corner, then about the other; angular momentum about the new one is kept."""
    size = HALF_WIDTH**2 + HALF_HEIGHT**2
    factor = 1.0 - 1.5 * HALF_WIDTH**2 / size

    def rate(_: float, y: np.ndarray, side: float) -> list[float]:
        lever = side * HALF_WIDTH * np.cos(y[0]) - HALF_HEIGHT * np.sin(y[0])
        return [y[1], -GRAVITY * lever / (4.0 / 3.0 * size)]

    def upright(_: float, y: np.ndarray, side: float) -> float:
        return side * y[0] if side * y[1] < 0.0 else 1.0

    upright.terminal, upright.direction = True, -1
    start, y, side, tilts = 0.0, np.array([tilt, 0.0]), 1.0, np.zeros(len(t))
    while start < t[-1]:
        part = solve_ivp(rate, (start, t[-1] + 1e-9), y, args=(side,), events=upright, **PRECISE)
        here = (t >= start) & (t <= part.t[-1])
        if here.any():
            tilts[here] = part.sol(t[here])[0]
        start, side = part.t[-1], -side
        y = np.array([0.0, factor * part.y[1, -1]])
    return block_pose(tilts)


def cradle(gap: float = GAP, e_N: float = RESTITUTION, n: int = 5) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Pendulums side by side, the first one raised; q holds their angles."""
    model = pin.Model()
    for i in range(n):
        place = pin.SE3(np.eye(3), np.array([i * (2 * RADIUS + gap), 0.0, LENGTH]))
        joint = model.addJoint(0, pin.JointModelRY(), place, f"pivot_{i}")
        bob = pin.Inertia(1.0, np.array([0.0, 0.0, -LENGTH]), np.zeros((3, 3)))
        model.appendBodyToJoint(joint, bob, pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    hang = pin.SE3(np.eye(3), np.array([0.0, 0.0, -LENGTH]))
    for i in range(n):
        scene.add_geometry(f"ball_{i}", coal.Sphere(RADIUS), parent=f"pivot_{i}", placement=hang)
    for i in range(n - 1):
        scene.add_contact(f"ball_{i}", f"ball_{i + 1}", e_N=e_N)
    q0 = np.zeros(n)
    q0[0] = RAISED
    return scene, q0, np.zeros(n)


def cradle_reference(t: np.ndarray, gap: float = GAP, e_N: float = RESTITUTION, n: int = 5) -> np.ndarray:
    """Free pendulums between impacts of two neighbours each."""
    pitch = 2 * RADIUS + gap

    def between(y: np.ndarray, i: int) -> np.ndarray:
        ends = [LENGTH * np.array([-np.sin(angle), -np.cos(angle)]) for angle in y[i : i + 2]]
        return ends[1] - ends[0] + np.array([pitch, 0.0])

    def jacobian(y: np.ndarray, i: int) -> np.ndarray:
        line = between(y, i) / np.linalg.norm(between(y, i))
        tangents = [LENGTH * np.array([-np.cos(angle), np.sin(angle)]) for angle in y[i : i + 2]]
        row = np.zeros(n)
        row[i], row[i + 1] = -line @ tangents[0], line @ tangents[1]
        return row

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate((y[n:], -GRAVITY / LENGTH * np.sin(y[:n])))

    def touch(i: int):
        def gap_of_pair(_: float, y: np.ndarray) -> float:
            return float(np.linalg.norm(between(y, i))) - 2 * RADIUS

        gap_of_pair.terminal, gap_of_pair.direction = True, -1
        return gap_of_pair

    start, y, angles = 0.0, np.concatenate(([RAISED], np.zeros(2 * n - 1))), np.zeros((len(t), n))
    while start < t[-1]:
        part = solve_ivp(
            rate, (start, t[-1] + 1e-9), y, events=[touch(i) for i in range(n - 1)], max_step=0.02, **PRECISE
        )
        here = (t >= start) & (t <= part.t[-1])
        if here.any():
            angles[here] = part.sol(t[here])[:n].T
        start, y = part.t[-1], part.y[:, -1].copy()
        for i in range(n - 1):
            if len(part.t_events[i]) and start < t[-1]:
                row = jacobian(y, i)
                y[n:] -= (1 + e_N) * (row @ y[n:]) / (row @ row) * row
    return angles
