"""A step across moments at which what is given jumps or a control is sampled: it ends there, and begins anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import consistent_state, without_lost
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.integrators.joining import impulses
from ngalpha_pin.integrators.method import Method, attempted, attempted_ahead
from ngalpha_pin.integrators.parts import Moment
from ngalpha_pin.integrators.restart import after_jump
from ngalpha_pin.scene.breakpoints import side
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.system.sampling import due, with_samples
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# a given motion that jumps by more than this part of the size of the scene, or of its speed, is not continuous there
JUMPS = 1e-8
# a breakpoint this near to the end of a step, in parts of it, is there
AT_END = 1e-9


def velocity_jumps(system: System, t: float, q: np.ndarray, v: np.ndarray) -> bool:
    """Whether constraints ask for another velocity from now on.

    Args:
        system: compiled scene.
        t: just after a breakpoint [s].
        q: configuration, shape (nq,).
        v: velocity before it, shape (nv,).

    Raises:
        SceneError: a given motion jumps itself.
    """
    if not system.constraints.names:
        return False
    still = np.zeros(system.nv)
    system.dynamics(t, q, v, still)
    rows = system.constraint_rows(t, q, v, still)
    off = np.abs(rows.g)
    if len(off) and off.max() > JUMPS * max(rows.sizes[0], system.contacts.length):
        name = system.constraints.names[int(np.argmax(off))]
        raise SceneError(f"{name}: the given motion jumps by {off.max():.3g} at t = {t:g} s")
    return bool(np.abs(rows.rate).max() > JUMPS * max(rows.sizes[1], system.contacts.speed))


def step_across(
    method: Method, system: System, state: State, dt: float, breakpoints: np.ndarray, tau: np.ndarray | None = None
) -> StepResult:
    """A step that is divided at the breakpoints and the samples within it.

    Args:
        method: of its parts.
        system: compiled scene.
        state: start of the step.
        dt: step [s].
        breakpoints: increasing, shape (n,) [s].
        tau: what a `Simulator` holds in it beside the samples, shape (nv,) or (0,).
    """
    tiny, end = AT_END * dt, state.t + dt
    jumps = breakpoints[(breakpoints > state.t + tiny) & (breakpoints <= end + tiny)]
    within = np.union1d(jumps, due(system, state, end + tiny)) if system.samplers else jumps
    if not len(within):
        return _keeping(attempted(method, system, state, dt), state)
    done: State | None = None
    parts: list[StepResult] = []
    lengths: list[float] = []
    pieces: tuple[Any, ...] = ()
    impacts: tuple[Impact, ...] = ()
    for t in within.tolist():
        jump = t in jumps
        stop = t - side(t) if jump else end if abs(t - end) <= tiny else t
        if stop - state.t > tiny:
            lengths.append(dt if stop == end and not lengths else stop - state.t)  # a whole step is as long as all are
            parts.append(_keeping(attempted(method, system, state, lengths[-1]), state))
            if not parts[-1].converged:
                return parts[-1]
            state, impacts = parts[-1].state, (*impacts, *parts[-1].impacts)
            pieces = (*pieces, *parts[-1].parts)
            done = state if done is None else join_percussions(system, done, state)
        before = state
        state, hit = _after(system, state, t, jump, t + tiny, tau)
        pieces = (*pieces, Moment(SolvedBy.START, before, state, hit))
        if hit is not None:
            assert done is not None
            done, impacts = join_percussions(system, done, impulses(hit, system.joint_friction.f)), (*impacts, hit)
    if end - state.t > tiny:
        parts.append(_keeping(attempted(method, system, state, end - state.t), state))
        lengths.append(end - state.t)
        state, impacts = parts[-1].state, (*impacts, *parts[-1].impacts)
        pieces = (*pieces, *parts[-1].parts)
    else:
        state = without_percussions(state)  # they are those of the part before it
    whole = 0.0 if len(parts) == 1 and not len(jumps) else dt
    joined = replace(state if done is None else join_percussions(system, done, state), t=end, whole=whole)
    mean = None
    if len(parts) > 1 and system.samplers:
        held = np.array([part.state.tau for part in parts])
        if system.effort is not None:  # what is cut off differs from part to part
            held = np.clip(held, *system.effort)
        mean = np.average(held, axis=0, weights=lengths)
    n_iter = sum(part.n_iter for part in parts)
    return replace(parts[-1], state=joined, n_iter=n_iter, impacts=impacts, tau=mean, parts=pieces)


def steps_ahead(
    method: Method,
    system: System,
    state: State,
    dt: float,
    n: int,
    breakpoints: np.ndarray,
    tau: np.ndarray | None = None,
) -> Sequence[StepResult]:
    """One step, see `step_across`, or up to n of them where nothing happens in them and no breakpoint is near."""
    following = breakpoints[breakpoints > state.t - dt]
    if system.samplers:
        following = np.union1d(following, due(system, state, state.t + (n + 1) * dt))
    room = n if not len(following) else min(n, int((following[0] - state.t) / dt) - 1)
    return attempted_ahead(method, system, state, dt, room) or [
        step_across(method, system, state, dt, breakpoints, tau)
    ]


def without_percussions(state: State) -> State:
    """The state as if no step had led to it."""
    nothing = {name: np.zeros_like(getattr(state, name)) for name in ("P_N", "P_F", "La_N", "La_F", "P_f", "La_b")}
    return replace(state, **nothing)


def _keeping(result: StepResult, state: State) -> StepResult:
    """A step with what sampled controls remember, of which methods know nothing."""
    return replace(result, state=replace(result.state, sampled=state.sampled)) if len(state.sampled) else result


def _after(
    system: System, state: State, t: float, jump: bool, until: float, tau: np.ndarray | None
) -> tuple[State, Impact | None]:
    """The state just after a breakpoint or a sample at t, and the impact there if velocities jump."""
    if system.slots.n:
        system.slots.restore(state.slots)
    before = state.tau
    if system.samplers:
        state = with_samples(system, replace(state, t=t), until, tau)
    if not jump:
        changed = not np.array_equal(state.tau, before)
        return replace(after_jump(system, state), sampled=state.sampled) if changed else state, None
    now, hit = t + side(t), None
    if velocity_jumps(system, now, state.q, state.v):
        hit = impact(system, now, state.q, state.v)
        hit = None if hit is None else hit._replace(t=t)
    v = state.v if hit is None else hit.v_after
    after = without_lost(system, consistent_state(system, now, state.q, v, state.actuation))
    return replace(after, near=state.near, clearance=state.clearance, sampled=state.sampled, dt=0.0), hit
