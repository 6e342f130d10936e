"""What a step starts from: auxiliary variables of its length, and nothing that it is too long to resolve.

From an acceleration a of a mode of frequency omega the method makes in its first step a velocity of
((1 - rho_inf) / 2)^2 dt a, because with (72) gamma / (2 beta) is not 1 but 1 - ((1 - rho_inf) / 2)^2. Where the steps
stay as long as they are this does no harm: with Omega = omega dt far above 1 no step leaves an acceleration of more
than a velocity by dt. But a step behind an impact is longer than what came before, and the impact leaves stiff modes
a velocity v that only a resolved vibration could take up. No start makes both ends of such a step small: with
gamma / (2 beta) < 1 a velocity of some -v / 2 is left, or a displacement; and where material damps, with the
retardation time tau, the step asks for q + tau v = 0 and leaves the strain energy of q = tau v / 2, which is
(omega tau / 2)^2 times the energy that there was.

Such a step relaxes: with `RELAXES` for (72),

    u1 = u0 + dt a1,   q1 = q0 + dt u0 + dt^2 (a1 - a0 / 2),

and with accelerations a0 averaged over it twice, S M^-1 S a0 = f with S = M + dt D + dt^2 K, which no stiff mode has.
In no mode does it make energy (damped or not, of any frequency), of stiff ones it leaves nothing, and for what is
resolved positions have an error of order dt^3, velocities of dt^2 / 2 times the change of acceleration. The step after
it starts from accelerations that are averaged once, by S of its own coefficients: those of the end of a step that
relaxes are what has stopped the stiff modes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.initialization.initial import NEAR, consistent_state, resting_contacts, with_forces
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.step.contact_history import keep_contacts, remembered
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

OVERSHOOT = 0.1  # of a velocity, which is 1 % of its energy
RELAXES = (0.0, 0.0, 1.0, 1.0)  # alpha_f, alpha_m, gamma and beta of implicit Euler
LONGER = 1.01  # times the step before; by less only rounding of times does


def begin(piece: Piece, keep_open: bool = False) -> Piece:
    """The step from the state as one of its length starts from it.

    Args:
        piece: the step from the end of the step before.
        keep_open: contacts whose percussions have done all of the work stay, although they may be open.
    """
    state, dt = piece.state, piece.dt
    longer = dt > LONGER * state.dt
    behind = state.memory is None and not longer  # a step that has relaxed
    begun = rescale(state if keep_open and not state.la_N.any() else without_open(piece.system, state), dt)
    piece = piece._replace(state=begun)
    return without_unresolved(piece, relax=longer) if longer or behind else piece


def relaxes(parameters: Parameters) -> bool:
    """A step that has begun with these coefficients takes away what it does not resolve."""
    return parameters.coefficients == RELAXES


def ended(begun: Piece, end: State) -> State:
    """The end of a step as the next one takes it: one that relaxes leaves nothing to remember."""
    return replace(end, memory=None) if relaxes(begun.parameters) else end


def rescale(state: State, dt: float) -> State:
    """Carry the auxiliary variables over to another step size.

    a_bar approximates a at t + (alpha_m - alpha_f) dt (71), so its distance from a is proportional to dt.
    """
    if state.dt in (0.0, dt):
        return state
    if state.memory is None:
        return replace(state, dt=dt)
    s, bar = dt / state.dt, state.memory
    memory = Auxiliary(
        state.a + s * (bar.a_bar - state.a),
        state.la_N + s * (bar.la_N_bar - state.la_N),
        state.la_F + s * (bar.la_F_bar - state.la_F),
        state.tau_f + s * (bar.tau_f_bar - state.tau_f),
    )
    return replace(state, memory=memory, dt=dt)


def without_open(system: System, state: State) -> State:
    """The state without the contacts that it only reports on, because they carried a percussion and are open again."""
    remembers = (state.auxiliary.la_N_bar != 0.0) | system.contacts.soft[state.contacts]
    return state if remembers.all() else keep_contacts(system, state, remembers)


def after_jump(system: System, state: State) -> State:
    """The state where what acts has jumped: its accelerations and forces are those just after.

    What the auxiliary variables are apart from accelerations and forces stays as it was, so that forces that are held
    for a step each leave the method of second order.

    Args:
        system: compiled scene.
        state: end of the step before, with the force that is held from now on.
    """
    if state.P_N.any() and not state.la_N.any():  # percussions do all of the work
        return state
    if system.slots.n:
        system.slots.restore(state.slots)
    after = consistent_state(system, state.t, state.q, state.v, state.actuation)
    contacts, k = after.contacts, len(after.contacts)
    known = keep_contacts(system, state, np.isin(state.contacts, contacts))
    bar = known.auxiliary
    apart = remembered(system, known, contacts, (bar.la_N_bar - known.la_N, bar.la_F_bar - known.la_F))[0]
    memory = Auxiliary(
        after.a + (bar.a_bar - state.a),
        after.la_N + apart[:k],
        after.la_F + apart[k:],
        after.tau_f + (bar.tau_f_bar - state.tau_f),
    )
    return replace(after, memory=memory, near=state.near, clearance=state.clearance, dt=state.dt)


def without_unresolved(piece: Piece, relax: bool = True) -> Piece:
    """The step, after `rescale`, as it begins: as it is where nothing is too stiff for it.

    Args:
        piece: the step.
        relax: it takes away what it does not resolve; otherwise it only starts from averaged accelerations.
    """
    parameters, system, state, dt = piece
    if not system.loaded(state.actuation) and system.beams is None:
        return piece
    t, q, v = state.t, state.q, state.v
    dynamics = system.dynamics(t, q, v, np.zeros_like(v), state.actuation)
    M, K, D = dense(dynamics.M), dt * dt * dense(dynamics.K), dt * dense(dynamics.D)
    if _overshoot(parameters, M, K, D) <= OVERSHOOT:
        return piece
    if relax:
        parameters = parameters.with_coefficients(RELAXES)
    af, am, gamma, beta = parameters.coefficients
    M = np.triu(M) + np.triu(M, 1).T
    S = M + (1 - af) / (1 - am) * (gamma * _symmetric(D) + beta * _symmetric(K))

    def response(f: np.ndarray) -> np.ndarray:
        once: np.ndarray = np.linalg.solve(S, f)
        return np.linalg.solve(S, M @ once) if relax else once

    a = response(-dynamics.residual)
    smooth = State(t, q, v, a, slots=state.slots, tau=state.tau, holding=state.holding)
    far = system.slots.n == 0 and state.clearance > NEAR * system.contacts.length  # others are open
    sub, speed = resting_contacts(system, q, v, state.near if far else None)
    if system.layout(sub).n:
        smooth = with_forces(system, sub, smooth, speed, response)
    smooth = replace(smooth, near=state.near, clearance=state.clearance, dt=dt)
    return piece._replace(parameters=parameters, state=smooth)


def _overshoot(parameters: Parameters, M: np.ndarray, K: np.ndarray, D: np.ndarray) -> float:
    """Velocity out of nothing, in parts of that of the vibration, with K and D multiplied by dt^2 and dt."""
    by_M = np.sqrt(np.outer(M.diagonal(), M.diagonal()))
    squared, damping = float((np.abs(K) / by_M).max()), float((np.abs(D) / by_M).max())
    extrapolated = (parameters.alpha_f - parameters.alpha_m) * squared
    return ((1 - parameters.rho_inf) / 2) ** 2 * max(np.sqrt(squared), extrapolated, damping)


def _symmetric(A: np.ndarray) -> np.ndarray:
    return (A + A.T) / 2
