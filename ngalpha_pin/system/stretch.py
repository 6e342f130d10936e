"""Steps in a row in which nothing happens, kept as arrays: the state after one of them is made when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from ngalpha_pin.system.state import Auxiliary, SolvedBy, State, StepResult


@dataclass(frozen=True, eq=False, slots=True)
class Stretch(Sequence[StepResult]):
    """The results of n steps of one length with the same contacts.

    Attributes:
        before: the state from which they go on; what they leave as it is, is its.
        dt: length of a step [s].
        contacts: numbers of the contacts, shape (k,).
        arrays: fields of the states and of their `Auxiliary` that change, by name, shapes (n,) and (n, ...).
        n_iter: iterations, shape (n,).
        residual: largest scaled residuals, shape (n,).
        last: end of the last step, where it differs from the arrays: it may have forgotten contacts.
    """

    before: State
    dt: float
    contacts: np.ndarray
    arrays: dict[str, np.ndarray]
    n_iter: np.ndarray
    residual: np.ndarray
    last: State | None = None

    def __len__(self) -> int:
        """Steps."""
        return len(self.n_iter)

    @overload
    def __getitem__(self, i: int) -> StepResult: ...

    @overload
    def __getitem__(self, i: slice) -> list[StepResult]: ...

    def __getitem__(self, i: int | slice) -> StepResult | list[StepResult]:
        """The result of a step, or of several."""
        if isinstance(i, slice):
            return [self[j] for j in range(*i.indices(len(self)))]
        i = range(len(self.n_iter))[i]
        n_iter, residual = int(self.n_iter[i]), float(self.residual[i])
        if self.last is not None and i == len(self.n_iter) - 1:
            return StepResult(self.last, True, n_iter, SolvedBy.NEWTON, residual)
        values = {name: array[i] for name, array in self.arrays.items()}
        take = values.pop
        t, clearance = float(take("t")), float(take("clearance"))
        memory = Auxiliary(take("a_bar"), take("la_N_bar"), take("la_F_bar"), take("tau_f_bar"))
        before = self.before
        state = State(
            t, contacts=self.contacts, memory=memory, near=before.near, clearance=clearance, slots=before.slots,
            tau=before.tau, sampled=before.sampled, dt=self.dt, names=before.names, **values,
        )  # fmt: skip
        return StepResult(state, True, n_iter, SolvedBy.NEWTON, residual)

    def head(self, n: int) -> Stretch:
        """The first n steps, fewer than there are."""
        arrays = {name: array[:n] for name, array in self.arrays.items()}
        return Stretch(self.before, self.dt, self.contacts, arrays, self.n_iter[:n], self.residual[:n])
