"""The judge: residuals of the laws of any trajectory, whoever computed it, from its arrays alone."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.results.impact_audit import judge_impacts

if TYPE_CHECKING:
    from ngalpha_pin.results.trajectory import Trajectory

GAP = 1e-9  # allowed penetration, in parts of the size of the scene
FORCE = 1e-6  # allowed violation of signs and cones, in parts of the typical force
DRIFT = 1e-8  # allowed violation of constraints, in parts of the size and of the speeds of the scene


_JUDGED = ("t", "q", "v", "a", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F", "la_g", "la_gamma", "tau_f")


class AuditRow(NamedTuple):
    """One line: a name, a value with its unit, and the verdict; None is a statement without a limit."""

    name: str
    value: float | str
    unit: str
    ok: bool | None


@dataclass(frozen=True)
class Audit:
    """What can be said of a trajectory.

    Attributes:
        penetration: largest negative gap over the whole run [m].
        cone_violation: largest |la_F| - mu la_N and |P_F| - mu P_N, relative to the typical force or percussion [-].
        sign_violation: largest negative la_N or P_N, relative likewise [-].
        complementarity: largest force at an open contact, relative to the typical force [-]; a percussion counts
            where the contact did not touch at any known moment of its step.
        impact_law: largest residual of the balance of momentum and of the laws (43)-(49) at a located impact [-].
        finite: no array holds a NaN or an infinity; where one does, the other lines mean nothing.
        drift_g: largest |g| [m, rad or -].
        drift_rate: largest |g_dot| and |gamma| in parts of the largest speed of the run [-].
        rank: smallest number of independent rows of the constraints over the run, and the number of rows; a smaller
            rank is no error, the forces are then the smallest change (see `StepEquations.correction`).
        quaternion: largest distance of a unit quaternion from norm one [-].
        energy_rise: largest rise of the energy above an earlier value, relative to the energy exchanged [-], or None
            where a force of the scene can feed energy in. It is the integration error, which falls with dt^2, so no
            limit is set.
        energy_change: energy at the end minus energy at the start [J].
        n_steps, n_iter_mean, n_iter_max: the work.
        rungs: how many steps each rung of the solver ladder solved.
        success, message: whether the run reached its end.
        length: yardstick of the gaps [m].
        span: yardstick of the constraints on position level [m, rad or -].
        chosen: of a run of chosen accuracy, the steps and whether the tolerance was met.
    """

    penetration: float
    cone_violation: float
    sign_violation: float
    complementarity: float
    impact_law: float
    drift_g: float
    drift_rate: float
    rank: tuple[int, int]
    quaternion: float
    finite: bool
    energy_rise: float | None
    energy_change: float
    n_steps: int
    n_iter_mean: float
    n_iter_max: int
    rungs: dict[str, int]
    success: bool
    message: str
    length: float
    span: float
    chosen: tuple[AuditRow, ...] = ()

    def rows(self) -> list[AuditRow]:
        """The audit as a table."""
        rungs = ", ".join(f"{name} {count}" for name, count in self.rungs.items())
        rise = "a force can feed energy in" if self.energy_rise is None else self.energy_rise
        return [
            AuditRow("end", self.message, "", self.success),
            AuditRow("all numbers are finite", "yes" if self.finite else "no", "", self.finite),
            AuditRow("largest penetration", self.penetration, "m", bool(self.penetration <= GAP * self.length)),
            AuditRow("friction outside its cone", self.cone_violation, "rel", self.cone_violation <= FORCE),
            AuditRow("contact that pulls", self.sign_violation, "rel", self.sign_violation <= FORCE),
            AuditRow("force at an open contact", self.complementarity, "rel", self.complementarity <= FORCE),
            *self._constraint_rows(),
            AuditRow("impact against its laws", self.impact_law, "rel", self.impact_law <= FORCE),
            AuditRow("unit quaternions off by", self.quaternion, "-", self.quaternion <= 1e-12),
            AuditRow("rise of energy", rise, "rel", None),
            AuditRow("change of energy", self.energy_change, "J", None),
            AuditRow("steps", str(self.n_steps), "", None),
            *self.chosen,
            AuditRow("iterations per step", f"{self.n_iter_mean:.3g} mean, {self.n_iter_max} worst", "", None),
            AuditRow("solved by", rungs or "-", "", None),
        ]

    def _constraint_rows(self) -> list[AuditRow]:
        rank, rows = self.rank
        if not rows:
            return []
        return [
            AuditRow("constraints on position level", self.drift_g, "m", bool(self.drift_g <= DRIFT * self.span)),
            AuditRow("constraints on velocity level", self.drift_rate, "rel", self.drift_rate <= DRIFT),
            AuditRow("independent constraint rows", f"{rank} of {rows}", "", None),
        ]

    @property
    def ok(self) -> bool:
        """Every line with a limit is within it."""
        return all(row.ok is None or bool(row.ok) for row in self.rows())

    def __str__(self) -> str:
        verdict = {True: "ok", False: "NOT OK", None: ""}
        lines = []
        for name, value, unit, ok in self.rows():
            text = f"{value:.3g} {unit}" if isinstance(value, float) else f"{value} {unit}"
            lines.append(f"{name:<30}{text.strip():<42}{verdict[ok]}".rstrip())
        return "\n".join(lines)


def audit(trajectory: Trajectory) -> Audit:
    """Judge a trajectory."""
    table = trajectory.system.contacts
    mu = table.mu[trajectory.contact_columns]
    motion, steps = trajectory.contact_motion, trajectory.n_iter[1:]
    closed_gap = GAP * table.yardstick[trajectory.contact_columns]
    open_ = motion.g_N > closed_gap
    impact_law, touched = judge_impacts(trajectory, closed_gap)
    touched[0] = True  # what the start of a continued run reports came in a step of the run before
    levels = [(trajectory.la_N, trajectory.la_F, open_), (trajectory.P_N, trajectory.P_F, open_ & ~touched)]
    cone = sign = complementarity = 0.0
    for N, F, without in levels:
        unit = max(float(np.abs(N).max(initial=0.0)), 1e-300)
        size = _norms(F, trajectory.friction_rows)
        cone = max(cone, float((size - mu * np.maximum(N, 0.0)).max(initial=0.0)) / unit)
        sign = max(sign, float((-N).max(initial=0.0)) / unit)
        complementarity = max(complementarity, float(np.abs(np.where(without, N, 0.0)).max(initial=0.0)) / unit)
    constraints = trajectory.constraint_motion
    speed = max(float(np.abs(trajectory.v).max(initial=0.0)), 1e-300)
    energy = trajectory.energy
    total = energy.total
    return Audit(
        penetration=max(0.0, -float(motion.smallest_gap.min())) if table.n else 0.0,
        cone_violation=cone,
        sign_violation=sign,
        complementarity=complementarity,
        impact_law=impact_law,
        drift_g=float(np.abs(constraints.g).max(initial=0.0)),
        drift_rate=float(np.abs(constraints.rate).max(initial=0.0)) / speed,
        rank=(int(constraints.rank.min(initial=len(trajectory.constraint_names))), len(trajectory.constraint_names)),
        quaternion=_quaternion_error(trajectory),
        finite=all(bool(np.isfinite(getattr(trajectory, name)).all()) for name in _JUDGED),
        energy_rise=_rise(energy.kinetic, total) if energy.conserved else None,
        energy_change=float(total[-1] - total[0]),
        n_steps=len(steps),
        n_iter_mean=float(steps.mean()) if len(steps) else 0.0,
        n_iter_max=int(steps.max(initial=0)),
        rungs=dict(Counter(str(r) for r in trajectory.solver_path[1:])),
        success=trajectory.success,
        message=trajectory.message,
        length=table.length,
        span=max(table.length, float(constraints.size.max(initial=0.0))),
        chosen=_chosen(trajectory),
    )


def _chosen(trajectory: Trajectory) -> tuple[AuditRow, ...]:
    """Accuracy that was asked for, step sizes, rejected steps and events."""
    chosen, steps = trajectory.chosen, np.diff(trajectory.t)
    if chosen is None:
        return ()
    sizes = "-"
    if len(steps):
        sizes = f"{steps.min():.2g} shortest, {np.median(steps):.2g} median, {steps.max():.2g} longest"
    missed = f"missed in {len(chosen.unmet)} steps" if chosen.unmet else "met"
    return (
        AuditRow("chosen accuracy", f"rtol {chosen.rtol:g}, atol {chosen.atol:g}, {missed}", "", not chosen.unmet),
        AuditRow("step sizes", sizes, "s", None),
        AuditRow("rejected steps", str(chosen.rejected), "", None),
        AuditRow("located events", str(len(chosen.located)), "", None),
    )


def _norms(F: np.ndarray, rows: tuple[slice, ...]) -> np.ndarray:
    """Norm of the friction of each contact, shape (n + 1, n_contacts)."""
    return np.stack([np.linalg.norm(F[:, s], axis=1) for s in rows], axis=1) if rows else np.zeros((len(F), 0))


def _rise(kinetic: np.ndarray, total: np.ndarray) -> float:
    """Largest rise of the energy above its lowest earlier value, in parts of the energy that was exchanged."""
    unit = max(float(kinetic.max()), float(np.ptp(total)), 1e-300)
    return max(0.0, float((total - np.minimum.accumulate(total)).max())) / unit


def _quaternion_error(trajectory: Trajectory) -> float:
    """Largest distance of a configuration from the one with unit quaternions and (cos, sin) pairs of norm one."""
    model = trajectory.scene.model
    if model.nq == model.nv:
        return 0.0
    return max(float(np.abs(q - pin.normalize(model, q)).max()) for q in trajectory.q[:, : model.nq])
