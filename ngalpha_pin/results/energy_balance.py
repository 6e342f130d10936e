"""Where the energy of a run went: work of friction, of impacts, of joints and of controls, from its arrays alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import Subset
    from ngalpha_pin.results.trajectory import Trajectory

LEFT_OVER = "left over"
OPEN = 1e-9  # a gap beyond this part of the length of the scene is open
LEAVES = 1e-9  # a gap that grows faster than this part of the largest contact velocity


class Balance(NamedTuple):
    """Work done on the bodies since the start, negative where it is dissipated, each of shape (n + 1,) [J].

    Attributes:
        change: of the energy, kinetic, potential and elastic together.
        friction: of the friction forces.
        impact: of the impulsive parts of all contact forces, normal and tangential.
        normal: of the normal forces between impacts, zero but for the error of the method.
        joints: of dampers, of the damping of position gains and of dry friction in joints.
        controls: of forces that can feed energy in and of constraints that move.
        scale: largest kinetic energy or exchange of energy, the unit of errors [J].
    """

    change: np.ndarray
    friction: np.ndarray
    impact: np.ndarray
    normal: np.ndarray
    joints: np.ndarray
    controls: np.ndarray
    scale: float

    @property
    def left_over(self) -> np.ndarray:
        """What the work does not explain: the error of the method and of this account, shape (n + 1,) [J]."""
        return self.change - self.friction - self.impact - self.normal - self.joints - self.controls

    def shares(self) -> dict[str, np.ndarray]:
        """The account by name, work of what acts first, then the change of energy and what is left over [J]."""
        return {
            "friction": self.friction, "impact": self.impact, "normal forces": self.normal, "joints": self.joints,
            "controls": self.controls, "change of energy": self.change, LEFT_OVER: self.left_over,
        }  # fmt: skip

    @property
    def error(self) -> float:
        """Largest part that is left over, relative to the scale [-]."""
        return float(np.abs(self.left_over).max()) / self.scale


def balance(trajectory: Trajectory) -> Balance:
    """The balance of energy of a run.

    Where an open contact closes with an impact within a step, the percussion less what the contact forces la do before
    and after acts at that moment, at which the gap vanishes: its work is that of the mean of the velocities just before
    and just after, which the accelerations carry there from the ends of the step. Everything else is a trapezoid. So
    the account closes to the order of the method. A method without impulsive parts (Moreau's) counts all its friction
    as friction.
    """
    table = trajectory.system.contacts
    sub = table.subset(trajectory.contact_columns)
    k, h = sub.k, np.diff(trajectory.t)
    rate, acceleration = _rates(trajectory, sub)
    tau, hits = _moments(rate[:, :k], acceleration[:, :k], trajectory.g_N, trajectory.La_N[1:], h, OPEN * table.length)
    P, La, la = (np.hstack(pair) for pair in _contact_arrays(trajectory))
    # a contact that is leaving again carries nothing at the end of the step
    speed = LEAVES * max(float(np.abs(rate).max(initial=0.0)), 1e-300)
    stays = (rate[:, :k] <= speed)[:, np.concatenate((np.arange(k), sub.of_F))]
    on, column = hits[:, None], tau[:, None]
    left = h[:, None] - column
    jump = np.where(on, P[1:] - column * la[:-1] - left * stays[1:] * la[1:], La[1:])
    before = np.where(on, rate[:-1] + column * acceleration[:-1], rate[:-1])
    after = np.where(on, rate[1:] - left * acceleration[1:], rate[1:])
    around = column * la[:-1] * (rate[:-1] + before) / 2 + left * stays[1:] * la[1:] * (after + rate[1:]) / 2
    smooth, jumps = np.where(on, around, (P[1:] - La[1:]) * (before + after) / 2), jump * (before + after) / 2
    # impulsive parts without an impact belong to what goes on: after an impact, where slip turns to stick
    calm = ~_impacts(trajectory, sub) & ~hits[:, None]
    smooth, jumps = np.where(calm, smooth + jumps, smooth), np.where(calm, 0.0, jumps)
    dampers, controls = (_integral(power, h, tau, hits) for power in _powers(trajectory))
    joints = dampers + _dry_friction(trajectory)
    energy = trajectory.energy
    total = energy.total
    return Balance(
        total - total[0],
        _sum(smooth[:, k:].sum(axis=1)),
        _sum(jumps.sum(axis=1)),
        _sum(smooth[:, :k].sum(axis=1)),
        _sum(joints),
        _sum(controls + _moving_constraints(trajectory, h)),
        max(float(energy.kinetic.max()), float(np.ptp(total)), 1e-300),
    )


def _impacts(trajectory: Trajectory, sub: Subset) -> np.ndarray:
    """Which rows of contacts have an impact in which step, shape (n, k + m)."""
    found = np.zeros((len(trajectory.t) - 1, sub.k), dtype=bool)
    column = {name: k for k, name in enumerate(trajectory.contact_names)}
    for event in trajectory.events:
        if event.kind == "impact":
            found[max(int(np.searchsorted(trajectory.t, event.t)) - 1, 0), column[event.contact]] = True
    return found[:, np.concatenate((np.arange(sub.k), sub.of_F))]


def _contact_arrays(trajectory: Trajectory) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Percussions, impulsive parts and forces, normal and tangential."""
    return (
        (trajectory.P_N, trajectory.P_F),
        (trajectory.La_N, trajectory.La_F),
        (trajectory.la_N, trajectory.la_F),
    )


def _sum(work: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(work)))


