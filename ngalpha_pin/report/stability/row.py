"""A row of the table of stiff and extreme cases, and how a run becomes one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ngalpha_pin.results.trajectory import Trajectory

# lines of the audit that say no more than that a step is too long for a vibration: what must hold then is the rise
OF_ENERGY = ("energy that no work explains", "rise of energy")
ROUNDING = 1e-9  # part of the energy that counts as rounding where nothing moves


class Row(NamedTuple):
    """What a case gave.

    Attributes:
        case: what is tried, with its parameter.
        energy: largest rise of the energy in parts of what was exchanged, or what else is said of it.
        drift: of the constraints, or "-".
        penetration: deepest [m].
        cone: friction outside its cone, relative [-].
        iterations: mean and largest per step.
        rungs: how many steps each rung of the solver ladder solved.
        passed: every check holds.
        reason: what was found, or why it failed.
    """

    case: str
    energy: str
    drift: str
    penetration: str
    cone: str
    iterations: str
    rungs: str
    passed: bool
    reason: str


class Check(NamedTuple):
    """Something that must hold, with the number that shows it."""

    what: str
    value: float
    limit: float

    @property
    def holds(self) -> bool:
        """The value is within the limit; not a number is not."""
        return abs(self.value) <= self.limit

    def __str__(self) -> str:
        return f"{self.what} {self.value:.1e}" + ("" if self.holds else f", allowed {self.limit:.0e}")


class Case(NamedTuple):
    """A row to be made.

    Attributes:
        name: what is tried, with its parameter.
        run: makes the row.
        long: it takes more than some seconds.
        bound: what bounds it, in a few words, where it is known to fail.
    """

    name: str
    run: Callable[[], Row]
    long: bool = False
    bound: str = ""


def judged(name: str, run: Trajectory, checks: list[Check], rise: float = 1e-2) -> Row:
    """The row of a run: it must reach its end, obey the laws of contact and pass the checks.

    Args:
        name: of the case.
        run: whatever happened.
        checks: what is known of the motion.
        rise: of the energy that is allowed, in parts of what was exchanged; the integration error is of second order.
    """
    audit = run.audit()
    found = list(checks)
    risen = None if audit.energy_rise is None else _rise(run)
    if risen is not None:
        found.append(Check("rise of energy", risen, rise))
    failed = [str(check) for check in found if not check.holds]
    unresolved = audit.energy.cause.startswith("motion that is not resolved")
    failed += [
        f"{row.name}: {row.value}"
        for row in audit.rows()
        if row.ok is False and not (unresolved and row.name in OF_ENERGY)
    ]
    said = failed or [str(check) for check in checks] or ["reached its end, all laws of contact hold"]
    if unresolved:
        said.append(f"energy {audit.energy.left_over:.0%} off by {audit.energy.cause}")
    return Row(
        name,
        "-" if risen is None else f"{risen:.0e}",
        f"{audit.drift_g:.0e}" if audit.rank[1] else "-",
        f"{audit.penetration:.0e}",
        f"{audit.cone_violation:.0e}",
        f"{audit.n_iter_mean:.2g} / {audit.n_iter_max}",
        ", ".join(f"{rung} {count}" for rung, count in audit.rungs.items()),
        not failed,
        "; ".join(said),
    )


def _rise(run: Trajectory) -> float:
    """Largest rise of the energy above an earlier value, in parts of what was exchanged; rounding does not count."""
    total, kinetic = run.energy.total, run.energy.kinetic
    unit = max(float(kinetic.max()), float(np.ptp(total)), ROUNDING * float(np.abs(total).max()))
    return max(0.0, float((total - np.minimum.accumulate(total)).max())) / unit


def stepped(
    name: str, rungs: Counter[str], n_iter: int, worst: int, checks: list[Check], energy: str, violated: np.ndarray
) -> Row:
    """The row of a run whose steps are not kept: only the checks count.

    Args:
        name: of the case.
        rungs: how many steps each rung of the solver ladder solved.
        n_iter: iterations of all steps.
        worst: largest number of iterations of a step.
        checks: what is known of the motion.
        energy: what is said of the energy.
        violated: largest drift of constraints, penetration and friction outside its cone, wherever it was looked at.
    """
    drift, penetration, cone = violated
    laws = (("drift", drift, 1e-8), ("penetration", penetration, 1e-9), ("friction outside its cone", cone, 1e-6))
    failed = [str(check) for check in (*checks, *(Check(*law) for law in laws)) if not check.holds]
    solved = ", ".join(f"{rung} {count}" for rung, count in rungs.items())
    mean = n_iter / max(sum(rungs.values()), 1)
    said = "; ".join(failed or [str(check) for check in checks])
    numbers = (energy, f"{drift:.0e}", f"{penetration:.0e}", f"{cone:.0e}", f"{mean:.2g} / {worst}")
    return Row(name, *numbers, solved, not failed, said)


def made(case: Case) -> Row:
    """Run a case; one that cannot even be run is a row with the reason, and one that fails says what bounds it."""
    try:
        row = case.run()
        said = f"{row.reason}; bounded by {case.bound}"
        return row if row.passed or not case.bound else row._replace(reason=said)
    except Exception as error:  # whatever happens must show in the table
        return not_run(case, " ".join(f"{type(error).__name__}: {error}".split()))


def not_run(case: Case, reason: str) -> Row:
    """The row of a case of which nothing is known."""
    return Row(case.name, "-", "-", "-", "-", "-", "-", False, reason)
