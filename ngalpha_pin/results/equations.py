"""What is left of the equations of motion and of kinematics along a stored motion, whoever computed it.

At every recorded time, (74):                M a + h = W la + W_b la_b
over every recorded step, from v to v':      M (v' - v) + integral of (h - W_b la_b) = W P + W_b La_b
                                             q' - q = integral of v

Integrals are trapezoids. A trapezoid is off by less than a step times the change of what is integrated, as is the
quadrature of any method of the order of time stepping; that is the tolerance. Located impacts are taken out first: they
are judged at their own moments (see `impact_audit`). Where they divide a step, there are trapezoids of h between them:
what turns fast between two impacts of one step may do so at neither end of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from ngalpha_pin.common.tolerances import CLOSED, ROUNDING, TINY
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

# steps on either side whose changes count: what a method remembers of a change dies away over the next steps
NEIGHBOURS = 3
LONG = 3.0  # times the tolerance, for steps that a method of higher order has made as long as it could
# displacements are off by at most h^3 / 3 of the rate of the acceleration (rho_inf = 0), which may vary in the step
DISPLACED = 4.0
CHUNK = 4096  # steps whose displacements are looked at together
# part of the change of all coordinates and forces that one is off by, because contacts and constraints couple them
COUPLED = 0.1
# of what cancels, what is left by the iterations of a step
SOLVED = 1e-6
RESOLVED = 1e-9  # displacement that is none, in parts of the length of the scene or of one radian


class Nodes(NamedTuple):
    """The terms of the equations of motion at some recorded times, each of shape (T, nv).

    Attributes:
        at: numbers of the times, shape (T,).
        inertia: M a.
        bias: h, everything but inertia, contacts, constraints and dry friction.
        root: roots of the diagonal of M, which give coordinates a common unit.
        before, after: M times the change of velocity in the step before and in the step after, without impacts.
        bound: forces W_b la_b of the constraints.
        jump_end, jump_start: their impulsive parts of the step before and of the step after, without impacts.
        held_end, held_start: what is held in the step before and in the step after, less what is held from the time on.
    """

    at: np.ndarray
    inertia: np.ndarray
    bias: np.ndarray
    root: np.ndarray
    before: np.ndarray
    after: np.ndarray
    bound: np.ndarray
    jump_end: np.ndarray
    jump_start: np.ndarray
    held_end: np.ndarray
    held_start: np.ndarray


class Unbalance:
    """Collects what is left, time by time.

    Args:
        trajectory: the run.

    Attributes:
        force, force_unit: what is left of the equations of motion at the recorded times, and the largest of their
            terms, in kinetic scaling, shape (n + 1,) [sqrt(kg) m/s^2].
        root: largest roots of the diagonal of M, shape (nv,).
        impulse, impulse_unit, impulse_change: what is left over the step that ends there, the largest term, and the
            change of the terms within the step, shape (n + 1,) [sqrt(kg) m/s].
        exchange, exchange_change: the largest term and the change of the terms as vectors, not coordinate by
            coordinate: times the velocity they are work, shape (n + 1,) [sqrt(kg) m/s].
        impulsive: impulsive parts of the contact forces in that step, without impacts, likewise.
        bias_change: change of h within the step, shape (n + 1,) [sqrt(kg) m/s^2].
        rounding: of the forces of stiff springs, by that of positions, shape (n + 1,) [sqrt(kg) m/s^2].
    """

    def __init__(self, trajectory: Recorded):
        self._trajectory, self._hits = trajectory, impact_sums(trajectory)
        self._divided = loads_between_impacts(trajectory)
        n = len(trajectory.t)
        self.force, self.force_unit, self.impulse, self.impulse_unit, self.impulse_change = np.zeros((5, n))
        self.exchange, self.exchange_change, self.impulsive, self.bias_change, self.rounding = np.zeros((5, n))
        self.root = np.zeros(trajectory.v.shape[1])
        self._dofs = trajectory.system.joint_friction.dofs if trajectory.tau_f.shape[1] else np.zeros(0, dtype=int)
        self._last: tuple[np.ndarray, ...] | None = None

    def smooth_changes(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Changes of velocity in the steps before and after a time, without located impacts, shape (nv,) each."""
        v, last, jumps = self._trajectory.v, len(self._trajectory.t) - 1, self._hits.jumps
        before = v[i] - v[max(i - 1, 0)]
        after = v[min(i + 1, last)] - v[i]
        return before - jumps.get(i, 0.0), after - jumps.get(i + 1, 0.0)

    def constraint_forces(self, i: int) -> np.ndarray:
        """La_b at a time, shape (b,)."""
        return np.concatenate((self._trajectory.la_g[i], self._trajectory.la_gamma[i]))

    def constraint_jumps(self, i: int) -> np.ndarray:
        """Impulsive parts of the constraints in the step that ends at a time, without those of impacts, shape (b,)."""
        whole = np.concatenate((self._trajectory.La_g[i], self._trajectory.La_gamma[i]))
        return whole - self._hits.of_constraints.get(i, 0.0)

    def percussions(self, at: np.ndarray) -> np.ndarray:
        """Percussions of the contacts in the steps that end at some times, without impacts, shape (T, k + m)."""
        return self._without_impacts(np.hstack((self._trajectory.P_N[at], self._trajectory.P_F[at])), at)

    def _without_impacts(self, P: np.ndarray, at: np.ndarray) -> np.ndarray:
        for row, i in enumerate(at.tolist() if self._hits.of_contacts else ()):
            P[row] -= self._hits.of_contacts.get(i, 0.0)
        return P

    def add(self, nodes: Nodes, W_end: np.ndarray, W_start: np.ndarray) -> None:
        """Take a chunk of times, with the rows of the contacts of the steps that end and that start there."""
        trajectory, at = self._trajectory, nodes.at
        self.root = np.maximum(self.root, nodes.root.max(axis=0))
        la = np.hstack((trajectory.la_N[at], trajectory.la_F[at]))
        held = _acting(la, W_end) + nodes.bound
        held[:, self._dofs] += trajectory.tau_f[at]
        self.force[at] = _size(nodes.inertia + nodes.bias - held, nodes.root)
        self.force_unit[at] = _largest((nodes.inertia, nodes.bias, held), nodes.root)
        La = self._without_impacts(np.hstack((trajectory.La_N[at], trajectory.La_F[at])), at)
        self.impulsive[at] = _size(_acting(La, W_end), nodes.root)
        following = np.minimum(at + 1, len(trajectory.t) - 1)
        given_end = _acting(self.percussions(at), W_end) + nodes.jump_end
        given_start = _acting(self.percussions(following), W_start) + nodes.jump_start
        given_end[:, self._dofs] += trajectory.P_f[at]
        given_start[:, self._dofs] += trajectory.P_f[following]
        load = nodes.bias - nodes.bound
        load_end, load_start = load - nodes.held_end, load - nodes.held_start
        first: tuple[np.ndarray, ...] = (nodes.after, load_start, given_start, nodes.bias)
        if self._last is not None:
            first = tuple(np.concatenate((kept[None], x)) for kept, x in zip(self._last, first, strict=True))
            second = nodes.before, load_end, given_end, nodes.bias
        else:
            second = nodes.before[1:], load_end[1:], given_end[1:], nodes.bias[1:]
        self._steps(at[len(at) - len(second[0]) :], first, second, nodes.root[-len(second[0]) :])
        self._last = tuple(x[-1] for x in first)

    def _steps(
        self, ends: np.ndarray, first: tuple[np.ndarray, ...], second: tuple[np.ndarray, ...], root: np.ndarray
    ) -> None:
        """What is left over the steps that end at some times, from the terms at their two ends."""
        if not len(ends):
            return
        h = (self._trajectory.t[ends] - self._trajectory.t[ends - 1])[:, None]
        (M_0, load_0, P_0, h_0), (M_1, load_1, P_1, h_1) = (x[:-1] for x in first), second
        divided, spread = np.zeros((2, *M_0.shape))
        for row, i in enumerate(ends.tolist()):
            if i in self._divided:
                divided[row], spread[row] = self._divided[i]
        terms = (M_0 + M_1) / 2, h * (load_0 + load_1) / 2 + divided, (P_0 + P_1) / 2
        self.impulse[ends] = _size(terms[0] + terms[1] - terms[2], root)
        self.impulse_unit[ends] = _largest(terms, root)
        self.bias_change[ends] = _size(h_1 - h_0, root)
        hidden = divided * bool(self._trajectory.constraint_names)  # constraint forces between impacts are not recorded
        changes = M_1 - M_0, h * (load_1 - load_0), spread, hidden, P_1 - P_0
        self.impulse_change[ends] = _largest(changes, root)
        self.exchange[ends], self.exchange_change[ends] = (
            np.max([np.linalg.norm(x / root, axis=1) for x in parts], axis=0) for parts in (terms, changes)
        )

    def force_ratio(self) -> np.ndarray:
        """What is left of the equations of motion in parts of their largest term nearby, shape (n + 1,)."""
        trajectory = self._trajectory
        h = np.maximum(np.diff(trajectory.t, prepend=trajectory.t[0]), TINY)
        h[0] = h[1:2].min(initial=np.inf)
        speed = np.abs(trajectory.v * self.root).max(axis=1, initial=0.0)
        # what cancels may be rounding of positions and velocities, as in a flight without forces, or where all is held
        speed = np.maximum(speed, float(self.root.max(initial=0.0)) * trajectory.system.contacts.speed)
        floor = ROUNDING / SOLVED * speed / h
        floor = np.maximum(floor, self.rounding / SOLVED)
        unit = np.maximum(_nearby(self.force_unit), np.maximum(floor, trajectory.system.weight))
        return self.force / np.maximum(unit, TINY)

    def step_ratio(self) -> np.ndarray:
        """What is left over each step in parts of its tolerance, shape (n + 1,); zero where that is not judged.

        An impulse that was not located acts at some moment within its step, along directions that are not recorded: of
        such steps, and of those beside them, whose forces it leaves behind, nothing is said here.
        """
        trajectory, weight = self._trajectory, self._trajectory.system.weight
        chosen, v, h = trajectory.chosen, trajectory.v, np.diff(trajectory.t, prepend=trajectory.t[0])
        speed = np.abs(v * self.root).max(axis=1, initial=0.0)
        unit = SOLVED * np.maximum(_nearby(self.impulse_unit), weight * h) + ROUNDING * speed.max() + TINY
        unit += h * _nearby(self.rounding)
        if chosen is not None:
            # an event may put a velocity that far onto a contact, and bounces of that height are left out
            root = float(self.root.max(initial=0.0))
            height = chosen.atol + chosen.rtol * self._trajectory.system.contacts.length
            unit += (chosen.atol + chosen.rtol * float(np.abs(v).max(initial=0.0))) * root
            unit += np.sqrt(2.0 * weight * root * height)
        ratio = self.impulse / (_widening(self._trajectory) * _nearby(self.impulse_change) + unit)
        return np.where(_nearby(self.impulsive) > unit, 0.0, ratio)


