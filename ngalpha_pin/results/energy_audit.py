"""The verdict on energy: what no force explains, what rises though nothing feeds it in, and what impacts add.

Drives, wrenches, controls and constraints that move may raise energy by their work. All else may lower it by the work
of friction, dampers and impacts, which is known. What is left over is the error of the method. Over a step in which the
terms of the equations of motion change by the part rho of their size it is rho^2 of the work that they could do: of the
second order over a run, and by what the method damps four times as much with rho_inf = 0 as with 1. Where the rate of
the forces jumps, as at the end of a range without force, it is what their change differs by from that of the steps
beside. In steps that start anew, at the beginning and after an impact, it is rho of that work, and bounces that the
forces end within the step. Where rates or powers change within a step, as in an impact that is captured, the quadrature
of their work is off by half of the change. What a step leaves unsolved does work as well. In steps of chosen accuracy
both are rho^2 times less: there the account is of the fourth order (see `smooth_steps`), also in the phase by which
contact forces change, and no error near the tolerance of the run is a fault. These add up to what is accepted; but
beyond `ACCEPTED`, and a rise beyond `RISES`, nothing is, whatever the order says.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import RECORDED, TINY
from ngalpha_pin.results.energy_balance import Balance, balance
from ngalpha_pin.results.equations import NEIGHBOURS
from ngalpha_pin.results.smooth_steps import smooth_steps, unresolved_work

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

ACCEPTED = 0.05  # part of the energy that a method of any order may make or lose
RISES = 0.01  # part of the energy by which it may rise with nothing that feeds it in: no mechanical system does that
ROUNDING = 1e-9  # part of the energy that is none
SOLVED = 1e-10  # residual of the equations of a step, relative to its typical force
GAIN = 1e-3  # part of the energy that an impact may add
CHOSEN = 100.0  # times the tolerance of a run of chosen accuracy, likewise
UNRESOLVED = 1.0  # phase of an oscillation [rad] in a step that does not resolve it
RESOLVED = 0.5  # change of the terms of the equations, or turning [rad], in a resolved step


class EnergyVerdict(NamedTuple):
    """What can be said of energy, in parts of the largest kinetic energy or exchange of energy [-].

    Attributes:
        left_over: largest change that no work explains, a gain or a loss.
        closes: it stays within its tolerance; None where steps between recorded times are not known.
        rise: largest rise of the energy above an earlier value, without what is fed in.
        falls: it stays within its tolerance; None where it is not known what is fed in.
        gain: largest gain at a located impact; Newton's law with friction may have one (see `ImpactLaws`).
        cause: of what is not accepted, in words.
        change: energy at the end minus energy at the start [J].
    """

    left_over: float
    closes: bool | None
    rise: float
    falls: bool | None
    gain: float
    cause: str
    change: float


def judge_energy(trajectory: Recorded) -> EnergyVerdict:
    """The verdict on a run."""
    account, hits = balance(trajectory), trajectory.impact_laws
    # at rest the energy that the forces would make in a step is the unit, not the rounding of velocities; those of a
    # step with an impact would make any energy seem small
    made = (np.diff(trajectory.t) * trajectory.replay.unbalance.force_unit[1:]) ** 2
    at_rest = float(np.delete(made, hits.step - 1).min(initial=np.inf))
    account = account._replace(scale=max(account.scale, at_rest if np.isfinite(at_rest) else 0.0))
    lost, own = (
        account.left_over / account.scale,
        (account.change - account.controls - account.surfaces) / account.scale,
    )
    rise, gain = own - np.minimum.accumulate(own), hits.gain / account.scale
    tolerances = _tolerances(trajectory, account)
    closes, falls = (
        None if allowed is None else bool((x <= allowed).all())
        for x, allowed in zip((np.abs(lost), rise), tolerances, strict=True)
    )
    largest, cause = float(gain.max(initial=0.0)), ""
    if not largest <= GAIN:
        x = int(np.argmax(gain))
        newton = hits.gain[x] <= hits.allowed[x] + GAIN * account.scale
        law = "Newton's law of impact with friction" if newton else "an impact beyond its laws"
        cause = f"{law} at t = {trajectory.impacts.t[x]:.6g} s"
    elif closes is False or falls is False:
        change = own if falls is False else lost
        cause = _cause(trajectory, 1 + int(np.argmax(np.abs(np.diff(change)) if closes is False else np.diff(change))))
    return EnergyVerdict(
        float(np.abs(lost).max()), closes, float(rise.max()), falls, largest, cause, float(account.change[-1])
    )


def _tolerances(trajectory: Recorded, account: Balance) -> tuple[np.ndarray | None, np.ndarray | None]:
    """What may be left over and what may rise, in parts of the scale, shape (n + 1,) each; None: it is not judged."""
    chosen, kept = trajectory.chosen, trajectory.kept
    conserved, forces = (
        trajectory.energy.conserved,
        kept is not None and (kept.has_forces or len(trajectory.constraint_names) > 0),
    )
    if forces:
        return None, None  # forces and constraints are not in the file
    order = ROUNDING + np.cumsum(_order(trajectory)) / account.scale
    if chosen is None:
        return np.minimum(order, ACCEPTED), np.minimum(order, RISES) if conserved else None
    rise = np.full(len(order), min(ROUNDING + CHOSEN * (chosen.rtol + chosen.atol), RISES))
    fed = account.controls.any() or account.surfaces.any() or not conserved
    left_over = np.maximum(order, CHOSEN * (chosen.rtol + chosen.atol))
    if not _driven(trajectory).any():  # of their forces neither percussions nor those before a jump are known
        left_over = np.minimum(left_over, ACCEPTED)
    return None if chosen.sampled else left_over, None if fed else rise


def _order(trajectory: Recorded) -> np.ndarray:
    """What the error of a method of the second order may be in the step that ends at a time, shape (n + 1,) [J]."""
    replay, h = trajectory.replay, np.diff(trajectory.t)
    left = replay.unbalance
    size = np.maximum(np.maximum(left.exchange, left.exchange_change), TINY)
    rho, speed = left.exchange_change / size, np.linalg.norm(trajectory.v * left.root, axis=1)
    speed[1:] = np.maximum(speed[1:], speed[:-1])
    steps = np.concatenate(([1], trajectory.impact_laws.step))
    anew = np.isin(np.arange(len(trajectory.t)), np.concatenate((steps, steps + 1)))
    long = smooth_steps(trajectory)
    smooth = np.isin(np.arange(len(trajectory.t)), long.step)
    power = np.where(smooth, 4, np.where(anew, 1, 2))
    order = np.where(power == 2, _error_constant(trajectory.method), 1.0) * rho**power * size * speed
    order[long.step] += unresolved_work(trajectory, long)
    order[1:] += (anew & ~smooth)[1:] * (h * left.force_unit[1:]) ** 2
    order[1:] += ~smooth[1:] * h * _kinks(left.bias_change[1:], h) * speed[1:]
    # residuals are measured in weights, also where none acts on what moves
    order[1:] += SOLVED * h * np.maximum(left.force_unit[1:], trajectory.system.weight) * speed[1:]
    every = np.arange(1, len(trajectory.t))
    changes = np.abs(replay.rate - replay.start_rate) + np.abs(replay.surface_rate - replay.start_surface_rate)
    trapezoid = np.where(smooth, rho**2, 1.0)[1:] / 2
    order[1:] += trapezoid * (np.abs(left.percussions(every)) * changes[1:]).sum(axis=1)
    ending, starting = replay.feeding + replay.held
    for first, last in ((replay.damping, replay.damping), (starting, ending)):
        order[1:] += trapezoid * h * np.abs(last[1:] - first[:-1])
    order[1:] += h * np.abs(np.diff(_driven(trajectory))) / 2
    return order


def _kinks(change: np.ndarray, h: np.ndarray) -> np.ndarray:
    """By what the change of the forces in a step differs from that at the rates of the steps beside, shape (n,).

    Args:
        change: of the forces in each step, shape (n,).
        h: lengths of the steps, shape (n,) [s].
    """
    rate = change / h
    jumps = np.abs(np.diff(rate))
    return h * np.maximum(np.append(jumps, 0.0), np.append(0.0, jumps))


def _driven(trajectory: Recorded) -> np.ndarray:
    """Power of the constraints that move, shape (n + 1,) [W]."""
    forces = np.hstack((trajectory.la_g, trajectory.la_gamma))
    return np.asarray((forces * trajectory.replay.along).sum(axis=1))


def _error_constant(method: str) -> float:
    """Of the method with (72), in parts of that of the trapezoid, 1/12, which it has with rho_inf = 1.

    The largest of them, with rho_inf = 0, where it is not said.
    """
    said = re.search(r"rho_inf=([0-9.eE+-]+)", method)
    rho_inf = float(said[1]) if said else 0.0
    return 1.0 + 3.0 * ((1.0 - rho_inf) / (1.0 + rho_inf)) ** 2


def _relative_change(trajectory: Recorded) -> np.ndarray:
    """Change of the terms of the equations of motion in the step that ends at a time, in parts of them [-]."""
    left = trajectory.replay.unbalance
    return left.impulse_change / np.maximum(np.maximum(left.impulse_unit, left.impulse_change), TINY)


def _frequency(trajectory: Recorded, i: int) -> float:
    """Of the motion in the steps around one, at least, where springs, gravity and user's laws make one [rad/s].

    What their forces change with the displacement, M omega^2 dq, is exact between recorded times, whatever the step.
    """
    left, q, omega = trajectory.replay.unbalance, trajectory.q, 0.0
    for j in range(max(1, i - NEIGHBOURS), min(len(q), i + NEIGHBOURS + 1)):
        moved = float(np.abs(left.root * trajectory.system.difference(q[j - 1], q[j])).max(initial=0.0))
        if moved > 0.0:
            omega = max(omega, float(np.sqrt(left.bias_change[j] / moved)))
    return omega


def _cause(trajectory: Recorded, i: int) -> str:
    """Why the energy of the step that ends at a time may be wrong."""
    t, h = trajectory.t, trajectory.t[i] - trajectory.t[i - 1]
    when, model = f" at t = {t[i]:.6g} s", trajectory.system.tree
    turning = 0.0
    for joint in list(model.joints)[1:]:
        spins = joint.nv >= 3  # the last three coordinates of a spherical joint or a free flyer
        if spins:
            omega = trajectory.v[i, joint.idx_v + joint.nv - 3 : joint.idx_v + joint.nv]
            turning = max(turning, h * float(np.linalg.norm(omega)))
    omega = _frequency(trajectory, i) * h
    if omega > UNRESOLVED:
        return f"motion that is not resolved, omega dt = {omega:.2g} or more," + when
    turning = max(turning, float(_relative_change(trajectory)[i]))
    if (trajectory.impact_laws.step == i).any():  # it adds nothing itself, or it had been named before
        return "motion after an impact that the step does not resolve," + when
    closes = (trajectory.La_N[i] > 0.0) & (trajectory.g_N[i - 1] > RECORDED * trajectory.system.contacts.length)
    if closes.any() or trajectory.solver_path[i] in ("captured", "laws of the paper"):
        return "an impact that is captured within a step" + when
    if turning > RESOLVED:
        return f"motion that is not resolved, omega dt = {turning:.2g}," + when
    return f"the error of the method in motion that changes by {turning:.2g} of itself in a step," + when
