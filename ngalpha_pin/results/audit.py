"""The judge: residuals of the laws of any trajectory, whoever computed it, from its arrays alone."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.results.energy_audit import GAIN, EnergyVerdict, judge_energy
from ngalpha_pin.results.equations import SOLVED, displacement_ratio, speed_made, speed_of_rest
from ngalpha_pin.results.impact_audit import GAP, ImpactLaws, judge_impacts
from ngalpha_pin.results.law_audit import judge_contacts

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

FORCE = 1e-6  # allowed violation of signs and cones, in parts of the force or of the typical one
SWEPT = 1e-4  # the same of a method on velocity level, whose sweeps end earlier
UNIT = 1e-12  # what quaternions may be off their length: each step normalises them
DRIFT = 1e-8  # allowed violation of constraints, in parts of the size and of the speeds of the scene


_JUDGED = ("t", "q", "v", "a", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F", "la_g", "La_g", "la_gamma", "La_gamma",
           "tau_f", "P_f")  # fmt: skip


class AuditRow(NamedTuple):
    """One line: a name, a value with its unit, and the verdict; None is a statement without a limit."""

    name: str
    value: float | str
    unit: str
    ok: bool | None

    def cells(self) -> list[Any]:
        """Name, value as text, unit and verdict."""
        text = f"{self.value:.3g}" if isinstance(self.value, float) else str(self.value)
        return [self.name, text, self.unit, self.ok]


def _limited(name: str, value: float, unit: str, limit: float) -> AuditRow:
    """A line with a limit, which a value that is not a number is never within."""
    return AuditRow(name, value + 0.0, unit, bool(value <= limit))  # no minus before zero


@dataclass(frozen=True)
class Audit:
    """What can be said of a trajectory.

    Attributes:
        penetration: largest negative gap over the whole run [m].
        cone_violation: largest |la_F| - mu la_N and |P_F| - mu P_N, in parts of that force or percussion [-].
        sign_violation: largest negative la_N or P_N, relative to the typical one [-].
        complementarity: largest force at an open contact, relative likewise [-]; a percussion counts where the contact
            did not touch at any known moment of its step.
        slip_law: largest distance of the friction of a slipping contact from mu times the normal force against the
            slip, of forces and of percussions, in parts of that [-].
        impact_law: largest residual of the balance of momentum and of the laws (43)-(49) at a located impact [-].
        forces: what is left of the equations of motion at a recorded time, in parts of their largest term [-], or None
            where the method has no forces but percussions (Moreau's) or a file does not have all forces.
        impulses, displacements: what is left over a recorded step of the equations of motion, and of the displacement
            that the velocities give, in parts of their tolerances (see `equations`) [-]; None where steps between
            recorded times are not known.
        finite: no array holds a NaN or an infinity; where one does, nothing else is judged.
        drift_g: largest |g| [m, rad or -].
        drift_rate: largest |g_dot| and |gamma| in parts of the largest speed of the run, or of the one that the forces
            of the run make in a step, or of one of which 1e-8 counts as rest in a scene of that size [-].
        rank: smallest number of independent rows of the constraints over the run, and the number of rows; a smaller
            rank is no error, the forces are then the smallest change (see `StepEquations.correction`).
        quaternion: largest distance of a unit quaternion from norm one [-].
        energy: the verdict on energy.
        n_steps, n_iter_mean, n_iter_max: the work.
        rungs: how many steps each rung of the solver ladder solved.
        success, message: whether the run reached its end.
        length: yardstick of the gaps [m].
        span: yardstick of the constraints on position level [m, rad or -].
        moved: displacement of a step, which the positions of a method on velocity level are off by [m or rad].
        chosen: of a run of chosen accuracy, the steps and whether the tolerance was met.
        compliance: largest distance of the normal forces of compliant contacts from their laws, in parts of the largest
            of these forces [-]; None where there are none.
    """

    penetration: float
    cone_violation: float
    sign_violation: float
    complementarity: float
    slip_law: float
    impact_law: float
    forces: float | None
    impulses: float | None
    displacements: float | None
    drift_g: float
    drift_rate: float
    rank: tuple[int, int]
    quaternion: float
    finite: bool
    energy: EnergyVerdict
    n_steps: int
    n_iter_mean: float
    n_iter_max: int
    rungs: dict[str, int]
    success: bool
    message: str
    length: float
    span: float
    moved: float = 0.0
    chosen: tuple[AuditRow, ...] = ()
    compliance: float | None = None

    def rows(self) -> list[AuditRow]:
        """The audit as a table."""
        rungs = ", ".join(f"{name} {count}" for name, count in self.rungs.items())
        finite = AuditRow("all numbers are finite", "yes" if self.finite else "no", "", bool(self.finite))
        end = AuditRow("end", self.message, "", bool(self.success))
        return [
            end,
            finite,
            *(self._judged() if self.finite else []),
            AuditRow("steps", str(self.n_steps), "", None),
            *self.chosen,
            AuditRow("iterations per step", f"{self.n_iter_mean:.3g} mean, {self.n_iter_max} worst", "", None),
            AuditRow("solved by", rungs or "-", "", None),
        ]

    def _judged(self) -> list[AuditRow]:
        rows = [
            _limited("largest penetration", self.penetration, "m", GAP * self.length + self.moved),
            _limited("friction outside its cone", self.cone_violation, "rel", SWEPT if self.moved else FORCE),
            _limited("contact that pulls", self.sign_violation, "rel", FORCE),
            _limited("force at an open contact", self.complementarity, "rel", FORCE),
            _limited("friction against the slip", self.slip_law, "rel", FORCE),
            _limited("impact against its laws", self.impact_law, "rel", FORCE),
        ]
        if self.compliance is not None:
            rows.append(_limited("compliant forces off their laws", self.compliance, "rel", FORCE))
        for name, value, unit, limit in (
            ("equations of motion", self.forces, "rel", SOLVED),
            ("momentum over a step", self.impulses, "of its tolerance", 1.0),
            ("displacement over a step", self.displacements, "of its tolerance", 1.0),
        ):
            rows.append(AuditRow(name, "not known", "", None) if value is None else _limited(name, value, unit, limit))
        return [*rows, *self._constraint_rows(), *self._energy_rows()]

    def _constraint_rows(self) -> list[AuditRow]:
        rank, rows = self.rank
        quaternion = _limited("unit quaternions off by", self.quaternion, "-", UNIT)
        if not rows:
            return [quaternion]
        return [
            _limited("constraints on position level", self.drift_g, "m", DRIFT * self.span + self.moved),
            _limited("constraints on velocity level", self.drift_rate, "rel", DRIFT + self.moved / self.span),
            AuditRow("independent constraint rows", f"{rank} of {rows}", "", None),
            quaternion,
        ]

    def _energy_rows(self) -> list[AuditRow]:
        energy = self.energy
        rows = []
        if energy.closes is not None:
            rows.append(AuditRow("energy that no work explains", energy.left_over, "rel", energy.closes))
        rise: float | str = "a force can feed energy in" if energy.falls is None else energy.rise
        rows += [
            AuditRow("rise of energy", rise, "" if energy.falls is None else "rel", energy.falls),
            _limited("energy that an impact adds", energy.gain, "rel", GAIN),
        ]
        if energy.cause:
            rows.append(AuditRow("cause of the energy", energy.cause, "", None))
        return [*rows, AuditRow("change of energy", energy.change, "J", None)]

    @property
    def energy_rise(self) -> float | None:
        """Largest rise of the energy in parts of the energy exchanged [-]; None where a force can feed energy in."""
        return None if self.energy.falls is None else self.energy.rise

    @property
    def energy_change(self) -> float:
        """Energy at the end minus energy at the start [J]."""
        return self.energy.change

    @property
    def ok(self) -> bool:
        """Every line with a limit is within it."""
        return all(row.ok is None or row.ok for row in self.rows())

    def __str__(self) -> str:
        verdict = {True: "ok", False: "NOT OK", None: ""}
        cells = [
            (name, f"{text} {unit}".strip(), verdict[ok]) for name, text, unit, ok in (r.cells() for r in self.rows())
        ]
        # one long text does not push all verdicts to the right: its own stands behind it
        wide = max([30, *(len(name) + 2 for name, _, _ in cells)])
        return "\n".join(f"{name:<{wide}}{text + '  ':<42}{ok}".rstrip() for name, text, ok in cells)


def audit(trajectory: Recorded) -> Audit:
    """Judge a trajectory."""
    finite = all(bool(np.isfinite(getattr(trajectory, name)).all()) for name in _JUDGED)
    steps = trajectory.n_iter[1:]
    return Audit(
        **(_judged(trajectory) if finite else _nothing(trajectory)),
        finite=finite,
        n_steps=len(steps),
        n_iter_mean=float(steps.mean()) if len(steps) else 0.0,
        n_iter_max=int(steps.max(initial=0)),
        rungs=dict(Counter(str(r) for r in trajectory.solver_path[1:])),
        success=bool(trajectory.success),
        message=trajectory.message,
        length=trajectory.system.contacts.length,
        chosen=_chosen(trajectory),
    )


def _nothing(trajectory: Recorded) -> dict[str, Any]:
    """What is said where nothing can be judged."""
    names = ("penetration", "cone_violation", "sign_violation", "complementarity", "slip_law", "impact_law", "forces",
             "impulses", "displacements", "drift_g", "drift_rate", "quaternion", "span")  # fmt: skip
    energy = EnergyVerdict(np.nan, None, np.nan, None, np.nan, "", np.nan)
    return {**dict.fromkeys(names, np.nan), "rank": (0, len(trajectory.constraint_names)), "energy": energy}


def _judged(trajectory: Recorded) -> dict[str, Any]:
    """The residuals of all laws."""
    laws, motion, constraints = judge_contacts(trajectory), trajectory.contact_motion, trajectory.constraint_motion
    left, chosen = trajectory.replay.unbalance, trajectory.chosen
    whole = trajectory.kept is None or not (trajectory.constraint_names or trajectory.kept.has_forces)
    steps = whole and (chosen is None or not chosen.sampled)
    forces = whole and not trajectory.on_velocity_level
    rows = len(trajectory.constraint_names)
    deepest = -float(motion.smallest_gap.min()) if trajectory.system.contacts.n else 0.0
    return {
        "penetration": float(np.maximum(0.0, deepest)),
        "cone_violation": laws.cone,
        "sign_violation": laws.sign,
        "complementarity": laws.complementarity,
        "compliance": laws.compliance,
        "slip_law": float(np.maximum(laws.slip, laws.percussion_slip)),
        "impact_law": max(float(hits.residual.max(initial=0.0)) for hits in _hits(trajectory)),
        "forces": float(left.force_ratio().max()) if forces else None,
        "impulses": float(left.step_ratio().max()) if steps else None,
        "displacements": float(displacement_ratio(trajectory).max()) if steps else None,
        "drift_g": float(np.abs(constraints.g).max(initial=0.0)),
        "drift_rate": float(np.abs(constraints.rate).max(initial=0.0)) / _speed(trajectory),
        "rank": (int(constraints.rank.min(initial=rows)), rows),
        "quaternion": _quaternion_error(trajectory),
        "energy": judge_energy(trajectory),
        "moved": _moved(trajectory) if trajectory.on_velocity_level else 0.0,
        "span": max(trajectory.system.contacts.length, float(constraints.size.max(initial=0.0))),
    }


def _hits(trajectory: Recorded) -> list[ImpactLaws]:
    """The located impacts, and that with which the run began."""
    at_start = [] if trajectory.entry is None else [judge_impacts(trajectory, trajectory.entry)]
    return [trajectory.impact_laws, *at_start]


def _moved(trajectory: Recorded) -> float:
    """Largest displacement in a step, of coordinates and of gaps [m or rad]."""
    h = np.diff(trajectory.t)[:, None]
    ways = (np.abs(h * x[:-1]).max(initial=0.0) for x in (trajectory.v, trajectory.replay.rate))
    return float(max(ways))


def _speed(trajectory: Recorded) -> float:
    """Speed of the run, or what its forces make of rest in a step, or of which a part is none [m/s or rad/s]."""
    fastest = float(np.abs(trajectory.v).max(initial=0.0))
    return max(fastest, speed_made(trajectory), speed_of_rest(trajectory) / DRIFT)


def _chosen(trajectory: Recorded) -> tuple[AuditRow, ...]:
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


def _quaternion_error(trajectory: Recorded) -> float:
    """Largest distance of a configuration from the one with unit quaternions and (cos, sin) pairs of norm one."""
    model = trajectory.scene.model
    if model.nq == model.nv:
        return 0.0
    return max(float(np.abs(q - pin.normalize(model, q)).max()) for q in trajectory.q[:, : model.nq])
