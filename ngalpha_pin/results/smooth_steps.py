"""Work in steps of chosen accuracy, which are too long for trapezoids.

In such a step a force is known at both ends and by its percussion, which makes a polynomial of the second degree in
time; a rate is known with its acceleration at both ends, of the third. At a moment at which forces jump, the recorded
ones are those just after it: a step that ends there does without them. Powers of dampers and of what feeds energy in
are those of the forces on such a motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.results.dampers import stored_and_damped
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

# of the product of both polynomials three are exact, of powers four are nearly
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
PLACES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
# error constants of the trapezoid, and of an integral by values and derivatives at both ends, of the fourth order
TRAPEZOID, HERMITE = 1 / 12, 1 / 720


class SmoothSteps(NamedTuple):
    """Steps of chosen accuracy whose two ends are recorded, s of them.

    Attributes:
        step: number of the recorded time at their ends, shape (s,).
        h: their lengths, shape (s, 1) [s].
        jumps: forces jump at their ends, shape (s,).
        struck: first of the located impacts at their ends, or -1, shape (s,).
    """

    step: np.ndarray
    h: np.ndarray
    jumps: np.ndarray
    struck: np.ndarray


def smooth_steps(trajectory: Recorded) -> SmoothSteps:
    """Those of a run; an impact in one of them is at its end."""
    t, impacts = trajectory.t, trajectory.impacts
    chosen, nothing = trajectory.chosen, np.zeros(0, dtype=int)
    if chosen is None or chosen.sampled:
        return SmoothSteps(nothing, np.zeros((0, 1)), nothing.astype(bool), nothing)
    ends = trajectory.solver_path == "smooth"
    ends[0] = False
    struck, moments = np.full(len(t), -1), np.array([event.t for event in trajectory.events])
    for x in range(len(impacts.t) - 1, -1, -1):
        struck[impacts.step[x]] = x
        ends[impacts.step[x]] &= impacts.t[x] == t[impacts.step[x]]
    carries = trajectory.la_N > 0.0
    jumps = np.isin(t, moments) | (struck >= 0)
    jumps[1:] |= (carries[1:] != carries[:-1]).any(axis=1)
    if trajectory.tau.size:
        jumps |= (trajectory.tau_step != trajectory.tau).any(axis=1)
    step = np.flatnonzero(ends)
    return SmoothSteps(step, (t[step] - t[step - 1])[:, None], jumps[step], struck[step])


def works(trajectory: Recorded, steps: SmoothSteps) -> tuple[np.ndarray, np.ndarray]:
    """Of the contact forces between impacts, without what surfaces do, (s, k + m), and of surfaces, (s,) [J]."""
    replay, judged, i = trajectory.replay, trajectory.impact_laws, steps.step
    P = np.hstack((trajectory.P_N, trajectory.P_F))[i]
    rates = replay.start_rate[i], replay.rate[i].copy()
    drives = replay.start_surface_rate[i], replay.surface_rate[i].copy()
    driven = np.zeros(len(i))
    for row in np.flatnonzero(steps.struck >= 0).tolist():
        hits = judged.step == i[row]
        P[row] -= judged.P[hits].sum(axis=0)
        driven[row] = -(judged.P[hits] * judged.surface_rate[hits]).sum()
        rates[1][row] = judged.before[steps.struck[row]]
        drives[1][row] = judged.surface_rate[steps.struck[row]]
    forces = _Forces(np.hstack((trajectory.la_N, trajectory.la_F)), P, steps)
    driven -= forces.work(drives[0], drives[1], replay.surface_acceleration).sum(axis=1)
    return forces.work(rates[0], rates[1], replay.acceleration), driven


def unresolved_work(trajectory: Recorded, steps: SmoothSteps) -> np.ndarray:
    """By how much the work of contact forces that change within steps may be off, shape (s,) [J]."""
    replay, judged, i = trajectory.replay, trajectory.impact_laws, steps.step
    P = np.hstack((trajectory.P_N, trajectory.P_F))[i]
    for row in np.flatnonzero(steps.struck >= 0).tolist():
        P[row] -= judged.P[judged.step == i[row]].sum(axis=0)
    forces = _Forces(np.hstack((trajectory.la_N, trajectory.la_F)), P, steps)
    speed = np.maximum(np.abs(replay.start_rate[i]), np.abs(replay.rate[i]))
    return np.asarray(HERMITE * (forces.change**4 * np.abs(P) * speed).sum(axis=1))


def work_of_joint_friction(trajectory: Recorded, steps: SmoothSteps) -> np.ndarray:
    """In each step, shape (s,) [J]."""
    dofs, i = trajectory.system.joint_friction.dofs, steps.step
    last = trajectory.v[i].copy()
    for row in np.flatnonzero(steps.struck >= 0).tolist():
        last[row] = trajectory.impacts.v_before[steps.struck[row]]
    forces = _Forces(trajectory.tau_f, trajectory.P_f[i], steps)
    return forces.work(trajectory.v[i - 1][:, dofs], last[:, dofs], trajectory.a[:, dofs]).sum(axis=1)


class _Forces:
    """Polynomials of forces within steps.

    Args:
        la: at all recorded times, shape (n + 1, r).
        P: percussions of the steps, without those of impacts, shape (s, r).
        steps: the steps.
    """

    def __init__(self, la: np.ndarray, P: np.ndarray, steps: SmoothSteps):
        self._steps, self._mean, self._first = steps, P / steps.h, la[steps.step - 1]
        self._last = np.where(steps.jumps[:, None], 2 * self._mean - self._first, la[steps.step])

    @property
    def change(self) -> np.ndarray:
        """Phase by which they change in each step, at most 1 where they do so from nothing, shape (s, r) [rad].

        By the difference of their ends, and where they pass an extremum by what their mean differs from that of the
        ends: for an oscillation it is the phase squared, by the error constant of the trapezoid.
        """
        size = np.maximum(np.maximum(np.abs(self._first), np.abs(self._last)), TINY)
        bent = np.abs(self._mean - (self._first + self._last) / 2) / (TRAPEZOID * size)
        return np.asarray(np.minimum(np.maximum(np.abs(self._last - self._first) / size, np.sqrt(bent)), 1.0))

    def at(self, s: float) -> np.ndarray:
        """At a part of the steps."""
        straight = (1 - s) * self._first + s * self._last
        return np.asarray(straight + 6 * s * (1 - s) * (self._mean - (self._first + self._last) / 2))

    def work(self, first: np.ndarray, last: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """On rates at both ends, with accelerations at all recorded times, shape (s, r)."""
        i, h = self._steps.step, self._steps.h
        a_0 = acceleration[i - 1]
        a_1 = np.where(self._steps.jumps[:, None], 2 * (last - first) / h - a_0, acceleration[i])
        places = zip(PLACES.tolist(), WEIGHTS.tolist(), strict=True)
        return np.asarray(sum(w * h * self.at(s) * _cubic(s, h, first, a_0, last, a_1) for s, w in places))


def powers(trajectory: Recorded, steps: SmoothSteps) -> tuple[np.ndarray, np.ndarray]:
    """Work of dampers, and of what can feed energy in, in each step, shape (s,) each [J]."""
    damping, feeding = np.zeros((2, len(steps.step)))
    if not (trajectory.replay.damping.any() or trajectory.replay.feeding.any()):
        return damping, feeding
    v, a = trajectory.v, trajectory.a
    for row, i in enumerate(steps.step.tolist()):
        h, x = float(steps.h[row, 0]), steps.struck[row]
        v_1 = v[i] if x < 0 else trajectory.impacts.v_before[x]
        a_1 = 2 * (v_1 - v[i - 1]) / h - a[i - 1] if steps.jumps[row] else a[i]
        for s, weight in zip(PLACES.tolist(), WEIGHTS.tolist(), strict=True):
            there = _cubic(s, h, v[i - 1], a[i - 1], v_1, a_1)
            found = _powers_at(trajectory, i, s, _displacement(trajectory, i, s, h, v_1, a_1), there)
            damping[row] += weight * h * found[0]
            feeding[row] += weight * h * found[1]
    return damping, feeding


def _cubic(s: float, h: np.ndarray | float, y: np.ndarray, dy: np.ndarray, z: np.ndarray, dz: np.ndarray) -> np.ndarray:
    """At a part of a step between values and derivatives at its ends."""
    r = 1 - s
    found: np.ndarray = r * r * ((1 + 2 * s) * y + s * h * dy) + s * s * ((1 + 2 * r) * z - r * h * dz)
    return found


def _displacement(trajectory: Recorded, i: int, s: float, h: float, v_1: np.ndarray, a_1: np.ndarray) -> np.ndarray:
    """From the start of a step up to a part of it: the integral of the cubic of velocities, led to the known end."""
    v, a = trajectory.v[i - 1], trajectory.a[i - 1]
    whole = trajectory.system.difference(trajectory.q[i - 1], trajectory.q[i])
    missing = whole - h * (v + v_1) / 2 - h * h * (a - a_1) / 12
    s2, s3, s4 = s * s, s**3, s**4
    way = h * ((s - s3 + s4 / 2) * v + (s3 - s4 / 2) * v_1)
    way += h * h * ((s2 / 2 - 2 * s3 / 3 + s4 / 4) * a + (s4 / 4 - s3 / 3) * a_1)
    return np.asarray(way + s3 * (10 - 15 * s + 6 * s2) * missing)


def _powers_at(trajectory: Recorded, i: int, s: float, way: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Of dampers and of what can feed energy in, at a part of the step that ends at a recorded time [W]."""
    system, model = trajectory.system, trajectory.scene.model
    t = float((1 - s) * trajectory.t[i - 1] + s * trajectory.t[i])
    q = system.integrate(trajectory.q[i - 1], way)
    system.dynamics(t, q, v, np.zeros_like(v))
    damping = 0.0 if system.beams is None else system.beams.damping_power(q, v)
    held = Actuation(trajectory.tau_step[i]) if trajectory.tau.size else NO_ACTUATION
    loads = system.loads(t, q, v, held)
    if loads is None:
        return damping, 0.0
    q, v = q[: model.nq], v[: model.nv]
    stored, damped = stored_and_damped(system, t, q, v)
    return damping + float(damped @ v), float((loads[0][: model.nv] - stored - damped) @ v)