class ImpactSums(NamedTuple):
    """What the located impacts of each step do together, by the number of the time at the end of the step.

    Attributes:
        jumps: of the velocity, shape (nv,) each.
        of_contacts: percussions, shape (k + m,) each.
        of_constraints: likewise, shape (b,) each.
    """

    jumps: dict[int, np.ndarray]
    of_contacts: dict[int, np.ndarray]
    of_constraints: dict[int, np.ndarray]


def impact_sums(trajectory: Recorded) -> ImpactSums:
    """The located impacts, step by step."""
    impacts = trajectory.impacts
    sums = ImpactSums({}, {}, {})
    P = np.hstack((impacts.P_N, impacts.P_F))
    for j, i in enumerate(impacts.step.tolist()):
        for of, value in ((sums.jumps, impacts.v_after[j] - impacts.v_before[j]), (sums.of_contacts, P[j]),
                          (sums.of_constraints, impacts.P_b[j])):  # fmt: skip
            of[i] = of.get(i, 0.0) + value
    return sums


def loads_between_impacts(trajectory: Recorded) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """What trapezoids of h between the located impacts of a step add to one over all of it, shape (nv,) each [N s].

    And by how much h changes in each, times its length: what a stiff damper does after an impact is not resolved.
    """
    system, t, still = trajectory.system, trajectory.t, np.zeros(trajectory.v.shape[1])

    def load(t: float, q: np.ndarray, v: np.ndarray, held: Actuation) -> np.ndarray:
        return system.dynamics(t, q, v, still, held).residual.copy()

    found = {}
    for i, hits in _hits_of_steps(trajectory).items():
        held = Actuation(trajectory.tau_step[i]) if trajectory.tau.size else NO_ACTUATION
        parts = _parts(trajectory, i, hits)
        ends = [
            (t_1 - t_0, load(t_0, q_0, v_0, held), load(t_1, q_1, v_1, held))
            for (t_0, q_0, _, v_0), (t_1, q_1, v_1, _) in pairwise(parts)
        ]
        whole = (t[i] - t[i - 1]) * (ends[0][1] + ends[-1][2])
        added = (sum(h * (first + last) for h, first, last in ends) - whole) / 2
        found[i] = added, sum(h * np.abs(last - first) for h, first, last in ends)
    return found


