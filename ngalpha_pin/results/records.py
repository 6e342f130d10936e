"""What a run records beside its arrays over time: located impacts, what a run of chosen accuracy says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ngalpha_pin.results.events import Event

if TYPE_CHECKING:
    from ngalpha_pin.results.replay import ConstraintMotion


class Impacts(NamedTuple):
    """Impacts that were located within their step, j of them, in the order of time.

    Attributes:
        t: times, shape (j,) [s].
        step: the recorded times at which their steps end, as numbers, shape (j,).
        q: configurations, shape (j, nq).
        v_before, v_after: velocities on their two sides, shape (j, nv).
        P_N, P_F: percussions, shapes (j, n_contacts) and (j, n_F) [N s].
        P_b: percussions of the constraints, those of g first, shape (j, n_g + n_gamma).
        slots, slot_ends: features of the pairs of solids at all of them in one array, and where those of each end.
    """

    t: np.ndarray
    step: np.ndarray
    q: np.ndarray
    v_before: np.ndarray
    v_after: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray
    P_b: np.ndarray
    slots: np.ndarray
    slot_ends: np.ndarray


@dataclass(frozen=True, eq=False)
class Chosen:
    """What a run of chosen accuracy says beside its arrays.

    Attributes:
        rtol, atol: what was asked for.
        rejected: number of steps that were tried and not accepted.
        n_evaluations: evaluations of the equations of motion in smooth phases.
        located: changes of contact at their moments.
        unmet: time [s] and contacts of every step that missed the tolerance at the smallest size.
        sampled: only the times that were asked for are recorded, not every step.
        t_events, q_events, v_events: where the events of the user happened, one array per event: shapes (j,),
            (j, nq) and (j, nv).
    """

    rtol: float
    atol: float
    rejected: int
    n_evaluations: int
    located: tuple[Event, ...]
    unmet: tuple[tuple[float, tuple[str, ...]], ...]
    t_events: tuple[np.ndarray, ...]
    q_events: tuple[np.ndarray, ...]
    v_events: tuple[np.ndarray, ...]
    sampled: bool = False

    def to_header(self) -> dict[str, Any]:
        """As plain lists and numbers."""
        values = dict(vars(self))
        for name in ("t_events", "q_events", "v_events"):
            values[name] = [array.tolist() for array in values[name]]
        return values

    @classmethod
    def from_header(cls, values: dict[str, Any]) -> Chosen:
        """The inverse of `to_header`."""
        values = dict(values)
        values["located"] = tuple(Event(*event) for event in values["located"])
        values["unmet"] = tuple((t, tuple(names)) for t, names in values["unmet"])
        for name in ("t_events", "q_events", "v_events"):
            values[name] = tuple(np.array(array) for array in values[name])
        return cls(**values)


class Kept(NamedTuple):
    """What a file says of a run whose scene comes back without its forces and constraints.

    Attributes:
        constraint_motion: see there.
        elastic, conserved: of `Energy`.
        has_forces: the run has forces, which may be functions of the user's own.
    """

    constraint_motion: ConstraintMotion
    elastic: np.ndarray
    conserved: bool
    has_forces: bool
