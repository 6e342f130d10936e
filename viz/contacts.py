"""Contact points and contact forces at the drawn steps, and whether each contact sticks or slips."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

OPEN, FRICTIONLESS, STICK, SLIP = range(4)
SLIP_RATIO = 1 - 1e-4  # share of mu la_N from which a contact counts as slipping
VISIBLE_FORCE = 1e-6  # share of the reference force below which a contact carries nothing


@dataclass(frozen=True)
class ContactFrames:
    """Contacts of one trajectory at F steps.

    Attributes:
        point: contact points in the world [m], shape (F, n_contacts, 3).
        normal: unit normals, along the force on the second body, shape (F, n_contacts, 3).
        la_N: normal forces [N], shape (F, n_contacts).
        la_F: friction forces in the world [N], shape (F, n_contacts, 3).
        state: OPEN, FRICTIONLESS, STICK or SLIP, shape (F, n_contacts), uint8; a limit of a joint, which has no place
            in the world, counts as open.
    """

    point: np.ndarray
    normal: np.ndarray
    la_N: np.ndarray
    la_F: np.ndarray
    state: np.ndarray


def in_the_world(trajectory: Trajectory) -> np.ndarray:
    """Which contacts have a place in the world, shape (n_contacts,); the others are limits of joints."""
    table = trajectory.system.contacts
    return np.asarray(trajectory.contact_columns) < table.n - len(table.limit_q)


def friction_coefficients(trajectory: Trajectory) -> np.ndarray:
    """Friction coefficient of every contact [-], shape (n_contacts,); 0 without friction."""
    laws = {frozenset((pair.geometry_a, pair.geometry_b)): pair.law for pair in trajectory.scene.contacts}
    by_name = {"/".join(order): law.mu for pair, law in laws.items() for order in (sorted(pair), sorted(pair)[::-1])}
    return np.array([by_name.get(re.sub(r"\[\d+\]", "", name), 0.0) for name in trajectory.contact_names])


def step_forces(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Forces that a picture can show at every step: la_N, la_F, or the mean over the step where there is no la.

    A time-stepping method computes percussions alone; P / dt is its force.

    Returns:
        Normal forces [N], shape (n + 1, n_contacts), and friction forces [N], shape (n + 1, n_F).
    """
    la_N, la_F = np.asarray(trajectory.la_N), np.asarray(trajectory.la_F)
    if la_N.any() or not np.any(trajectory.P_N):
        return la_N, la_F
    dt = np.diff(trajectory.t, prepend=trajectory.t[0])[:, None]
    dt[0] = np.inf
    return trajectory.P_N / dt, trajectory.P_F / dt


def friction_norm(trajectory: Trajectory, values: np.ndarray) -> np.ndarray:
    """Norm of the friction rows of each contact: (n + 1, n_F) -> (n + 1, n_contacts)."""
    norms = [np.linalg.norm(values[:, rows], axis=1) for rows in trajectory.friction_rows]
    return np.stack(norms, axis=1) if norms else np.zeros((len(values), 0))


def reference_force(trajectory: Trajectory) -> float:
    """A force that a long arrow stands for [N]: above most normal forces, and not far below the largest one."""
    la_N = step_forces(trajectory)[0][:, in_the_world(trajectory)]
    la_N = la_N[np.isfinite(la_N)]
    carried = la_N[la_N > VISIBLE_FORCE * max(la_N.max(initial=0.0), 1e-300)]
    return max(float(np.quantile(carried, 0.9)), float(carried.max()) / 5) if carried.size else 0.0


def contact_frames(trajectory: Trajectory, index: np.ndarray) -> ContactFrames:
    """Contact points, directions and forces at chosen steps.

    Args:
        trajectory: any run.
        index: steps, shape (F,).
    """
    n_contacts = len(trajectory.contact_names)
    la_N, la_F = step_forces(trajectory)
    point, normal, friction = (np.zeros((len(index), n_contacts, 3)) for _ in range(3))
    for row, i in enumerate(index if n_contacts else ()):
        point[row], normal[row], directions = trajectory.contact_frames(int(i))
        for k, rows in enumerate(trajectory.friction_rows):
            friction[row, k] = la_F[i, rows] @ directions[rows]
    threshold = VISIBLE_FORCE * max(reference_force(trajectory), 1e-300)
    mu = friction_coefficients(trajectory)
    slips = friction_norm(trajectory, la_F)[index] >= SLIP_RATIO * mu * la_N[index]
    state = np.where(mu > 0, np.where(slips, SLIP, STICK), FRICTIONLESS)
    carries = (la_N[index] > threshold) & in_the_world(trajectory)
    state = np.where(carries, state, OPEN).astype(np.uint8)
    return ContactFrames(point, normal, la_N[index], friction, state)
