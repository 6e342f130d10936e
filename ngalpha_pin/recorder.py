"""Collects the steps of a run and lays them out as arrays over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .state import Impact, State, StepResult
from .system import System
from .trajectory import CONTACT_ARRAYS, Impacts, Trajectory

if TYPE_CHECKING:
    from .contact_table import Subset
    from .scene import Scene
    from .simulate import Method

# with more contact points than this, only those that ever carried a force get a column
ALL_COLUMNS = 64
# of joint friction and constraints, in `State`
OTHERS = ("tau_f", "P_f", "la_b", "La_b")


class Recorder:
    """Arrays for n steps, filled as the run goes; what is not reached is cut off.

    Args:
        system: compiled scene.
        state: the start.
        n: number of steps.
    """

    def __init__(self, system: System, state: State, n: int):
        self.system, self.state, self.count = system, state, 0
        self.t, self.n_iter = np.empty(n + 1), np.zeros(n + 1, dtype=int)
        self.q, self.v, self.a = (
            np.empty((n + 1, system.nq)),
            np.empty((n + 1, system.nv)),
            np.empty((n + 1, system.nv)),
        )
        self.rungs = ["start"]
        self.others: dict[str, list[np.ndarray]] = {name: [] for name in OTHERS}
        self.contact_states: list[State | None] = []
        self.impacts: list[Impact] = []
        self._write(state)

    def add(self, result: StepResult) -> None:
        """Take one converged step."""
        self.count += 1
        self.n_iter[self.count] = result.n_iter
        self.rungs.append(result.rung)
        self.impacts += result.impacts
        self._write(result.state)

    def _write(self, state: State) -> None:
        i = self.count
        self.t[i], self.q[i], self.v[i], self.a[i] = state.t, state.q, state.v, state.a
        for name, values in self.others.items():
            values.append(getattr(state, name))
        self.contact_states.append(state if len(state.contacts) else None)
        self.state = state

    def trajectory(self, scene: Scene, method: Method, dt: float, success: bool, message: str) -> Trajectory:
        """The run so far."""
        n = self.count + 1
        table = self.system.contacts
        if table.n <= ALL_COLUMNS:
            columns = np.arange(table.n)
        else:
            used = [s.contacts for s in (*self.contact_states, *self.impacts) if s is not None]
            columns = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=int)
        sub = table.subset(columns)
        arrays = {name: np.zeros((n, sub.m if name.endswith("F") else sub.k)) for name in CONTACT_ARRAYS}
        for i, state in enumerate(self.contact_states):
            if state is None:
                continue
            part = table.subset(state.contacts)
            N, F = np.searchsorted(columns, part.index), np.searchsorted(sub.rows_F, part.rows_F)
            for name, array in arrays.items():
                array[i, F if name.endswith("F") else N] = getattr(state, name)
        kb = self.system.constraints.kb
        tau_f, P_f, la_b, La_b = (np.array(self.others[name]) for name in OTHERS)
        counts = np.bincount(sub.of_F, minlength=sub.k)
        ends = np.cumsum(counts)
        rows = tuple(slice(int(end - count), int(end)) for end, count in zip(ends, counts, strict=True))
        return Trajectory(
            scene=scene, method=repr(method), dt=dt, success=success, message=message,
            t=self.t[:n], q=self.q[:n], v=self.v[:n], a=self.a[:n],
            contact_names=sub.names, contact_columns=columns, friction_rows=rows,
            constraint_names=self.system.constraints.names, n_g=kb, friction_names=self.system.joint_friction.names,
            la_g=la_b[:, :kb], La_g=La_b[:, :kb], la_gamma=la_b[:, kb:], La_gamma=La_b[:, kb:], tau_f=tau_f, P_f=P_f,
            n_iter=self.n_iter[:n], solver_path=np.array(self.rungs), impacts=self._impacts(sub),
            final_state=self.state, **arrays,
        )  # fmt: skip

    def _impacts(self, sub: Subset) -> Impacts:
        """The located impacts as arrays, with the columns of a subset."""
        hits, system, j = self.impacts, self.system, len(self.impacts)
        P_N, P_F = np.zeros((j, sub.k)), np.zeros((j, sub.m))
        for i, hit in enumerate(hits):
            part = system.contacts.subset(hit.contacts)
            P_N[i, np.searchsorted(sub.index, part.index)] = hit.P_N
            P_F[i, np.searchsorted(sub.rows_F, part.rows_F)] = hit.P_F
        return Impacts(
            np.array([hit.t for hit in hits]), np.array([hit.q for hit in hits]).reshape(j, system.nq),
            np.array([hit.v_before for hit in hits]).reshape(j, system.nv),
            np.array([hit.v_after for hit in hits]).reshape(j, system.nv), P_N, P_F,
            np.array([hit.P_b for hit in hits]).reshape(j, system.constraints.kb + system.constraints.mb),
        )  # fmt: skip