def _rates(trajectory: Trajectory, sub: Subset) -> tuple[np.ndarray, np.ndarray]:
    """g_N_dot and gamma_F, and their rates, shape (n + 1, k + m) each."""
    system, n = trajectory.system, len(trajectory.t)
    rate, acceleration = np.zeros((n, sub.k + sub.m)), np.zeros((n, sub.k + sub.m))
    for i in range(n if sub.k else 0):
        v, a = trajectory.v[i], trajectory.a[i]
        system.dynamics(float(trajectory.t[i]), trajectory.q[i], v, a)
        rows = system.contact_rows(sub, trajectory.q[i], v, a)
        rate[i], acceleration[i] = rows.rate, rows.acceleration
    return rate, acceleration


def _moments(
    rate: np.ndarray, acceleration: np.ndarray, g_N: np.ndarray, La_N: np.ndarray, h: np.ndarray, closed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Time from the start of each step to the impact in it, and whether an open contact closes with an impact."""
    g, g_dot, g_ddot = g_N[:-1], rate[:-1], acceleration[:-1]
    root = np.sqrt(np.maximum(g_dot**2 - 2 * g * g_ddot, 0.0))
    approach = np.where(root > g_dot, root - g_dot, np.inf)
    when = np.where((g > closed) & (La_N > 0), 2 * g / approach, np.inf).min(axis=1, initial=np.inf)
    hits = when <= h * (1 + 1e-6)
    return np.where(hits, np.minimum(when, h), h / 2), hits


def _powers(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Power of the dampers and of the controls, shape (n + 1,) each [W]."""
    system, nv = trajectory.system, trajectory.v.shape[1]
    dampers, controls = np.zeros(len(trajectory.t)), np.zeros(len(trajectory.t))
    at_rest, K, D = np.zeros(nv), np.zeros((nv, nv)), np.zeros((nv, nv))
    laws = (*system.forces, *system.controls)
    for i, (t, q, v) in enumerate(zip(trajectory.t, trajectory.q, trajectory.v, strict=True)):
        loads = system.loads(float(t), q, v)
        if loads is None:
            break
        stored, damped = np.zeros(nv), np.zeros(nv)
        for force in laws:
            if force.energy is not None:
                elastic, tau = np.zeros(nv), np.zeros(nv)
                force.add_to(float(t), q, at_rest, elastic, K, D)
                force.add_to(float(t), q, v, tau, K, D)
                stored, damped = stored + elastic, damped + tau - elastic
        if system.damping is not None:
            damped = damped - system.damping * v
        dampers[i] = damped @ v
        # what is left: laws of the user's own, and what the limits of effort cut off
        controls[i] = (loads[0] - stored - damped) @ v
    return dampers, controls


def _dry_friction(trajectory: Trajectory) -> np.ndarray:
    """Work of dry friction in the joints in each step [J]."""
    dofs = trajectory.system.joint_friction.dofs
    if trajectory.P_f.shape[1] != len(dofs):
        return np.zeros(len(trajectory.t) - 1)
    v = trajectory.v[:, dofs]
    return (trajectory.P_f[1:] * (v[1:] + v[:-1]) / 2).sum(axis=1)


def _moving_constraints(trajectory: Trajectory, h: np.ndarray) -> np.ndarray:
    """Work in each step of the constraints, zero where they do not move [J]."""
    system, t, n = trajectory.system, trajectory.t, len(trajectory.t)
    b = system.constraints.kb + system.constraints.mb
    if b == 0:
        return np.zeros(n - 1)
    along = np.zeros((n, b))
    for i in range(n):
        system.dynamics(float(t[i]), trajectory.q[i], trajectory.v[i], trajectory.a[i])
        rows = system.constraint_rows(float(t[i]), trajectory.q[i], trajectory.v[i], trajectory.a[i])
        along[i] = system.coordinate_rows(rows.W) @ trajectory.v[i]
    power = (np.hstack((trajectory.la_g, trajectory.la_gamma)) * along).sum(axis=1)
    jumps = (np.hstack((trajectory.La_g, trajectory.La_gamma))[1:] * (along[1:] + along[:-1]) / 2).sum(axis=1)
    return h * (power[1:] + power[:-1]) / 2 + jumps


def _integral(power: np.ndarray, h: np.ndarray, tau: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Work of each step: a trapezoid, or with an impact in the step a rectangle on either side of it [J]."""
    first, last = power[:-1], power[1:]
    return np.where(hits, tau * first + (h - tau) * last, h * (first + last) / 2)
