"""Newton's cradle with gaps and its event-driven reference."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import ngalpha_pin as nga

GRAVITY = 9.81
PRECISE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True}
RADIUS, LENGTH, GAP, RESTITUTION, RAISED = 0.1, 1.0, 2e-3, 0.9, 0.5


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
