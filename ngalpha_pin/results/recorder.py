"""Collects the steps of a run and lays them out as arrays over time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.results.records import Chosen, Impacts
from ngalpha_pin.results.trajectory import CONTACT_ARRAYS, Trajectory
from ngalpha_pin.system.names import names_of
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import Subset
    from ngalpha_pin.scene.scene import Scene

# with more contact points than this, only those that ever carried a force get a column
ALL_COLUMNS = 64
# of joint friction and constraints, in `State`
OTHERS = ("tau_f", "P_f", "la_b", "La_b")


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
        self.states, self.n_iter, self.rungs = [state], [0], [SolvedBy.START]
        self._held = [state.tau]  # in the step that ends there
        self.impacts: list[Impact] = []
        self._steps_of_impacts: list[int] = []

    def forget(self) -> None:
        """Begin anew at the last state."""
        self._entry = None
        self._begin(self.state)

    def back_to(self, i: int) -> None:
        """Forget the steps behind state i."""
        del self.states[i + 1 :]
        self._cut()

    def _cut(self) -> None:
        """Leave out what belongs to no recorded state."""
        n = len(self.states)
        del self.n_iter[n:], self.rungs[n:], self._held[n:]
        whole = sum(step < n for step in self._steps_of_impacts)
        del self.impacts[whole:], self._steps_of_impacts[whole:]

    @property
    def state(self) -> State:
        """The last one."""
        return self.states[-1]

    def add(self, result: StepResult) -> None:
        """Take one converged step."""
        self.n_iter.append(result.n_iter)
        self.rungs.append(result.solved_by)
        self._held.append(self.state.tau if result.tau is None else result.tau)
        self.impacts += result.impacts
        self._steps_of_impacts += len(result.impacts) * [len(self.states)]
        self.states.append(result.state)  # last: where Ctrl-C comes between these lines, the step is none

    def __len__(self) -> int:
        """Steps so far."""
        return len(self.states) - 1

    def _by_contacts(self) -> dict[bytes, list[int]]:
        """Which states have the same contacts, of those that have any."""
        found: dict[bytes, list[int]] = {}
        for i, state in enumerate(self.states):
            if len(state.contacts):
                found.setdefault(state.contacts.tobytes(), []).append(i)
        return found

    def _column(self, name: str) -> np.ndarray:
        return np.array([getattr(state, name) for state in self.states])

    def _torques(self) -> tuple[np.ndarray, np.ndarray]:
        """What is held from each time on and in the step that ends there; (n, 0) where nothing ever was."""
        lists = [state.tau for state in self.states], self._held
        width = max(len(tau) for values in lists for tau in values)
        held, in_step = (
            np.array([tau if len(tau) == width else np.zeros(width) for tau in values]) for values in lists
        )
        return held, in_step

    def trajectory(
        self, scene: Scene, method: str, dt: float, success: bool, message: str, chosen: Chosen | None = None
    ) -> Trajectory:
        """The run so far."""
        self._cut()
        n = len(self.states)
        table = self.system.contacts
        if table.n <= ALL_COLUMNS:
            columns = np.arange(table.n)
        else:
            hits = self.impacts + ([] if self._entry is None else [self._entry])
            used = [s.contacts for s in self.states] + [hit.contacts for hit in hits]
            columns = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=int)
        sub = table.subset(columns)
        arrays: dict[str, Any] = {
            name: np.zeros((n, sub.m if name.endswith("F") else sub.k)) for name in CONTACT_ARRAYS
        }
        for contacts, steps in self._by_contacts().items():
            part = table.subset(np.frombuffer(contacts, dtype=int))
            N, F = np.searchsorted(columns, part.index), np.searchsorted(sub.rows_F, part.rows_F)
            for name, array in arrays.items():
                values = [getattr(self.states[i], name) for i in steps]
                array[np.ix_(np.array(steps), F if name.endswith("F") else N)] = values
        adhesion = np.zeros((n, sub.k))
        for i, state in enumerate(self.states if table.adheres else ()):
            adhesion[i, np.isin(columns, state.holding)] = table.adhesion[state.holding]
        kb = self.system.constraints.kb
        tau, tau_step = self._torques()
        entry = None if self._entry is None else self._impacts(sub, [self._entry])
        tau_f, P_f, la_b, La_b = (self._column(name) for name in OTHERS)
        counts = np.bincount(sub.of_F, minlength=sub.k)
        ends = np.cumsum(counts)
        rows = tuple(slice(int(end - count), int(end)) for end, count in zip(ends, counts, strict=True))
        return Trajectory(
            scene=scene, method=method, dt=dt, success=success, message=message,
            t=self._column("t"), q=self._column("q"), v=self._column("v"), a=self._column("a"),
            contact_names=sub.names, contact_columns=columns, friction_rows=rows,
            slots=np.concatenate([state.slots for state in self.states]),
            slot_ends=np.cumsum([len(state.slots) for state in self.states]),
            constraint_names=self.system.constraints.names, n_g=kb, friction_names=self.system.joint_friction.names,
            la_g=la_b[:, :kb], La_g=La_b[:, :kb], la_gamma=la_b[:, kb:], La_gamma=La_b[:, kb:], tau_f=tau_f, P_f=P_f,
            adhesion=adhesion, tau=tau, tau_step=tau_step,
            n_iter=np.array(self.n_iter), solver_path=np.array([rung.value for rung in self.rungs]),
            impacts=self._impacts(sub, self.impacts), entry=entry,
            final_state=replace(self.state, names=names_of(self.system)), chosen=chosen, **arrays,
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
