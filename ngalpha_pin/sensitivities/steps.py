"""The derivative of whole steps, along the parts that they are made of.

A part that ends where a gap closes or a slip vanishes has a length that depends on the parameters: what vanishes there
says how. Its end moves accordingly, what happens there happens at another moment, and the part after it is shorter by
as much. Together this is the saltation of an event, of the steps as they were taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import joint_speed
from ngalpha_pin.integrators.parts import Moment, SmoothPart, StraightPart
from ngalpha_pin.sensitivities.averaging import averaging
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import Geometry
from ngalpha_pin.sensitivities.jumps import consistent_derivative, impact_derivative
from ngalpha_pin.sensitivities.smooth import Solved, as_begun, by_start, smooth_derivative, solved_again
from ngalpha_pin.sensitivities.statuses import Status
from ngalpha_pin.sensitivities.step_derivatives import by_step
from ngalpha_pin.sensitivities.tangent import Tangent, still
from ngalpha_pin.sensitivities.ways import ways_of
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import Impact, SolvedBy, State
from ngalpha_pin.system.system import ContactRows, System

Part = SmoothPart | StraightPart | Moment
AT_ONCE = 1e-9  # moments of several contacts whose derivatives differ by more, in parts of them, are not the same


@dataclass
class Report:
    """What is found along the parts of one step.

    Attributes:
        status: the one that says most.
        names: of the contacts that it is about.
        ambiguous: columns without a derivative, shape (p,).
        approach: smallest speed with which a gap closes [m/s]; derivatives grow like one over it.
    """

    status: Status
    names: tuple[str, ...]
    ambiguous: np.ndarray
    approach: float = np.inf

    def note(self, status: Status, names: tuple[str, ...] = ()) -> None:
        """Take what says more than what was there."""
        if status.severity > self.status.severity:
            self.status, self.names = status, names


class Steps:
    """Takes tangents through steps.

    Args:
        system: compiled scene; its steps must have been taken without the engine's own, see `SmoothPart`.
        parameters: of the method.
        columns: what the columns change beside the start.
    """

    def __init__(self, system: System, parameters: Parameters, columns: Columns):
        self.geometry, self._system, self._parameters, self.columns = Geometry(system), system, parameters, columns

    def start(self, state: State, q: np.ndarray, v: np.ndarray) -> Tangent:
        """The tangent of a consistent state, by that of its motion, shape (nv, p) each."""
        return consistent_derivative(self.geometry, state, still(self._system, q, v), self.columns)[0]

    def begun_anew(self, after: State, S: Tangent) -> Tangent:
        """The tangent where what is held has jumped, see `restart.after_jump`."""
        new = consistent_derivative(self.geometry, after, still(self._system, S.q, S.v, S.t), self.columns)[0]
        old = S.of(self._system, after.contacts)
        return replace(
            new,
            a_bar=new.a + old.a_bar - old.a,
            la_bar=new.la + old.la_bar - old.la,
            tau_f_bar=new.tau_f + old.tau_f_bar - old.tau_f,
            dt=S.dt,
        )

    def through(self, parts: tuple[Part, ...], S: Tangent) -> tuple[Tangent, Report]:
        """The tangent at the end of a step."""
        report = Report(Status.SMOOTH, (), np.zeros(S.p, dtype=bool))
        leading: list[SmoothPart | StraightPart] = []
        for part, following in zip(parts, (*parts[1:], None), strict=True):
            if isinstance(part, Moment):
                S = self._until(leading, part, S, report) if leading else self._after(part, S, report)
                leading = []
            elif self._leads(part, following, parts):
                leading.append(part)
            else:
                S = self._along(part, S, -S.t, report)
        return replace(S, t=np.zeros(S.p)), report

    def _leads(self, part: SmoothPart | StraightPart, following: Part | None, parts: tuple[Part, ...]) -> bool:
        """The motion of a part leads to a moment, at once or with a straight line between them."""
        if isinstance(following, StraightPart) and isinstance(part, SmoothPart):
            at = next(i for i, other in enumerate(parts) if other is following) + 1
            following = parts[at] if at < len(parts) and following.start is part.end else None
        return isinstance(following, Moment) and following.kind is not SolvedBy.START

    def _along(self, part: SmoothPart | StraightPart, S: Tangent, d_dt: np.ndarray, report: Report) -> Tangent:
        """The tangent at the end of a part."""
        if isinstance(part, StraightPart):
            return self._straight(part, S, d_dt)
        solved = solved_again(self._system, self._parameters, part)
        if solved.restarts:
            S = self._restarted(solved, S, d_dt, report)
        else:
            S = as_begun(self._system, solved, S, d_dt)
        end, dependent = smooth_derivative(self.geometry, solved, S, d_dt, self.columns)
        names = self._system.contacts.names
        if dependent:
            report.note(Status.DEPENDENT, tuple(names[i] for i in part.contacts))
        new = np.setdiff1d(part.end.contacts[part.end.La_N != 0.0], part.start.contacts)
        if len(new):
            report.note(Status.CAPTURED, tuple(names[i] for i in new))
        return end

    def _straight(self, part: StraightPart, S: Tangent, d_dt: np.ndarray) -> Tangent:
        system, start = self._system, part.start
        way = part.dt * start.v
        q = S.q if system.flat else by_start(system, start.q, way) @ S.q
        T = by_step(system, start.q, way)
        # of the smooth motion: with a longer line, dt^2 / 2 a counts
        q = q + T @ (part.dt * S.v + 0.5 * part.dt**2 * S.a + np.outer(part.end.v, d_dt))
        return replace(S, q=q, v=S.v + part.dt * S.a + np.outer(start.a, d_dt), t=S.t + d_dt)

    def _restarted(self, solved: Solved, S: Tangent, d_dt: np.ndarray, report: Report) -> Tangent:
        """The tangent of a start with averaged accelerations and forces."""
        inertia = averaging(self._system, solved.equations.parameters, solved.start, solved.part.dt, self.columns, S.p)
        begun, determined = consistent_derivative(
            self.geometry, solved.start, replace(S, dt=d_dt), self.columns, inertia
        )
        if not determined:
            report.note(Status.DEPENDENT)
        return begun.of(self._system, solved.part.contacts)

    def _until(self, leading: list[SmoothPart | StraightPart], moment: Moment, S: Tangent, report: Report) -> Tangent:
        """The tangent after a moment that the motion of one or two parts leads to: the first is as long as it takes."""
        one = np.append(np.zeros(S.p), 1.0)
        wide = S.widened()
        for part in leading:
            wide = self._along(part, wide, one, report)
            one = np.zeros_like(one)
        if moment.kind is SolvedBy.IMPACT:
            assert moment.hit is not None
            dh = self._closing(moment, moment.hit, wide, report)
        else:
            dh = self._stopping(leading[-1], moment, wide)
            report.note(Status.SWITCH)
        return self._after(moment, wide.folded(dh), report)

    def _after(self, moment: Moment, S: Tangent, report: Report) -> Tangent:
        """The tangent after a moment, by that before it."""
        if moment.kind is SolvedBy.START:
            report.note(Status.SWITCH)
        motion, determined = still(self._system, S.q, S.v, S.t), True
        if moment.hit is not None:
            motion, determined = impact_derivative(self.geometry, moment.hit, S, self.columns)
        after, known = consistent_derivative(self.geometry, moment.after, motion, self.columns)
        if not (determined and known):
            report.note(Status.DEPENDENT, tuple(self._system.contacts.names[i] for i in moment.after.contacts))
        return after

    def _closing(self, moment: Moment, hit: Impact, wide: Tangent, report: Report) -> np.ndarray:
        """Change of the moment at which a gap closes, shape (p,)."""
        system, before = self._system, moment.before
        sub = system.contacts.subset(hit.contacts)
        carried = before.contacts[before.auxiliary.la_N_bar != 0.0]
        new = np.flatnonzero((hit.P_N > 0.0) & ~np.isin(hit.contacts, carried))
        if not len(new):
            new = np.flatnonzero(hit.P_N > 0.0)
        changes = self._gap_changes(sub, before, wide)[new]
        if not len(new):
            return np.zeros(wide.p - 1)
        report.note(Status.IMPACT, tuple(sub.names[i] for i in new))
        fall = changes[:, -1]
        report.approach = min(report.approach, float(np.abs(fall).min()))
        moments = -changes[:, :-1] / fall[:, None]
        apart = np.ptp(moments, axis=0) > AT_ONCE * (1.0 + np.abs(moments).max(initial=0.0))
        if apart.any():
            rebounds = bool(sub.e[new].any())
            report.note(Status.AMBIGUOUS if rebounds else Status.SIMULTANEOUS, tuple(sub.names[i] for i in new))
            if rebounds:
                report.ambiguous |= apart
        dh: np.ndarray = moments[0]
        return dh

    def _gap_changes(self, sub: Subset, before: State, wide: Tangent) -> np.ndarray:
        """Change of the gaps of some contacts, shape (k, p)."""
        system, zero = self._system, np.zeros(self._system.nv)
        if system.slots.n:
            system.slots.restore(before.slots)
        system.dynamics(before.t, before.q, before.v, zero)
        rows = system.contact_rows(sub, before.q, before.v, zero, before.t)
        changes: np.ndarray = system.directions([rows])[: sub.k] @ wide.q
        ways = ways_of(self.geometry, sub, rows, before.v, zero, self.columns, wide.p)
        return changes if ways is None else changes + ways.gaps

    def _stopping(self, part: SmoothPart | StraightPart, moment: Moment, wide: Tangent) -> np.ndarray:
        """Change of the moment at which a slip ends, shape (p,)."""
        system = self._system
        sub = system.contacts.subset(part.start.contacts)
        slips, ends, changes = [], [], []
        if sub.m:
            slip, _, rows = self._slip_changes(sub, part.start, None)
            end, change, _ = self._slip_changes(sub, moment.before, wide)
            for i in range(sub.k):
                at = np.flatnonzero(sub.of_F == i)
                speed = float(np.linalg.norm(slip[at]))
                if speed > contact_speed(system, rows):
                    slips.append(speed)
                    ends.append(abs(float(slip[at] @ end[at])) / speed)
                    changes.append(slip[at] @ change[at] / speed)
        for dof in system.joint_friction.dofs:
            if abs(part.start.v[dof]) > joint_speed(system):
                slips.append(abs(float(part.start.v[dof])))
                ends.append(abs(float(moment.before.v[dof])))
                changes.append(wide.v[dof] * np.sign(part.start.v[dof]))
        stops = int(np.argmin(np.array(ends) / np.array(slips)))
        dh: np.ndarray = -changes[stops][:-1] / changes[stops][-1]
        return dh

    def _slip_changes(
        self, sub: Subset, state: State, wide: Tangent | None
    ) -> tuple[np.ndarray, np.ndarray, ContactRows]:
        """Slip of some contacts, shape (m,), its change, shape (m, p), and their rows."""
        system, zero = self._system, np.zeros(self._system.nv)
        if system.slots.n:
            system.slots.restore(state.slots)
        system.dynamics(state.t, state.q, state.v, zero)
        rows = system.contact_rows(sub, state.q, state.v, zero, state.t)
        if wide is None:
            return rows.rate[sub.k :].copy(), np.zeros((sub.m, 0)), rows
        change = system.directions([rows]) @ wide.v
        change += self.geometry.rates(state.t, sub, state.q, state.v)[: sub.k + sub.m] @ wide.q
        system.dynamics(state.t, state.q, state.v, zero)
        ways = ways_of(self.geometry, sub, rows, state.v, zero, self.columns, wide.p)
        if ways is not None:
            change += np.einsum("rkp,k->rp", ways.W, state.v)
        return rows.rate[sub.k :].copy(), change[sub.k :], rows
