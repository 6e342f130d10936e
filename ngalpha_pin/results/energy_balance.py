"""Energy along a run, and where it went: work of friction, of impacts, of joints and of controls, from arrays alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import RECORDED, TINY
from ngalpha_pin.contact.compliant import stored
from ngalpha_pin.results.dampers import storing, work_of_dampers
from ngalpha_pin.results.smooth_steps import powers as powers_of
from ngalpha_pin.results.smooth_steps import smooth_steps, work_of_joint_friction, works

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

LEFT_OVER = "left over"
LATER = 1e-6  # part of a step by which rounding of its gaps moves an impact at its end


class Energy(NamedTuple):
    """Energies over time, each of shape (n + 1,) [J].

    Attributes:
        kinetic: v^T M v / 2.
        potential: of gravity, and of dead loads on beams.
        elastic: stored in the springs and position gains of the forces, in compliant contacts and in beams.
        conserved: every force of the scene stores or removes energy, none can feed it in.
    """

    kinetic: np.ndarray
    potential: np.ndarray
    elastic: np.ndarray
    conserved: bool

    @property
    def total(self) -> np.ndarray:
        """Their sum, shape (n + 1,) [J]."""
        return self.kinetic + self.potential + self.elastic


class Balance(NamedTuple):
    """Work done on the bodies since the start, negative where it is dissipated, each of shape (n + 1,) [J].

    Attributes:
        change: of the energy, kinetic, potential and elastic together.
        friction: of the friction forces, as far as it is lost in slip.
        impact: of the impulsive parts of all contact forces, normal and tangential, likewise.
        surfaces: of the drives of surfaces that move along themselves.
        normal: of the normal forces between impacts, beside what compliant contacts store: their damping, and the error
            of the method.
        joints: of dampers, of the damping of position gains and of dry friction in joints.
        controls: of forces that can feed energy in and of constraints that move.
        scale: largest kinetic energy or exchange of energy, the unit of errors [J].
    """

    change: np.ndarray
    friction: np.ndarray
    impact: np.ndarray
    surfaces: np.ndarray
    normal: np.ndarray
    joints: np.ndarray
    controls: np.ndarray
    scale: float

    @property
    def left_over(self) -> np.ndarray:
        """What the work does not explain: the error of the method and of this account, shape (n + 1,) [J]."""
        work = self.friction + self.impact + self.surfaces + self.normal + self.joints + self.controls
        return self.change - work

    def shares(self) -> dict[str, np.ndarray]:
        """The account by name, work of what acts first, then the change of energy and what is left over [J]."""
        return {
            "friction": self.friction, "impact": self.impact, "surfaces": self.surfaces, "normal forces": self.normal,
            "joints": self.joints, "controls": self.controls, "change of energy": self.change,
            LEFT_OVER: self.left_over,
        }  # fmt: skip

    @property
    def error(self) -> float:
        """Largest part that is left over, relative to the scale [-]."""
        return float(np.abs(self.left_over).max()) / self.scale


def energy(trajectory: Recorded) -> Energy:
    """Energies of a trajectory, from its q and v."""
    system, replay, kept = trajectory.system, trajectory.replay, trajectory.kept
    if kept is not None:
        return Energy(replay.kinetic, replay.potential, kept.elastic, kept.conserved)
    elastic = replay.elastic + stored(system.contacts, trajectory.contact_columns, replay.g_N)
    return Energy(replay.kinetic, replay.potential, elastic, conserved(trajectory))


def elastic_energy(trajectory: Recorded) -> np.ndarray:
    """`Energy.elastic`; where nothing in the scene stores any, without a pass over the run, shape (n + 1,) [J]."""
    if trajectory.kept is not None:
        return trajectory.kept.elastic
    system, law = trajectory.system, trajectory.system.contacts.compliances
    compliant = any(law[i] is not None for i in trajectory.contact_columns.tolist())
    if not (compliant or system.beams is not None or storing(system)):
        return np.zeros(len(trajectory.t))
    return trajectory.energy.elastic


def conserved(trajectory: Recorded) -> bool:
    """`Energy.conserved`, without a pass over the run."""
    if trajectory.kept is not None:
        return trajectory.kept.conserved
    system = trajectory.system
    found = all(force.energy is not None for force in (*system.forces, *system.controls))
    found = found and not any(state.force for state in trajectory.scene.states)
    if system.beams is not None:
        found = found and system.beams.conserved
    return found


def balance(trajectory: Recorded) -> Balance:
    """The balance of energy of a run.

    In a step, contacts are the features of shapes that it was computed with. The work of a located impact is that of
    its percussions on the mean of the velocities just before and just after; the rest of the percussions of the step
    is what the contact forces do before it and after it. Where an open contact closes with an impact that is not
    located, as with the laws of the paper, that moment is the one at which the gap vanishes. Everything else is a
    trapezoid. Dampers take at least what they do along the displacement; where motion is not resolved a trapezoid of
    their power may be far from that, and they are counted with what is between both and closes the account best. So it
    closes to the order of the method. A method without impulsive parts (Moreau's) counts all its friction as friction.
    """
    replay, k, h = trajectory.replay, len(trajectory.contact_columns), np.diff(trajectory.t)
    tau, hits = _moments(trajectory, h)
    smooth, jumps = _works(trajectory, tau, hits, h)
    # impulsive parts without an impact belong to what goes on: after an impact, where slip turns to stick
    calm = ~_impacts(trajectory) & ~hits[:, None]
    smooth, jumps = np.where(calm, smooth + jumps, smooth), np.where(calm, 0.0, jumps)
    _add_located(trajectory, smooth, jumps)
    # a captured impact turns the velocity within its step, of which the displacement says nothing
    captured = hits & ~np.isin(np.arange(1, len(trajectory.t)), trajectory.impacts.step)
    tau, hits = _located_moments(trajectory, tau, hits)
    powers = _integral(replay.damping, replay.damping, h, tau, hits)
    along = np.where(captured, powers, work_of_dampers(trajectory))
    ending, starting = replay.feeding + replay.held
    controls = _integral(starting, ending, h, tau, hits)
    drives, dry, long = _drives(trajectory), _dry_friction(trajectory), smooth_steps(trajectory)
    if len(long.step):
        at = long.step - 1
        smooth[at], drives[at] = works(trajectory, long)
        powers[at], controls[at] = powers_of(trajectory, long)
        along[at] = powers[at]
        if dry.any():
            dry[at] = work_of_joint_friction(trajectory, long)
    controls = controls + _moving_constraints(trajectory, h)
    compliance = np.diff(stored(trajectory.system.contacts, trajectory.contact_columns, replay.g_N))
    normal = smooth[:, :k].sum(axis=1) + compliance
    friction, impacts = smooth[:, k:].sum(axis=1), jumps.sum(axis=1)
    energy = trajectory.energy
    needed = np.diff(energy.total) - (friction + impacts + drives + normal + dry + controls)
    dampers = np.clip(needed, np.minimum(along, powers), np.maximum(along, powers))
    return Balance(
        energy.total - energy.total[0],
        _sum(friction),
        _sum(impacts),
        _sum(drives),
        _sum(normal),
        _sum(dampers + dry),
        _sum(controls),
        max(float(energy.kinetic.max()), float(np.ptp(energy.total)), TINY),
    )


def _works(trajectory: Recorded, tau: np.ndarray, hits: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Work of the contact forces and of their impulsive parts in each step without located impacts, (n, k + m) each."""
    replay, k = trajectory.replay, len(trajectory.contact_columns)
    P, La, la = (np.hstack(pair) for pair in _contact_arrays(trajectory))
    start, end, acceleration = replay.start_rate[1:], replay.rate[1:], replay.acceleration
    if not hits.any():
        mean = (start + end) / 2
        return (P - La)[1:] * mean, La[1:] * mean
    # a contact that is leaving again carries nothing at the end of the step
    speed = RECORDED * max(float(np.abs(replay.rate).max(initial=0.0)), TINY)
    stays = (end[:, :k] <= speed)[:, _contact_of_row(trajectory)]
    on, column = hits[:, None], tau[:, None]
    left = h[:, None] - column
    jump = np.where(on, P[1:] - column * la[:-1] - left * stays * la[1:], La[1:])
    before = np.where(on, start + column * acceleration[:-1], start)
    after = np.where(on, end - left * acceleration[1:], end)
    around = column * la[:-1] * (start + before) / 2 + left * stays * la[1:] * (after + end) / 2
    mean = (before + after) / 2
    return np.where(on, around, (P[1:] - La[1:]) * mean), jump * mean


def _add_located(trajectory: Recorded, smooth: np.ndarray, jumps: np.ndarray) -> None:
    """Replace the works of the steps that have located impacts."""
    replay, judged = trajectory.replay, trajectory.impact_laws
    for i in np.unique(judged.step).tolist():
        j = np.flatnonzero(judged.step == i)
        P = np.concatenate((trajectory.P_N[i], trajectory.P_F[i])) - judged.P[j].sum(axis=0)
        la = np.concatenate((trajectory.la_N[i - 1], trajectory.la_F[i - 1]))
        first = (trajectory.impacts.t[j[0]] - trajectory.t[i - 1]) * la
        jumps[i - 1] = judged.work[j].sum(axis=0)
        smooth[i - 1] = first * (replay.start_rate[i] + judged.before[j[0]]) / 2
        smooth[i - 1] += (P - first) * (judged.after[j[-1]] + replay.rate[i]) / 2


def _drives(trajectory: Recorded) -> np.ndarray:
    """Work in each step of surfaces that move along themselves: friction times their velocity [J]."""
    replay, judged = trajectory.replay, trajectory.impact_laws
    P = np.hstack((trajectory.P_N, trajectory.P_F))
    start, end = replay.start_surface_rate[1:], replay.surface_rate[1:]
    work = -(P[1:] * (start + end) / 2).sum(axis=1)
    for i in np.unique(judged.step).tolist():
        j = np.flatnonzero(judged.step == i)
        la = np.concatenate((trajectory.la_N[i - 1], trajectory.la_F[i - 1]))
        first = (trajectory.impacts.t[j[0]] - trajectory.t[i - 1]) * la
        rest = P[i] - judged.P[j].sum(axis=0) - first
        there = judged.surface_rate[j]
        work[i - 1] = -(first * (start[i - 1] + there[0]) / 2 + rest * (there[-1] + end[i - 1]) / 2).sum()
        work[i - 1] -= (judged.P[j] * there).sum()
    return work


def _located_moments(trajectory: Recorded, tau: np.ndarray, hits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The moments and steps of impacts, with those that are located."""
    step = trajectory.impact_laws.step
    if len(step):
        tau, hits = tau.copy(), hits.copy()
        tau[step[::-1] - 1] = (trajectory.impacts.t - trajectory.t[step - 1])[::-1]  # the first of each step
        hits[step - 1] = True
    return tau, hits


def _contact_of_row(trajectory: Recorded) -> np.ndarray:
    """Contact of each of the rows, normals before friction, shape (k + m,)."""
    k = len(trajectory.contact_columns)
    counts = [rows.stop - rows.start for rows in trajectory.friction_rows]
    return np.concatenate((np.arange(k), np.repeat(np.arange(k), counts)))


def _impacts(trajectory: Recorded) -> np.ndarray:
    """Which rows of contacts have an impact in which step, shape (n, k + m)."""
    found = np.zeros((len(trajectory.t) - 1, len(trajectory.contact_columns)), dtype=bool)
    column = {name: k for k, name in enumerate(trajectory.contact_names)}
    for event in trajectory.events:
        if event.kind == "impact" and event.contact in column:
            found[max(int(np.searchsorted(trajectory.t, event.t)) - 1, 0), column[event.contact]] = True
    return found[:, _contact_of_row(trajectory)]


def _contact_arrays(trajectory: Recorded) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Percussions, impulsive parts and forces, normal and tangential."""
    return (
        (trajectory.P_N, trajectory.P_F),
        (trajectory.La_N, trajectory.La_F),
        (trajectory.la_N, trajectory.la_F),
    )


def _sum(work: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(work)))


def _moments(trajectory: Recorded, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time from the start of each step to the impact in it, and whether an open contact closes with an impact."""
    replay, k = trajectory.replay, len(trajectory.contact_columns)
    closed, La_N = RECORDED * trajectory.system.contacts.length, trajectory.La_N[1:]
    g, g_dot, g_ddot = replay.g_N[:-1], replay.start_rate[1:, :k], replay.acceleration[:-1, :k]
    root = np.sqrt(np.maximum(g_dot**2 - 2 * g * g_ddot, 0.0))
    approach = np.where(root > g_dot, root - g_dot, np.inf)
    when = np.where((g > closed) & (La_N > 0), 2 * g / approach, np.inf).min(axis=1, initial=np.inf)
    hits = when <= h * (1 + LATER)
    return np.where(hits, np.minimum(when, h), h / 2), hits


def _dry_friction(trajectory: Recorded) -> np.ndarray:
    """Work of dry friction in the joints in each step [J]."""
    dofs = trajectory.system.joint_friction.dofs
    if trajectory.P_f.shape[1] != len(dofs):
        return np.zeros(len(trajectory.t) - 1)
    v = trajectory.v[:, dofs]
    return (trajectory.P_f[1:] * (v[1:] + v[:-1]) / 2).sum(axis=1)


def _moving_constraints(trajectory: Recorded, h: np.ndarray) -> np.ndarray:
    """Work in each step of the constraints, zero where they do not move [J]."""
    along = trajectory.replay.along
    power = (np.hstack((trajectory.la_g, trajectory.la_gamma)) * along).sum(axis=1)
    jumps = (np.hstack((trajectory.La_g, trajectory.La_gamma))[1:] * (along[1:] + along[:-1]) / 2).sum(axis=1)
    return h * (power[1:] + power[:-1]) / 2 + jumps


def _integral(starting: np.ndarray, ending: np.ndarray, h: np.ndarray, tau: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Work of each step: a trapezoid, or with an impact in the step a rectangle on either side of it [J].

    Args:
        starting: power at each time in the step that starts there [W].
        ending: in the step that ends there [W].
        h: lengths of the steps [s].
        tau: time to the impact in each [s].
        hits: which have one.
    """
    first, last = starting[:-1], ending[1:]
    return np.where(hits, tau * first + (h - tau) * last, h * (first + last) / 2)
