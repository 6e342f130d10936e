"""Collects the steps of a run and lays them out as arrays over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.results.records import Chosen, Impacts
from ngalpha_pin.results.trajectory import CONTACT_ARRAYS, Trajectory
from ngalpha_pin.system.names import names_of
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.stretch import Stretch
from ngalpha_pin.system.system import System

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import ContactTable, Subset
    from ngalpha_pin.scene.scene import Scene

# with more contact points than this, only those that ever carried a force get a column
ALL_COLUMNS = 64
# of joint friction and constraints, in `State`
OTHERS = ("tau_f", "P_f", "la_b", "La_b")


def _count(row: State | Stretch) -> int:
    """States in it."""
    return 1 if isinstance(row, State) else len(row)


def _first(row: State | Stretch) -> State:
    """A state with what all in it have."""
    return row if isinstance(row, State) else row.before


def _put(
    arrays: dict[str, np.ndarray],
    table: ContactTable,
    sub: Subset,
    contacts: np.ndarray,
    steps: np.ndarray,
    values: Any,
) -> None:
    """Write what some contacts have in some steps into the columns of a subset."""
    part = table.subset(contacts)
    N, F = np.searchsorted(sub.index, part.index), np.searchsorted(sub.rows_F, part.rows_F)
    for name, array in arrays.items():
        array[np.ix_(steps, F if name.endswith("F") else N)] = values[name]


class Recorder:
    """The states of a run, one per recorded time.

    Args:
        system: compiled scene.
        state: the start.
        entry: the impact that has led to it, where the scene changed there.
    """

    def __init__(self, system: System, state: State, entry: Impact | None = None):
        self.system, self._entry = system, entry
        self._begin(state)

    def _begin(self, state: State) -> None:
        self._rows: list[State | Stretch] = [state]
        self.n_iter, self.rungs = [0], [SolvedBy.START]
        self._held = [state.tau]  # in the step that ends there
        self.impacts: list[Impact] = []
        self._steps_of_impacts: list[int] = []

    def forget(self) -> None:
        """Begin anew at the last state."""
        self._entry = None
        self._begin(self.state)

    def back_to(self, i: int) -> None:
        """Forget the steps behind state i."""
        n = len(self.n_iter)
        while n > i + 1:
            row = self._rows.pop()
            n -= _count(row)
            if n < i + 1 and isinstance(row, Stretch):
                self._rows.append(row.head(i + 1 - n))
                n = i + 1
        self._cut(n)

    def replace_last(self, state: State) -> None:
        """Put another in the place of the last state."""
        row = self._rows.pop()
        if isinstance(row, Stretch):
            self._rows.append(row.head(len(row) - 1))
        self._rows.append(state)

    def _cut(self, n: int) -> None:
        """Leave out what belongs to none of the first n states."""
        del self.n_iter[n:], self.rungs[n:], self._held[n:]
        whole = sum(step < n for step in self._steps_of_impacts)
        del self.impacts[whole:], self._steps_of_impacts[whole:]

    @property
    def state(self) -> State:
        """The last one."""
        row = self._rows[-1]
        return row if isinstance(row, State) else row[-1].state

    @property
    def start(self) -> State:
        """The first one."""
        return _first(self._rows[0])

    def add(self, result: StepResult) -> None:
        """Take one converged step."""
        self.impacts += result.impacts
        self._steps_of_impacts += len(result.impacts) * [len(self.n_iter)]
        self._held.append(self.state.tau if result.tau is None else result.tau)
        self.rungs.append(result.solved_by)
        self.n_iter.append(result.n_iter)
        self._rows.append(result.state)  # last: where Ctrl-C comes between these lines, the step is none

    def extend(self, steps: Sequence[StepResult]) -> None:
        """Take converged steps; a stretch is kept as it is."""
        if not isinstance(steps, Stretch):
            for step in steps:
                self.add(step)
            return
        n = len(steps)
        self._held += n * [steps.before.tau]
        self.rungs += n * [SolvedBy.NEWTON]
        self.n_iter += steps.n_iter.tolist()
        # the last of them may have forgotten contacts
        self._rows += [steps] if steps.last is None else [steps.head(n - 1), steps.last]

    def __len__(self) -> int:
        """Steps so far."""
        return len(self.n_iter) - 1

    def _column(self, name: str) -> np.ndarray:
        """A field of all states, where it has one length."""
        parts: list[np.ndarray] = []
        for single, rows in groupby(self._rows, lambda row: isinstance(row, State)):
            values = [getattr(row, name) if isinstance(row, State) else row.arrays[name] for row in rows]
            parts += [np.array(values)] if single else values
        return np.concatenate(parts)

    def _slots(self) -> tuple[np.ndarray, np.ndarray]:
        """The places of all states behind one another, and where those of each end; stretches have none."""
        found, counts = [], []
        for row in self._rows:
            found.append(row.slots if isinstance(row, State) else row.before.slots[:0])
            counts += [len(row.slots)] if isinstance(row, State) else len(row) * [0]
        return np.concatenate(found), np.cumsum(counts)

    def _torques(self) -> tuple[np.ndarray, np.ndarray]:
        """What is held from each time on and in the step that ends there; (n, 0) where nothing ever was."""
        now = [tau for row in self._rows for tau in _count(row) * [_first(row).tau]]
        lists = now, self._held
        width = max(len(tau) for values in lists for tau in values)
        held, in_step = (
            np.array([tau if len(tau) == width else np.zeros(width) for tau in values]) for values in lists
        )
        return held, in_step

    def _of_contacts(self, sub: Subset) -> dict[str, Any]:
        """Forces and percussions in the columns of a subset, by name."""
        n, table, at = len(self.n_iter), self.system.contacts, 0
        arrays = {name: np.zeros((n, sub.m if name.endswith("F") else sub.k)) for name in CONTACT_ARRAYS}
        single: dict[bytes, tuple[list[int], list[State]]] = {}
        for row in self._rows:
            if isinstance(row, Stretch):
                _put(arrays, table, sub, row.contacts, at + np.arange(len(row)), row.arrays)
            elif len(row.contacts):
                steps, states = single.setdefault(row.contacts.tobytes(), ([], []))
                steps.append(at)
                states.append(row)
            at += _count(row)
        for steps, states in single.values():
            values = {name: np.array([getattr(state, name) for state in states]) for name in arrays}
            _put(arrays, table, sub, states[0].contacts, np.array(steps), values)
        return arrays

    def _adhesion(self, sub: Subset) -> np.ndarray:
        """Adhesion that acts from each time on, in the columns of a subset."""
        table, at = self.system.contacts, 0
        adhesion = np.zeros((len(self.n_iter), sub.k))
        for row in self._rows if table.adheres else ():
            if isinstance(row, State):  # no stretch holds
                adhesion[at, np.isin(sub.index, row.holding)] = table.adhesion[row.holding]
            at += _count(row)
        return adhesion

    def _columns(self) -> np.ndarray:
        """Numbers of the contacts that get a column."""
        table = self.system.contacts
        if table.n <= ALL_COLUMNS:
            return np.arange(table.n)
        hits = self.impacts + ([] if self._entry is None else [self._entry])
        return np.unique(np.concatenate([x.contacts for x in (*self._rows, *hits)]))

    def trajectory(
        self, scene: Scene, method: str, dt: float, success: bool, message: str, chosen: Chosen | None = None
    ) -> Trajectory:
        """The run so far."""
        self._cut(sum(map(_count, self._rows)))
        columns = self._columns()
        sub = self.system.contacts.subset(columns)
        kb = self.system.constraints.kb
        (tau, tau_step), (slots, slot_ends) = self._torques(), self._slots()
        entry = None if self._entry is None else self._impacts(sub, [self._entry])
        tau_f, P_f, la_b, La_b = (self._column(name) for name in OTHERS)
        counts = np.bincount(sub.of_F, minlength=sub.k)
        ends = np.cumsum(counts)
        rows = tuple(slice(int(end - count), int(end)) for end, count in zip(ends, counts, strict=True))
        return Trajectory(
            scene=scene, method=method, dt=dt, success=success, message=message,
            t=self._column("t"), q=self._column("q"), v=self._column("v"), a=self._column("a"),
            contact_names=sub.names, contact_columns=columns, friction_rows=rows,
            slots=slots, slot_ends=slot_ends,
            constraint_names=self.system.constraints.names, n_g=kb, friction_names=self.system.joint_friction.names,
            la_g=la_b[:, :kb], La_g=La_b[:, :kb], la_gamma=la_b[:, kb:], La_gamma=La_b[:, kb:], tau_f=tau_f, P_f=P_f,
            adhesion=self._adhesion(sub), tau=tau, tau_step=tau_step,
            n_iter=np.array(self.n_iter), solver_path=np.array([rung.value for rung in self.rungs]),
            impacts=self._impacts(sub, self.impacts), entry=entry,
            final_state=replace(self.state, names=names_of(self.system)), chosen=chosen, **self._of_contacts(sub),
        )  # fmt: skip

    def _impacts(self, sub: Subset, hits: list[Impact]) -> Impacts:
        """Located impacts as arrays, with the columns of a subset."""
        system, j = self.system, len(hits)
        step = np.array(self._steps_of_impacts if hits is self.impacts else [0], dtype=int)
        P_N, P_F = np.zeros((j, sub.k)), np.zeros((j, sub.m))
        for i, hit in enumerate(hits):
            part = system.contacts.subset(hit.contacts)
            P_N[i, np.searchsorted(sub.index, part.index)] = hit.P_N
            P_F[i, np.searchsorted(sub.rows_F, part.rows_F)] = hit.P_F
        return Impacts(
            np.array([hit.t for hit in hits]), step,
            np.array([hit.q for hit in hits]).reshape(j, system.nq),
            np.array([hit.v_before for hit in hits]).reshape(j, system.nv),
            np.array([hit.v_after for hit in hits]).reshape(j, system.nv), P_N, P_F,
            np.array([hit.P_b for hit in hits]).reshape(j, system.constraints.kb + system.constraints.mb),
            np.concatenate([self.state.slots[:0], *(hit.slots for hit in hits)]),
            np.cumsum([len(hit.slots) for hit in hits], dtype=int),
        )  # fmt: skip