def _hits_of_steps(trajectory: Recorded) -> dict[int, list[int]]:
    """The located impacts of each step that has some, in the order of time."""
    hits: dict[int, list[int]] = {}
    for j, i in enumerate(trajectory.impacts.step.tolist()):
        hits.setdefault(i, []).append(j)
    return hits


def _parts(trajectory: Recorded, i: int, hits: Sequence[int]) -> list[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
    """Time, configuration, velocity before and after: at both ends of the step that ends at a time, at its impacts."""
    t, q, v, impacts = trajectory.t, trajectory.q, trajectory.v, trajectory.impacts
    parts = [(t[i - 1], q[i - 1], v[i - 1], v[i - 1])]
    parts += [(impacts.t[j], impacts.q[j], impacts.v_before[j], impacts.v_after[j]) for j in hits]
    return [*parts, (t[i], q[i], v[i], v[i])]


def displacement_ratio(trajectory: Recorded) -> np.ndarray:
    """Displacements that the velocities do not explain, in parts of their tolerance, shape (n + 1,).

    Where a joint without bounds turns by more than a quarter in a step, positions do not tell how far: that is not
    judged.

    Between two known moments a displacement is that of the mean velocity, but for the part of the change of velocity
    that is not that of a constant acceleration.
    """
    n, ratio, left = len(trajectory.t), np.zeros(len(trajectory.t)), trajectory.replay.unbalance
    root, h = left.root, np.diff(trajectory.t, prepend=trajectory.t[0])
    for first in range(1, n, CHUNK):
        near = np.arange(max(1, first - NEIGHBOURS), min(n, first + CHUNK + NEIGHBOURS))
        error, change = _displacements(trajectory, near)
        together = COUPLED * np.maximum(_size(change, 1.0 / root), h[near] * left.impulse_change[near])
        together += h[near] * left.impulsive[near]
        allowed = DISPLACED * _nearby(change + together[:, None] / root)
        allowed += _no_displacement(trajectory)
        part = (error / allowed).max(axis=1, initial=0.0)
        inside = (near >= first) & (near < first + CHUNK)
        ratio[near[inside]] = part[inside]
    turns = np.zeros(n, dtype=bool)
    for joint in list(trajectory.system.tree.joints)[1:]:
        if joint.nq != joint.nv:  # whole turns are not seen in its coordinates
            end = joint.idx_v + joint.nv
            axes = 3 if joint.nv > 1 and "Planar" not in joint.shortname() else 1
            omega = np.linalg.norm(trajectory.v[:, end - axes : end], axis=1)
            turns |= h * np.maximum(omega, np.append(omega[0], omega[:-1])) > np.pi / 2
    return np.where((h > 0.0) & ~turns, ratio, 0.0)


def _displacements(trajectory: Recorded, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unexplained displacements in the steps that end at some times, and the tolerance, shape (T, nv) each."""
    system, a, hits = trajectory.system, trajectory.a, _hits_of_steps(trajectory)
    error, change = np.zeros((2, len(ends), a.shape[1]))
    for row, i in enumerate(ends.tolist()):
        for (t_0, q_0, _, v_0), (t_1, q_1, v_1, _) in pairwise(_parts(trajectory, i, hits.get(i, ()))):
            h = t_1 - t_0
            error[row] += np.abs(system.difference(q_0, q_1) - h * (v_0 + v_1) / 2)
            change[row] += h * (np.abs(v_1 - v_0 - h * (a[i - 1] + a[i]) / 2) + h * np.abs(a[i] - a[i - 1]))
    # the coordinates of one joint in space mix as it turns
    for joint in list(system.tree.joints)[1:]:
        if joint.nv > 1:
            own = slice(joint.idx_v, joint.idx_v + joint.nv)
            change[:, own] = change[:, own].max(axis=1, initial=0.0)[:, None]
    return error, change


def _no_displacement(trajectory: Recorded) -> float:
    """Displacement that is none [m or rad]."""
    length, chosen = max(1.0, trajectory.system.contacts.length), trajectory.chosen
    return RESOLVED * length if chosen is None else RESOLVED * length + chosen.atol + chosen.rtol * length


def speed_of_rest(trajectory: Recorded) -> float:
    """Speed that counts as none [m/s], the one that `contact_speed` has for a scene at rest."""
    return CLOSED * trajectory.system.contacts.speed


def speed_made(trajectory: Recorded) -> float:
    """Speed that the forces of a run make of rest in a step [m/s or rad/s]."""
    left, h = trajectory.replay.unbalance, np.diff(trajectory.t, prepend=trajectory.t[0])
    return float((h * left.force_unit).max()) / float(left.root.max(initial=TINY))


def _widening(trajectory: Recorded) -> float:
    return 1.0 if trajectory.chosen is None else LONG


def _nearby(x: np.ndarray) -> np.ndarray:
    """The largest value among neighbours along the first axis."""
    return np.asarray(maximum_filter1d(x, 2 * NEIGHBOURS + 1, axis=0, mode="nearest"))


def _acting(P: np.ndarray, W: np.ndarray) -> np.ndarray:
    """W P at every time, shape (T, nv)."""
    return (P[:, None, :] @ W)[:, 0]


def _size(x: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Largest coordinate in kinetic scaling, shape (T,)."""
    return np.abs(x / root).max(axis=1, initial=0.0)


def _largest(parts: tuple[np.ndarray, ...], root: np.ndarray) -> np.ndarray:
    """Largest coordinate of several vectors in kinetic scaling, shape (T,)."""
    return np.max([_size(x, root) for x in parts], axis=0)
