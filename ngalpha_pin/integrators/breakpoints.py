"""A step across moments at which what is given jumps: it ends there, and begins anew just after them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import consistent_state
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.integrators.impact_splitting import impulses
from ngalpha_pin.integrators.method import Method, attempted, attempted_ahead
from ngalpha_pin.scene.breakpoints import side
from ngalpha_pin.step_equations.contact_history import join_percussions
from ngalpha_pin.system.state import Impact, State, StepResult
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
    return bool(np.abs(rows.rate).max() > JUMPS * max(rows.sizes[1], float(np.sqrt(system.contacts.length * 9.81))))


def step_across(method: Method, system: System, state: State, dt: float, breakpoints: np.ndarray) -> StepResult:
    """A step that is divided at the breakpoints within it.

    Args:
        method: of its parts.
        system: compiled scene.
        state: start of the step.
        dt: step [s].
        breakpoints: increasing, shape (n,) [s].
    """
    tiny, end = AT_END * dt, state.t + dt
    within = breakpoints[(breakpoints > state.t + tiny) & (breakpoints <= end + tiny)]
    if not len(within):
        return attempted(method, system, state, dt)
    done: State | None = None
    impacts: tuple[Impact, ...] = ()
    n_iter = 0
    for t in within:
        part = attempted(method, system, state, float(t) - side(t) - state.t)
        if not part.converged:
            return part
        state, hit = _after(system, part.state, float(t))
        done = part.state if done is None else join_percussions(system, done, part.state)
        if hit is not None:
            done = join_percussions(system, done, impulses(hit, system.joint_friction.f))
        n_iter, impacts = n_iter + part.n_iter, (*impacts, *part.impacts, *((hit,) if hit else ()))
    last = part
    if end - state.t > tiny:
        last = attempted(method, system, state, end - state.t)
        state, n_iter, impacts = last.state, n_iter + last.n_iter, (*impacts, *last.impacts)
    assert done is not None
    joined = replace(join_percussions(system, done, state), t=end, whole=dt)
    return replace(last, state=joined, n_iter=n_iter, impacts=impacts)


def steps_ahead(
    method: Method, system: System, state: State, dt: float, n: int, breakpoints: np.ndarray
) -> list[StepResult]:
    """One step, see `step_across`, or up to n of them where nothing happens in them and no breakpoint is near."""
    following = breakpoints[breakpoints > state.t - dt]
    room = n if not len(following) else min(n, int((following[0] - state.t) / dt) - 1)
    return attempted_ahead(method, system, state, dt, room) or [step_across(method, system, state, dt, breakpoints)]


def _after(system: System, state: State, t: float) -> tuple[State, Impact | None]:
    """The state just after a breakpoint at t, and the impact there if velocities jump."""
    now, hit = t + side(t), None
    if system.slots.n:
        system.slots.restore(state.slots)
    if velocity_jumps(system, now, state.q, state.v):
        hit = impact(system, now, state.q, state.v)
        hit = None if hit is None else hit._replace(t=t)
    v = state.v if hit is None else hit.v_after
    after = consistent_state(system, now, state.q, v, state.actuation)
    return replace(after, near=state.near, clearance=state.clearance, dt=0.0), hit
