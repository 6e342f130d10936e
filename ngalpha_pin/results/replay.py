"""What a scene says along a stored motion: kinematics, energies, powers, and what is left of the equations of motion.

One pass over the recorded times, in chunks: Pinocchio is called time by time, contacts are computed for the times of a
chunk at once. Kept are numbers per contact and time, not matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.results.dampers import stored_and_damped, storing
from ngalpha_pin.results.equations import ROUNDING, Nodes, Unbalance
from ngalpha_pin.results.stacked_times import Motions, TimedContacts, TimedRows, features_at
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation
from ngalpha_pin.system.adhesion import holds
from ngalpha_pin.system.contact_search import smallest_gap

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded
    from ngalpha_pin.system.system import System

# numbers in the matrices of a chunk
CHUNK = 400_000
# rows of norm one count as dependent from this singular value on
RANK = 1e-8


class ConstraintMotion(NamedTuple):
    """What is left of the constraints along a trajectory; all of it should vanish but the rank.

    Attributes:
        g: shape (n + 1, n_g) [m, rad or -].
        rate: g_dot and gamma, shape (n + 1, n_g + n_gamma).
        acceleration: g_ddot and gamma_dot, of the same shape.
        rank: number of independent rows, shape (n + 1,).
        size: largest position that the rows subtract, the yardstick of g, shape (n + 1,) [m, rad or -].
    """

    g: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    rank: np.ndarray
    size: np.ndarray

    @classmethod
    def zero(cls, n: int, n_g: int, b: int) -> ConstraintMotion:
        """At n times, of n_g rows of g and b rows in all."""
        return cls(np.zeros((n, n_g)), np.zeros((n, b)), np.zeros((n, b)), np.zeros(n, dtype=int), np.zeros(n))


@dataclass(frozen=True, eq=False)
class Replay:
    """Arrays over the n + 1 recorded times, k contacts with m friction rows and b rows of constraints.

    Attributes:
        g_N: gaps, shape (n + 1, k) [m or rad].
        rate, acceleration: of the gaps and, behind them, of the slip, shape (n + 1, k + m).
        start_rate: rates at the start of the step that ends at a time, with the features of that step, shape
            (n + 1, k + m); the first row is empty.
        surface_rate, start_surface_rate: the parts of `rate` and `start_rate` that surfaces make which move along
            themselves, likewise.
        surface_acceleration: the derivative of `surface_rate` by time, likewise.
        smallest_gap: see `ContactMotion`, shape (n + 1,) [m].
        constraints: see there.
        along: change of g and gamma with the motion alone, not with time, shape (n + 1, b).
        kinetic, potential, elastic: energies, shape (n + 1,) [J].
        damping, feeding: power of dampers and of what can feed energy in, shape (n + 1,) [W].
        held: what is added to `feeding` in the step that ends at a time and in the one that starts there, where what is
            held in them is not what is held from that time on, shape (2, n + 1) [W].
        unbalance: what is left of the equations of motion.
    """

    g_N: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    start_rate: np.ndarray
    surface_rate: np.ndarray
    start_surface_rate: np.ndarray
    surface_acceleration: np.ndarray
    smallest_gap: np.ndarray
    constraints: ConstraintMotion
    along: np.ndarray
    kinetic: np.ndarray
    potential: np.ndarray
    elastic: np.ndarray
    damping: np.ndarray
    feeding: np.ndarray
    held: np.ndarray
    unbalance: Unbalance


def replay(trajectory: Recorded) -> Replay:
    """The pass over a trajectory."""
    system, n = trajectory.system, len(trajectory.t)
    table, columns = system.contacts, trajectory.contact_columns
    k = len(columns)
    rows, b = k + trajectory.P_F.shape[1], len(trajectory.constraint_names)
    constraints = ConstraintMotion.zero(n, trajectory.n_g, b)
    contacts = TimedContacts(table, columns, system.unilaterals)
    smallest, kinetic, potential, elastic, damping, feeding = np.zeros((6, n))
    found = Replay(
        np.zeros((n, k)), np.zeros((n, rows)), np.zeros((n, rows)), np.zeros((n, rows)), np.zeros((n, rows)),
        np.zeros((n, rows)), np.zeros((n, rows)), smallest, constraints,
        np.zeros((n, b)), kinetic, potential, elastic, damping, feeding,
        np.zeros((2, n)), Unbalance(trajectory),
    )  # fmt: skip
    # what a beam adds to the rows is known at the last place alone
    size = 1 if system.beams is not None else int(np.clip(CHUNK // ((rows + 12) * system.nv + 1), 1, 256))
    for first in range(0, n, size):
        at = np.arange(first, min(first + size, n))
        visit = _Visit(trajectory, at, found)
        end, start = _rows(trajectory, contacts, visit.motions, at)
        found.g_N[at], found.rate[at], found.acceleration[at] = end.g_N, end.rate, end.acceleration
        found.start_rate[at[at < n - 1] + 1] = start.rate[at < n - 1]
        if system.unilaterals is not None:  # own constraints that move with time do work
            own = np.flatnonzero(columns >= table.n_shapes)
            moved = (end.W[:, own] @ visit.motions.v[:, :, None])[:, :, 0] - end.rate[:, own]
            found.feeding[at] += (trajectory.la_N[at][:, own] * moved).sum(axis=1)
        found.surface_rate[at], found.surface_acceleration[at] = end.surface_rate, end.surface_acceleration
        found.start_surface_rate[at[at < n - 1] + 1] = start.surface_rate[at < n - 1]
        found.unbalance.add(visit.nodes, *(_coordinates(system, rows.W) for rows in (end, start)))
    if k == table.n and system.slots.n == 0:
        rigid = np.where(table.soft, np.inf, found.g_N)
        found.smallest_gap[:] = (rigid / table.yardstick).min(axis=1, initial=np.inf) * table.length
    return found


def _rows(
    trajectory: Recorded, contacts: TimedContacts, motions: Motions, at: np.ndarray
) -> tuple[TimedRows, TimedRows]:
    """Rows at some times with the features of the steps that end there, and with those of the steps that start."""
    slots, last = trajectory.system.slots, len(trajectory.t) - 1
    features = [
        features_at(trajectory.slots, trajectory.slot_ends, i, slots.n, slots.open_gap)
        for i in (at, np.minimum(at + 1, last))
    ]
    end = contacts.rows(motions, features[0])
    return end, end if slots.n == 0 else contacts.rows(motions, features[1])


def _coordinates(system: System, W: np.ndarray) -> np.ndarray:
    """Rows in the coordinates of the system; with beams, of one time."""
    return W if system.beams is None else system.coordinate_rows(W[0])[None]


class _Visit:
    """The recorded times of a chunk, one after the other.

    Attributes:
        motions: of the model.
        nodes: what the equations of motion need.
    """

    def __init__(self, trajectory: Recorded, at: np.ndarray, found: Replay):
        self._trajectory, self._system, self._found = trajectory, trajectory.system, found
        system, T, nv = self._system, len(at), trajectory.v.shape[1]
        model = system.model
        self.motions = Motions(
            np.zeros((T, model.nq)), np.zeros((T, model.nv)), np.zeros((T, model.nv)),
            np.zeros((T, 6, model.nv)), np.zeros((T, 6, model.nv)),
            np.zeros((T, model.njoints, 3, 3)), np.zeros((T, model.njoints, 3)), trajectory.t[at],
        )  # fmt: skip
        self.nodes = Nodes(at, *np.zeros((10, T, nv)))
        self._energies = [force.energy for force in storing(system) if force.energy is not None]
        self._loaded = system.loaded() or trajectory.tau.size > 0
        self._searched = system.contacts.n > len(trajectory.contact_columns) or system.slots.n > 0
        self._bound = system.constraints.names if found.along.shape[1] == len(system.constraints.names) else ()
        for row, i in enumerate(at.tolist()):
            self._visit(row, i)

    def _visit(self, row: int, i: int) -> None:
        trajectory, system, nodes, found = self._trajectory, self._system, self.nodes, self._found
        t, q, v, a = float(trajectory.t[i]), trajectory.q[i], trajectory.v[i], trajectory.a[i]
        actuation = self._actuation(i)
        dynamics = system.dynamics(t, q, v, a, actuation)
        before, after = found.unbalance.smooth_changes(i)
        M = dynamics.M @ np.column_stack((a, v, before, after))
        nodes.inertia[row], nodes.before[row], nodes.after[row] = M[:, 0], M[:, 2], M[:, 3]
        nodes.bias[row] = dynamics.residual - M[:, 0]
        nodes.root[row] = np.sqrt(dynamics.M.diagonal())
        self._place(row, q, v, a)
        rounding = ROUNDING * system.rounding(q, dynamics, actuation) / nodes.root[row]
        found.unbalance.rounding[i] = float(rounding.max(initial=0.0))
        own = slice(None) if system.states is None else slice(system.tree.nv)  # states have no energy
        found.kinetic[i], found.potential[i] = 0.5 * v[own] @ M[own, 1], system.potential_energy(q)
        if self._energies or self._loaded or system.beams is not None:
            self._forces(i, t, q, v)
        if trajectory.tau.size:
            self._hold(row, i)
        if self._bound:
            self._constraints(row, i)
        if self._searched:
            system.slots.restore_one(trajectory.slots, trajectory.slot_ends, i)
            found.smallest_gap[i] = smallest_gap(system, q) * system.contacts.length

    def _actuation(self, i: int) -> Actuation:
        tau, pulls = self._trajectory.tau, self._trajectory.adhesion[i] > 0.0
        actuation = Actuation(tau[i]) if tau.size else NO_ACTUATION
        return holds(actuation, self._trajectory.contact_columns[pulls])

    def _place(self, row: int, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        """Keep what Pinocchio has computed."""
        system, motions = self._system, self.motions
        motion = system.motion(v, a)
        motions.q[row], motions.v[row], motions.a[row] = system.kinematic(q), motion.v, motion.a
        motions.J[row], motions.dJ[row] = motion.J, motion.dJ
        rotations, translations = system.poses
        motions.rotation[row], motions.translation[row] = rotations, translations

    def _forces(self, i: int, t: float, q: np.ndarray, v: np.ndarray) -> None:
        """Elastic energy, and the powers of the forces of the scene."""
        system, found, model = self._system, self._found, self._trajectory.scene.model
        if system.beams is not None:
            found.elastic[i], found.damping[i] = system.beams.strain_energy(q), system.beams.damping_power(q, v)
        loads = system.loads(t, q, v, self._actuation(i)._replace(holding=None))  # what holds does no work
        if loads is None:
            return
        nv, q, v = model.nv, q[: model.nq], v[: model.nv]
        stored, damped = stored_and_damped(system, t, q, v)
        found.elastic[i] += sum(energy(q) for energy in self._energies)
        found.damping[i] += damped @ v
        # what is left: laws of the user's own, and what the limits of effort cut off
        found.feeding[i] = (loads[0][:nv] - stored - damped) @ v

    def _hold(self, row: int, i: int) -> None:
        """What is held in the steps on both sides of a time, where that is not what is held from it on."""
        trajectory, system, n = self._trajectory, self._system, self._trajectory.tau.shape[1]
        t, q, v = float(trajectory.t[i]), trajectory.q[i], trajectory.v[i]
        for side, j in enumerate((i, min(i + 1, len(trajectory.t) - 1))):
            if not np.array_equal(trajectory.tau_step[j], trajectory.tau[i]):
                now, in_step = (
                    system.loads(t, q, v, Actuation(tau)) for tau in (trajectory.tau[i], trajectory.tau_step[j])
                )
                assert now is not None and in_step is not None
                more = (in_step[0] - now[0])[:n]
                (self.nodes.held_end, self.nodes.held_start)[side][row, :n] = more
                self._found.held[side, i] = more @ v[:n]

    def _constraints(self, row: int, i: int) -> None:
        """Constraints and their forces."""
        trajectory, system, nodes, found = self._trajectory, self._system, self.nodes, self._found
        rows = system.constraint_rows(float(trajectory.t[i]), trajectory.q[i], trajectory.v[i], trajectory.a[i])
        W, motion = system.directions([rows]), found.constraints
        motion.g[i], motion.rate[i], motion.acceleration[i], motion.size[i] = (
            rows.g, rows.rate, rows.acceleration, rows.sizes[0],
        )  # fmt: skip
        found.along[i] = W @ trajectory.v[i]
        nodes.bound[row] = found.unbalance.constraint_forces(i) @ W
        jumps = found.unbalance.constraint_jumps
        nodes.jump_end[row] = jumps(i) @ W
        if i + 1 < len(trajectory.t):
            nodes.jump_start[row] = jumps(i + 1) @ W
        if np.isfinite(W).all():
            unit = system.constraints.by_group(np.linalg.norm(W, axis=1))
            motion.rank[i] = np.linalg.matrix_rank(W / unit[:, None], tol=RANK)
